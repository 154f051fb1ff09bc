//! Reader of YUV4MPEG2 (`.y4m`), 8 bits: mono, or the luminance of the colour spaces with planes of their own for it.
//!
//! It reads from anything and keeps one frame. It never panics on any bytes; an error tells the offset and what was expected.

use std::io::{self, BufRead, Read};

/// What is wrong with a stream.
#[derive(Debug, thiserror::Error)]
pub enum Y4mError {
    /// The stream itself failed.
    #[error("at byte {offset}: {source}")]
    Read {
        /// Bytes read before.
        offset: u64,
        /// What the stream said.
        source: io::Error,
    },
    /// It is not what a Y4M says here.
    #[error("at byte {offset}: found {found:?}, expected {expected}")]
    Syntax {
        /// Where the offending text starts.
        offset: u64,
        /// The text, shortened.
        found: String,
        /// What may stand there.
        expected: &'static str,
    },
    /// It ends inside a frame.
    #[error("at byte {offset}: the stream ends {missing} bytes before the end of frame {frame}")]
    Short {
        /// Length of the stream.
        offset: u64,
        /// Bytes that are missing.
        missing: u64,
        /// Number of the frame, from 0.
        frame: u64,
    },
}

/// Longest header or frame line.
const LINE_MAX: usize = 1024;
/// Largest edge of a picture: what lies above is no picture but a broken number.
const EDGE_MAX: usize = 16384;
/// Time between frames where the stream says none: 15 frames/s.
const PERIOD_NS: u64 = 66_666_667;

/// A stream of frames.
#[derive(Debug)]
pub struct Y4mReader<R> {
    source: R,
    offset: u64,
    frames: u64,
    width: usize,
    height: usize,
    chroma: usize,
    period_ns: u64,
}

impl<R: BufRead> Y4mReader<R> {
    /// Reads the header.
    ///
    /// # Errors
    /// [`Y4mError`]: no Y4M header, a size out of 1 to 16384, or a colour space that is not of 8 bits.
    pub fn new(source: R) -> Result<Self, Y4mError> {
        let mut reader = Self { source, offset: 0, frames: 0, width: 0, height: 0, chroma: 0, period_ns: PERIOD_NS };
        let line = reader.line("YUV4MPEG2 and its parameters")?.unwrap_or_default();
        let mut offset = 0;
        let mut colour = (0, "C420");
        for (k, word) in line.split(' ').enumerate() {
            let refuse = |expected| Y4mError::Syntax { offset, found: shortened(word), expected };
            let rest = word.get(1..).unwrap_or("");
            match (k, word.chars().next()) {
                (0, _) if word == "YUV4MPEG2" => {}
                (0, _) => return Err(refuse("YUV4MPEG2")),
                (_, Some('W')) => reader.width = edge(rest).ok_or_else(|| refuse("a width of 1 to 16384"))?,
                (_, Some('H')) => reader.height = edge(rest).ok_or_else(|| refuse("a height of 1 to 16384"))?,
                (_, Some('C')) => colour = (offset, word),
                (_, Some('F')) => reader.period_ns = period(rest).ok_or_else(|| refuse("a frame rate as 15:1"))?,
                _ => {}
            }
            offset += word.len() as u64 + 1;
        }
        let (width, height) = (reader.width, reader.height);
        if width == 0 || height == 0 {
            return Err(Y4mError::Syntax { offset: 0, found: shortened(&line), expected: "a width (W) and a height (H)" });
        }
        reader.chroma = chroma(colour.1, width, height).ok_or_else(|| Y4mError::Syntax {
            offset: colour.0,
            found: shortened(colour.1),
            expected: "8-bit mono, 411, 420, 422, 440 or 444",
        })?;
        Ok(reader)
    }

    /// Columns of a frame.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows of a frame.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Time from one frame to the next, ns.
    #[must_use]
    pub fn period_ns(&self) -> u64 {
        self.period_ns
    }

    /// Bytes read so far.
    #[must_use]
    pub fn offset(&self) -> u64 {
        self.offset
    }

    /// Reads the luminance of the next frame into `luma`, width × height bytes; false at the end of the stream.
    ///
    /// # Errors
    /// [`Y4mError`]: the stream fails, does not continue with a frame or ends inside one.
    pub fn read(&mut self, luma: &mut Vec<u8>) -> Result<bool, Y4mError> {
        let start = self.offset;
        let Some(line) = self.line("FRAME")? else { return Ok(false) };
        if line != "FRAME" && !line.starts_with("FRAME ") {
            return Err(Y4mError::Syntax { offset: start, found: shortened(&line), expected: "FRAME" });
        }
        self.take(luma, self.width * self.height)?;
        let mut chroma = Vec::new();
        self.take(&mut chroma, self.chroma)?;
        self.frames += 1;
        Ok(true)
    }

    /// Exactly `count` bytes. Memory grows with what comes, not with what the header promises.
    fn take(&mut self, bytes: &mut Vec<u8>, count: usize) -> Result<(), Y4mError> {
        bytes.clear();
        let read = Read::take(&mut self.source, count as u64).read_to_end(bytes);
        self.offset += bytes.len() as u64;
        read.map_err(|source| Y4mError::Read { offset: self.offset, source })?;
        match (count - bytes.len()) as u64 {
            0 => Ok(()),
            missing => Err(Y4mError::Short { offset: self.offset, missing, frame: self.frames }),
        }
    }

    /// A line without its end; `None` at the end of the stream.
    fn line(&mut self, expected: &'static str) -> Result<Option<String>, Y4mError> {
        let start = self.offset;
        let mut line = Vec::new();
        let read = Read::take(&mut self.source, LINE_MAX as u64).read_until(b'\n', &mut line);
        self.offset += line.len() as u64;
        read.map_err(|source| Y4mError::Read { offset: self.offset, source })?;
        if line.is_empty() {
            return Ok(None);
        }
        let text = String::from_utf8_lossy(&line).into_owned();
        text.strip_suffix('\n').map(|t| Some(t.to_owned())).ok_or(Y4mError::Syntax { offset: start, found: shortened(&text), expected })
    }
}

/// Bytes of a frame that follow its luminance; `None` for a colour space that is not of 8 bits or not known.
fn chroma(colour: &str, width: usize, height: usize) -> Option<usize> {
    match colour {
        "Cmono" => Some(0),
        "C420" | "C420jpeg" | "C420mpeg2" | "C420paldv" => Some(2 * width.div_ceil(2) * height.div_ceil(2)),
        "C411" => Some(2 * width.div_ceil(4) * height),
        "C422" => Some(2 * width.div_ceil(2) * height),
        "C440" => Some(2 * width * height.div_ceil(2)),
        "C444" => Some(2 * width * height),
        "C444alpha" => Some(3 * width * height),
        _ => None,
    }
}

/// From frames per second as `15:1`; 0:0 says that the rate is not known.
fn period(text: &str) -> Option<u64> {
    let (frames, seconds) = text.split_once(':')?;
    match (frames.parse::<u32>().ok()?, seconds.parse::<u32>().ok()?) {
        (0, 0) => Some(PERIOD_NS),
        (0, _) | (_, 0) => None,
        (frames, seconds) => Some((u64::from(seconds) * 1_000_000_000 / u64::from(frames)).max(1)),
    }
}

fn edge(text: &str) -> Option<usize> {
    text.parse().ok().filter(|e| (1..=EDGE_MAX).contains(e))
}

fn shortened(text: &str) -> String {
    text.chars().take(40).collect()
}
