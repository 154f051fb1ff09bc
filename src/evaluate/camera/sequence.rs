//! Frames with their truth, read picture by picture.

use crate::exit::BadInput;
use anyhow::Result;
use sbs::plane::Plane;
use sbs::y4m::Y4mReader;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// Smallest and largest size that SBS works on, px.
const SIZES: [(usize, usize); 2] = [(80, 60), (640, 480)];

/// Two files of the same size and length.
pub(super) struct Sequence {
    frames: Source,
    labels: Source,
    read: u64,
}

/// A picture and its truth, of the same size.
pub(super) struct Pair {
    pub(super) frame: Plane<u8>,
    pub(super) truth: Plane<u8>,
}

struct Source {
    path: PathBuf,
    bytes: u64,
    reader: Y4mReader<BufReader<File>>,
}

impl Sequence {
    /// Opens both files.
    pub(super) fn open(frames: &Path, labels: &Path) -> Result<Self> {
        let sequence = Self { frames: Source::open(frames)?, labels: Source::open(labels)?, read: 0 };
        let ((width, height), found) = (sequence.size(), sequence.labels.size());
        let [(least_width, least_height), (most_width, most_height)] = SIZES;
        if !(least_width..=most_width).contains(&width) || !(least_height..=most_height).contains(&height) {
            let expected = format!("{least_width} × {least_height} to {most_width} × {most_height}");
            return Err(BadInput(format!("{}: pictures of {width} × {height}, expected {expected}", frames.display())).into());
        }
        if found != (width, height) {
            let (found, expected) = (format!("{} × {}", found.0, found.1), format!("{width} × {height} as in {}", frames.display()));
            return Err(BadInput(format!("{}: pictures of {found}, expected {expected}", labels.display())).into());
        }
        Ok(sequence)
    }

    /// Width and height of the pictures.
    pub(super) fn size(&self) -> (usize, usize) {
        self.frames.size()
    }

    /// Time from one frame to the next.
    pub(super) fn period_ns(&self) -> u64 {
        self.frames.reader.period_ns()
    }

    /// Size of the file of frames.
    pub(super) fn bytes(&self) -> u64 {
        self.frames.bytes
    }

    /// Number of bytes read of it.
    pub(super) fn offset(&self) -> u64 {
        self.frames.reader.offset()
    }

    /// The next picture with its truth; `None` at the end of both files.
    pub(super) fn next(&mut self) -> Result<Option<Pair>> {
        let (frame, truth) = (self.frames.next()?, self.labels.next()?);
        let (shorter, longer) = match (frame, truth) {
            (Some(frame), Some(truth)) => {
                self.read += 1;
                return Ok(Some(Pair { frame, truth }));
            }
            (None, None) => return Ok(None),
            (None, Some(_)) => (&self.frames.path, &self.labels.path),
            (Some(_), None) => (&self.labels.path, &self.frames.path),
        };
        let (shorter, longer) = (shorter.display(), longer.display());
        Err(BadInput(format!("{shorter}: ends after {} frames, expected as many as in {longer}", self.read)).into())
    }
}

impl Source {
    fn open(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(|error| BadInput(format!("{}: {error}", path.display())))?;
        let bytes = file.metadata().map_or(0, |data| data.len());
        let reader = Y4mReader::new(BufReader::new(file)).map_err(|error| BadInput(format!("{}: {error}", path.display())))?;
        Ok(Self { path: path.to_owned(), bytes, reader })
    }

    fn size(&self) -> (usize, usize) {
        (self.reader.width(), self.reader.height())
    }

    fn next(&mut self) -> Result<Option<Plane<u8>>> {
        let mut luma = Vec::new();
        let more = self.reader.read(&mut luma).map_err(|error| BadInput(format!("{}: {error}", self.path.display())))?;
        let (width, height) = self.size();
        Ok(more.then(|| Plane::from_values(width, height, luma)).flatten())
    }
}
