//! Enums that travel as a number.

/// The values of an enum that travels as a number, as data.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Numbers {
    /// Name of the enum.
    pub(crate) name: &'static str,
    /// Each number with the name and the meaning of its value.
    pub(crate) values: &'static [(u32, &'static str, &'static str)],
}

/// Declares an enum that travels as a number, with the way back from the number.
macro_rules! numbered {
    ($(#[$meta:meta])* pub enum $name:ident { $($(#[doc = $doc:literal])+ $variant:ident = $number:literal,)* }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[repr(u32)]
        pub enum $name { $($(#[doc = $doc])+ $variant = $number,)* }

        impl $name {
            /// The value that a number stands for, if any.
            #[must_use]
            pub fn from_number(number: u32) -> Option<Self> {
                match number {
                    $($number => Some(Self::$variant),)*
                    _ => None,
                }
            }

            pub(crate) const NUMBERS: $crate::numbered::Numbers = $crate::numbered::Numbers {
                name: stringify!($name),
                values: &[$(($number, stringify!($variant), concat!($($doc),+).trim_ascii()),)*],
            };
        }
    };
}
pub(crate) use numbered;
