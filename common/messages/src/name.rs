//! Short texts of fixed size.

use crate::layout::{FNV_OFFSET, Layout, Shape, mix};

/// UTF-8 text of at most `N` bytes, padded with zeros.
///
/// ```
/// use stillmap_messages::Text;
///
/// assert_eq!(Text::<8>::new("mapping").as_str(), "mapping");
/// assert_eq!(Text::<3>::new("mapping").as_str(), "map");
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
#[repr(transparent)]
pub struct Text<const N: usize>([u8; N]);

// SAFETY: a transparent wrapper of a byte array, for which every bit pattern, all zeros included, is valid.
#[expect(unsafe_code, reason = "bytemuck's derive does not take const generics on transparent wrappers")]
unsafe impl<const N: usize> bytemuck::Zeroable for Text<N> {}
// SAFETY: a transparent wrapper of a byte array: no padding, no invalid bit pattern, no pointer.
#[expect(unsafe_code, reason = "bytemuck's derive does not take const generics on transparent wrappers")]
unsafe impl<const N: usize> bytemuck::Pod for Text<N> {}

impl<const N: usize> Layout for Text<N> {
    const HASH: u64 = mix(mix(FNV_OFFSET, b"Text"), &(N as u64).to_le_bytes());
    const SHAPE: Shape = Shape::Text(N);
}

impl<const N: usize> postcard_schema::Schema for Text<N> {
    const SCHEMA: &'static postcard_schema::schema::NamedType = <[u8; N]>::SCHEMA;
}

impl<const N: usize> Text<N> {
    /// Cuts at the last character that fits.
    #[must_use]
    pub fn new(text: &str) -> Self {
        let mut end = text.len().min(N);
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        let mut bytes = [0; N];
        bytes[..end].copy_from_slice(&text.as_bytes()[..end]);
        Self(bytes)
    }

    /// The text up to the first zero or invalid byte.
    #[must_use]
    pub fn as_str(&self) -> &str {
        padded_text(&self.0)
    }
}

/// The text in bytes that are padded with zeros, up to the first zero or invalid byte: what a [`Text`] of any size holds.
///
/// ```
/// assert_eq!(stillmap_messages::padded_text(b"std\0\0\0\0\0"), "std");
/// ```
#[must_use]
pub fn padded_text(bytes: &[u8]) -> &str {
    let bytes = bytes.split(|byte| *byte == 0).next().unwrap_or_default();
    match core::str::from_utf8(bytes) {
        Ok(text) => text,
        Err(error) => core::str::from_utf8(&bytes[..error.valid_up_to()]).unwrap_or_default(),
    }
}

impl<const N: usize> Default for Text<N> {
    fn default() -> Self {
        Self([0; N])
    }
}

impl<const N: usize> core::fmt::Debug for Text<N> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        self.as_str().fmt(f)
    }
}

impl<const N: usize> core::fmt::Display for Text<N> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.as_str())
    }
}
