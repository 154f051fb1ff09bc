//! Any bytes as a saved state of SBS: refused, or a state that takes the next frame.
#![no_main]

use libfuzzer_sys::fuzz_target;
use messages::{FrameLayout, Payload, PixelFormat};
use sbs::{Frame, Settings, State};

const WIDTH: u32 = 80;
const HEIGHT: u32 = 60;

fn frame(number: u64) -> Vec<u8> {
    (0..u64::from(WIDTH * HEIGHT)).map(|at| (80 + (at * 7 + at / u64::from(WIDTH) * 13) % 90 + (at + number) % 3) as u8).collect()
}

fuzz_target!(|bytes: &[u8]| {
    let layout = FrameLayout { width: WIDTH, height: HEIGHT, stride: WIDTH, format: PixelFormat::Grey as u32 };
    // A saved state is long: the input says where a good one is changed, and to what.
    let mut state = State::new(Settings { training_frames: 2, ..Settings::default() });
    for number in 0..3 {
        state.step(&Frame { stamp_ns: number + 1, layout, bytes: &frame(number), odometry: None });
    }
    let mut saved = state.save();
    for change in bytes.as_chunks::<5>().0 {
        let at = u32::from_le_bytes([change[0], change[1], change[2], change[3]]) as usize % saved.len();
        saved[at] = change[4];
    }
    for saved in [&saved[..], bytes] {
        if let Ok(mut state) = State::restore(Settings::default(), saved) {
            let answer = state.step(&Frame { stamp_ns: u64::MAX, layout, bytes: &frame(9), odometry: None });
            answer.motion.validate().unwrap();
        }
    }
});
