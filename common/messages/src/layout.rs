//! A hash of each payload's layout: field names, types and order.
//!
//! iceoryx2 compares payload types by name, size and alignment only, so two builds that reorder fields would talk past each
//! other. The hash is pinned as an attribute of the service and compared when it is opened.

/// A type with a compile-time hash over its field names, types and order.
pub trait Layout {
    /// FNV-1a over the declaration; equal hashes mean equal layouts.
    const HASH: u64;
}

pub(crate) const FNV_OFFSET: u64 = 0xcbf2_9ce4_8422_2325;

pub(crate) const fn mix(mut hash: u64, bytes: &[u8]) -> u64 {
    let mut i = 0;
    while i < bytes.len() {
        hash = (hash ^ bytes[i] as u64).wrapping_mul(0x0000_0100_0000_01b3);
        i += 1;
    }
    hash
}

macro_rules! primitive_layout {
    ($($ty:ty),*) => { $(impl Layout for $ty { const HASH: u64 = mix(FNV_OFFSET, stringify!($ty).as_bytes()); })* };
}
primitive_layout!(u8, u16, u32, u64, i32, i64, f32, f64);

impl<T: Layout, const N: usize> Layout for [T; N] {
    const HASH: u64 = mix(mix(FNV_OFFSET, &T::HASH.to_le_bytes()), &(N as u64).to_le_bytes());
}

/// Declares plain `repr(C)` structs with their [`Layout`]; a struct with padding does not compile.
macro_rules! plain {
    ($($(#[$meta:meta])* pub struct $name:ident { $($(#[$field_meta:meta])* pub $field:ident: $ty:ty,)* })*) => { $(
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
        #[repr(C)]
        pub struct $name { $($(#[$field_meta])* pub $field: $ty,)* }

        impl $crate::Layout for $name {
            const HASH: u64 = {
                let mut hash = $crate::layout::FNV_OFFSET;
                $(
                    hash = $crate::layout::mix(hash, stringify!($field).as_bytes());
                    hash = $crate::layout::mix(hash, &<$ty as $crate::Layout>::HASH.to_le_bytes());
                )*
                hash
            };
        }

        impl Default for $name {
            fn default() -> Self {
                bytemuck::Zeroable::zeroed()
            }
        }
    )* };
}
pub(crate) use plain;
