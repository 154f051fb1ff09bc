//! Frames of any header, stamp, pose and content: each is answered by a valid message, and stamps only increase.
#![no_main]

use libfuzzer_sys::arbitrary::{self, Arbitrary};
use libfuzzer_sys::fuzz_target;
use messages::{CameraStatus, FrameLayout, Payload};
use sbs::{Frame, Method, Odometry, Parameters, State};

/// A frame described by a few numbers.
#[derive(Debug, Arbitrary)]
struct Picture {
    /// Added to the previous stamp, or the stamp itself.
    time_ns: u64,
    absolute: bool,
    /// Above the smallest size.
    wider: u8,
    higher: u8,
    /// Whether header and bytes agree, or are set by these.
    honest: bool,
    format: u32,
    stride: u16,
    missing: u16,
    /// The picture: a texture that moves by so much, noise or one value.
    kind: u8,
    value: u8,
    seed: u64,
    shift: (i8, i8),
    yaw_rad: Option<f64>,
}

#[derive(Debug, Arbitrary)]
struct Input {
    training_frames: u8,
    icp: bool,
    horizon: f32,
    pictures: Vec<Picture>,
}

impl Picture {
    fn layout(&self) -> FrameLayout {
        let (width, height, format) = (76 + u32::from(self.wider % 32), 58 + u32::from(self.higher % 16), self.format % 4);
        let stride = if self.honest { width * [1, 2, 3, 1][format as usize] } else { u32::from(self.stride % 512) };
        FrameLayout { width, height, stride, format: if self.honest { format.min(2) } else { self.format } }
    }

    fn bytes(&self, layout: &FrameLayout) -> Vec<u8> {
        let stride = layout.stride.max(1) as usize;
        let mut noise = self.seed | 1;
        let pixel = |at: usize| {
            noise = noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let (u, v) = ((at % stride) as i32 + i32::from(self.shift.0), (at / stride) as i32 + i32::from(self.shift.1));
            match self.kind % 4 {
                0 => self.value,
                1 => (noise >> 56) as u8,
                2 => ((u * 37) ^ (v * 91)) as u8,
                _ => 100_i32.wrapping_add((u * v) / 7 % 60) as u8 ^ (noise >> 62) as u8,
            }
        };
        let mut bytes: Vec<u8> = (0..stride * layout.height as usize).map(pixel).collect();
        if !self.honest {
            bytes.truncate(bytes.len().saturating_sub(usize::from(self.missing % 700)));
        }
        bytes
    }
}

fuzz_target!(|input: Input| {
    let method = if input.icp { Method::Icp } else { Method::Direct };
    let parameters =
        Parameters { training_frames: usize::from(input.training_frames % 5), method, horizon: input.horizon, ..Parameters::default() };
    let mut state = State::new(parameters.clone());
    let mut last_ns = None;
    for picture in input.pictures.iter().take(12) {
        let layout = picture.layout();
        let bytes = picture.bytes(&layout);
        let stamp_ns =
            if picture.absolute { picture.time_ns } else { last_ns.unwrap_or(0_u64).saturating_add(picture.time_ns % 200_000_000) };
        let odometry = picture.yaw_rad.map(|yaw_rad| Odometry { yaw_rad });
        let answer = state.step(&Frame { stamp_ns, layout, bytes: &bytes, odometry });
        answer.motion.validate().unwrap();
        if answer.motion.status == CameraStatus::Refused as u32 {
            assert_eq!(answer.motion.count, 0);
            continue;
        }
        assert!(last_ns.is_none_or(|last| stamp_ns > last));
        last_ns = Some(stamp_ns);
        let mask = state.mask().unwrap();
        assert_eq!((mask.width() as u32, mask.height() as u32), (layout.width, layout.height));
    }
    // A restored state answers as the saved one does.
    let bytes = state.save();
    assert!(State::restore(parameters, &bytes).unwrap().save() == bytes);
});
