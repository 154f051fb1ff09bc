//! One picture of a camera.

use std::os::fd::AsFd;
use std::path::Path;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::config::{Camera, CameraConfig, Given};
use crate::trouble::Trouble;

/// Pictures let pass first: an automatic exposure settles in about ten.
const SETTLING: u32 = 15;

/// How long to wait for it.
const PATIENCE: Duration = Duration::from_secs(10);

/// A picture and the camera that took it.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    /// What the camera gives.
    pub given: Given,
    /// Luminance, row by row without gaps.
    pub luminance: Vec<u8>,
}

/// Why there is no picture. Its words follow the name of the device.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SnapshotError {
    /// The camera gives none.
    #[error("{0}")]
    Trouble(#[from] Trouble),
    /// None that is whole came in time.
    #[error("no whole picture in {} s: {came} came, {damaged} of them damaged", PATIENCE.as_secs())]
    Late {
        /// Pictures that came.
        came: u32,
        /// Those that were damaged.
        damaged: u32,
    },
}

/// Takes a picture when the camera's automatics have settled.
///
/// # Errors
/// When the camera gives none.
pub fn snapshot(path: &Path, config: &CameraConfig) -> Result<Snapshot, SnapshotError> {
    let Camera { mut stream, given } = Camera::open(path, config)?;
    let mut luminance = vec![0; given.shape.pixels()];
    let started = Instant::now();
    let (mut came, mut damaged) = (0, 0);
    while started.elapsed() < PATIENCE {
        wait(&stream);
        let Some(frame) = stream.take()? else { continue };
        came += 1;
        if came <= SETTLING {
            continue;
        }
        if !frame.about().damaged && given.shape.luminance(frame.bytes(), &mut luminance).is_ok() {
            return Ok(Snapshot { given, luminance });
        }
        damaged += 1;
    }
    Err(SnapshotError::Late { came, damaged })
}

fn wait(stream: &impl AsFd) {
    let patience = Timespec { tv_sec: 0, tv_nsec: 100_000_000 };
    // An interrupted wait is a short one.
    let _ = poll(&mut [PollFd::new(stream, PollFlags::IN)], Some(&patience));
}
