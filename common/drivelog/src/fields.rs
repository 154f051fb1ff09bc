//! The fields of an MCAP record: little-endian numbers, and texts and bytes behind their length.

use std::collections::BTreeMap;

/// Bytes that are taken from the front; `None` when they do not suffice.
pub(crate) struct Fields<'a>(pub(crate) &'a [u8]);

impl<'a> Fields<'a> {
    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (front, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*front)
    }

    pub(crate) fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub(crate) fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    /// So many bytes.
    pub(crate) fn bytes(&mut self, length: u64) -> Option<&'a [u8]> {
        let (front, rest) = self.0.split_at_checked(usize::try_from(length).ok()?)?;
        self.0 = rest;
        Some(front)
    }

    /// A text behind its length in 32 bits.
    pub(crate) fn text(&mut self) -> Option<&'a str> {
        let length = self.u32()?;
        core::str::from_utf8(self.bytes(length.into())?).ok()
    }

    /// Pairs of texts behind their length in bytes in 32 bits.
    pub(crate) fn texts(&mut self) -> Option<BTreeMap<String, String>> {
        let length = self.u32()?;
        let mut pairs = Fields(self.bytes(length.into())?);
        let mut texts = BTreeMap::new();
        while !pairs.0.is_empty() {
            texts.insert(pairs.text()?.to_owned(), pairs.text()?.to_owned());
        }
        Some(texts)
    }
}
