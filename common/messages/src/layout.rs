//! The layout of each payload as data: field names, types, order and meaning.
//!
//! iceoryx2 compares payload types by name, size and alignment only, so two builds that reorder fields would misread each other.
//! [`Layout::HASH`] is an attribute of the service and is compared when it is opened. Encoders of other formats, and the table
//! of the wire contract, go by [`Layout::SHAPE`].

/// A type with a description of its layout in memory.
///
/// ```
/// use stillmap_messages::{Layout, Pose, SonarReading};
///
/// assert_ne!(Pose::HASH, SonarReading::HASH);
/// assert_eq!(Pose::SHAPE.size(), size_of::<Pose>());
/// ```
pub trait Layout {
    /// FNV-1a over the declaration: field names, types and order; equal hashes mean equal layouts.
    const HASH: u64;

    /// The same as data.
    ///
    /// ```
    /// use stillmap_messages::{Layout, Pose, Shape};
    ///
    /// let Shape::Struct { name, fields, size } = Pose::SHAPE else { panic!("a struct") };
    /// assert_eq!((name, fields[1].name, fields[1].offset, fields[1].shape, size), ("Pose", "y_m", 8, Shape::F64, 24));
    /// assert_eq!(fields[1].doc, "Along y of the frame, m.");
    /// ```
    const SHAPE: Shape;
}

/// The type of a piece of a payload. Numbers are little-endian on every machine that stillmap runs on.
///
/// ```
/// use stillmap_messages::{Layout, Shape, Text};
///
/// assert_eq!(<[f64; 3]>::SHAPE, Shape::Array(&Shape::F64, 3));
/// assert_eq!(Text::<32>::SHAPE.size(), 32);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// An unsigned number of 8 bits.
    U8,
    /// An unsigned number of 32 bits.
    U32,
    /// An unsigned number of 64 bits.
    U64,
    /// A signed number of 32 bits.
    I32,
    /// A float of 32 bits by IEEE 754.
    F32,
    /// A float of 64 bits by IEEE 754.
    F64,
    /// UTF-8 text of at most this many bytes, padded with zeros.
    Text(usize),
    /// Values of one shape, without gaps, and their number.
    Array(&'static Shape, usize),
    /// Fields, without gaps.
    Struct {
        /// Name of the type.
        name: &'static str,
        /// In their order in memory.
        fields: &'static [Field],
        /// Bytes of all of them.
        size: usize,
    },
}

/// A field of a payload or of a part of one.
///
/// ```
/// use stillmap_messages::{Layout, SonarScan};
///
/// let readings = &SonarScan::SHAPE.fields()[1];
/// assert_eq!((readings.name, readings.offset), ("readings", 24));
/// assert_eq!(readings.count, Some(664), "the field `count` begins there");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// What it means, with its unit.
    pub doc: &'static str,
    /// Bytes from the start of its struct.
    pub offset: usize,
    /// Its type.
    pub shape: Shape,
    /// Of a list, which is a [`Shape::Array`]: the offset of the `u32` field of the same struct that counts its entries. The rest of
    /// the array is zero.
    pub count: Option<usize>,
}

impl Shape {
    /// Bytes in memory.
    ///
    /// ```
    /// use stillmap_messages::{Layout, SonarScan};
    ///
    /// assert_eq!(SonarScan::SHAPE.size(), size_of::<SonarScan>());
    /// ```
    #[must_use]
    pub const fn size(&self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::F64 => 8,
            Self::Text(size) | Self::Struct { size, .. } => *size,
            Self::Array(entry, count) => entry.size() * *count,
        }
    }

    /// The fields of a struct; empty for any other shape.
    ///
    /// ```
    /// use stillmap_messages::{Layout, Pose};
    ///
    /// let names: Vec<&str> = Pose::SHAPE.fields().iter().map(|field| field.name).collect();
    /// assert_eq!(names, ["x_m", "y_m", "yaw_rad"]);
    /// ```
    #[must_use]
    pub const fn fields(&self) -> &'static [Field] {
        match self {
            Self::Struct { fields, .. } => fields,
            _ => &[],
        }
    }
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
    ($($ty:ty: $shape:ident),*) => { $(impl Layout for $ty {
        const HASH: u64 = mix(FNV_OFFSET, stringify!($ty).as_bytes());
        const SHAPE: Shape = Shape::$shape;
    })* };
}
primitive_layout!(u8: U8, u32: U32, u64: U64, i32: I32, f32: F32, f64: F64);

impl<T: Layout, const N: usize> Layout for [T; N] {
    const HASH: u64 = mix(mix(FNV_OFFSET, &T::HASH.to_le_bytes()), &(N as u64).to_le_bytes());
    const SHAPE: Shape = Shape::Array(&T::SHAPE, N);
}

/// Declares plain `repr(C)` structs with their [`Layout`]; a struct with padding does not compile. A list is an array with the
/// field that counts its entries: `pub readings: [SonarReading; MAX_READINGS] => count`.
macro_rules! plain {
    ($($(#[$meta:meta])* pub struct $name:ident {
        $($(#[doc = $doc:literal])+ pub $field:ident: $ty:ty $(=> $count:ident)?,)*
    })*) => { $(
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
        #[repr(C)]
        pub struct $name { $($(#[doc = $doc])+ pub $field: $ty,)* }

        impl $crate::Layout for $name {
            const HASH: u64 = {
                let mut hash = $crate::layout::FNV_OFFSET;
                $(
                    hash = $crate::layout::mix(hash, stringify!($field).as_bytes());
                    hash = $crate::layout::mix(hash, &<$ty as $crate::Layout>::HASH.to_le_bytes());
                )*
                hash
            };

            const SHAPE: $crate::Shape = $crate::Shape::Struct {
                name: stringify!($name),
                fields: &[$($crate::Field {
                    name: stringify!($field),
                    doc: concat!($($doc),+).trim_ascii(),
                    offset: core::mem::offset_of!($name, $field),
                    shape: <$ty as $crate::Layout>::SHAPE,
                    count: $crate::layout::plain!(@count $name $($count)?),
                },)*],
                size: size_of::<$name>(),
            };
        }

        impl postcard_schema::Schema for $name {
            const SCHEMA: &'static postcard_schema::schema::NamedType = &postcard_schema::schema::NamedType {
                name: stringify!($name),
                ty: &postcard_schema::schema::DataModelType::Struct(&[$(&postcard_schema::schema::NamedValue {
                    name: stringify!($field),
                    ty: <$ty as postcard_schema::Schema>::SCHEMA,
                }),*]),
            };
        }

        impl Default for $name {
            fn default() -> Self {
                bytemuck::Zeroable::zeroed()
            }
        }
    )* };
    (@count $name:ident) => { None };
    (@count $name:ident $count:ident) => { Some(core::mem::offset_of!($name, $count)) };
}
pub(crate) use plain;
