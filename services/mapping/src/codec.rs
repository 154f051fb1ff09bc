//! Numbers to bytes and back, little-endian; reading checks everything.

use geometry::Tile;

/// State that cannot be taken up.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("at byte {offset}: {found}, expected {expected}")]
pub struct StateError {
    /// Where in the state.
    pub offset: usize,
    /// What is there.
    pub found: String,
    /// What should be.
    pub expected: &'static str,
}

/// Takes numbers off the front of some bytes.
pub(crate) struct Decoder<'a> {
    bytes: &'a [u8],
    offset: usize,
}

impl<'a> Decoder<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, offset: 0 }
    }

    /// The next `N` bytes.
    pub(crate) fn bytes<const N: usize>(&mut self) -> Result<&'a [u8; N], StateError> {
        let rest = self.bytes.get(self.offset..).unwrap_or_default();
        let Some(taken) = rest.first_chunk() else {
            return Err(self.error(format!("the end, {} bytes before", rest.len()), "more bytes"));
        };
        self.offset += N;
        Ok(taken)
    }

    pub(crate) fn u32(&mut self) -> Result<u32, StateError> {
        self.bytes().map(|b| u32::from_le_bytes(*b))
    }

    pub(crate) fn u64(&mut self) -> Result<u64, StateError> {
        self.bytes().map(|b| u64::from_le_bytes(*b))
    }

    pub(crate) fn f32(&mut self) -> Result<f32, StateError> {
        self.bytes().map(|b| f32::from_le_bytes(*b))
    }

    pub(crate) fn f64(&mut self) -> Result<f64, StateError> {
        self.bytes().map(|b| f64::from_le_bytes(*b))
    }

    /// A count of things of at least `size` bytes each that follow.
    pub(crate) fn count(&mut self, size: usize) -> Result<usize, StateError> {
        let most = self.bytes.len().saturating_sub(self.offset) / size;
        let count = self.u64()?;
        match usize::try_from(count) {
            Ok(count) if count <= most => Ok(count),
            _ => Err(self.error(format!("a count of {count}"), "no more than there are bytes for")),
        }
    }

    /// The cells of a tile, each within ± `limit`.
    pub(crate) fn tile(&mut self, limit: f32) -> Result<Tile<f32>, StateError> {
        let mut cells = [0.0; geometry::TILE_CELLS];
        for cell in &mut cells {
            *cell = self.f32()?;
            if cell.is_nan() || cell.abs() > limit {
                return Err(self.error(format!("a cell of {cell}"), "a cell within the limit of log-odds"));
            }
        }
        Ok(cells)
    }

    /// Refuses bytes that are left over.
    pub(crate) fn end(&self) -> Result<(), StateError> {
        let rest = self.bytes.len().saturating_sub(self.offset);
        if rest == 0 { Ok(()) } else { Err(self.error(format!("{rest} more bytes"), "the end")) }
    }

    /// Refuses what was just taken unless `holds`.
    pub(crate) fn require(&self, holds: bool, found: impl std::fmt::Display, expected: &'static str) -> Result<(), StateError> {
        if holds { Ok(()) } else { Err(self.error(found.to_string(), expected)) }
    }

    pub(crate) fn error(&self, found: String, expected: &'static str) -> StateError {
        StateError { offset: self.offset, found, expected }
    }
}

/// Appends numbers to bytes.
pub(crate) trait Encode {
    fn put(&mut self, bytes: &[u8]);

    fn put_u32(&mut self, number: u32) {
        self.put(&number.to_le_bytes());
    }

    fn put_u64(&mut self, number: u64) {
        self.put(&number.to_le_bytes());
    }

    fn put_f64(&mut self, number: f64) {
        self.put(&number.to_le_bytes());
    }
}

impl Encode for Vec<u8> {
    fn put(&mut self, bytes: &[u8]) {
        self.extend_from_slice(bytes);
    }
}
