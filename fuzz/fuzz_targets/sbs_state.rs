//! A damaged state of SBS: rejected, or restored and able to process the next frame.
#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use messages::{FrameLayout, Payload, PixelFormat};
use sbs::{Frame, Parameters, State};

const WIDTH: u32 = 80;
const HEIGHT: u32 = 60;
const LAYOUT: FrameLayout = FrameLayout { width: WIDTH, height: HEIGHT, stride: WIDTH, format: PixelFormat::Grey as u32 };

fn frame(number: u64) -> Vec<u8> {
    (0..u64::from(WIDTH * HEIGHT)).map(|at| (80 + (at * 7 + at / u64::from(WIDTH) * 13) % 90 + (at + number) % 3) as u8).collect()
}

static SOUND: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let mut state = State::new(Parameters { training_frames: 2, ..Parameters::default() });
    for number in 0..3 {
        state.step(&Frame { stamp_ns: number + 1, layout: LAYOUT, bytes: &frame(number), odometry: None });
    }
    state.save()
});

fuzz_target!(|bytes: &[u8]| {
    let Some((how, bytes)) = bytes.split_first() else { return };
    // A saved state is long: the input selects the offset and the new value in a valid one, of one byte or four.
    let mut saved = if how & 0x80 == 0 { SOUND.clone() } else { bytes.to_vec() };
    if how & 0x80 == 0 {
        for change in bytes.as_chunks::<8>().0 {
            let [a, b, c, d, value @ ..] = *change;
            let at = u32::from_le_bytes([a, b, c, d]) as usize % saved.len();
            let count = if how & 1 == 0 { 1 } else { 4 };
            saved.iter_mut().skip(at).zip(value).take(count).for_each(|(byte, value)| *byte = value);
        }
    }
    if let Ok(mut state) = State::restore(Parameters::default(), &saved) {
        let answer = state.step(&Frame { stamp_ns: u64::MAX, layout: LAYOUT, bytes: &frame(9), odometry: None });
        answer.motion.validate().unwrap();
    }
});
