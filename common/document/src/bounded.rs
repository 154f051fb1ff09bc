//! Numbers with limits.

use core::fmt::{self, Display};
use core::marker::PhantomData;

use serde::de::{Deserializer, Error, Unexpected, Visitor};

/// A number outside its limits.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{found}: expected {expected}")]
pub struct OutOfRange {
    /// The number refused.
    pub found: String,
    /// The limits, with the unit.
    pub expected: String,
}

/// The primitive type of a [`Bounded`] number.
pub trait Number: Copy + PartialOrd + Display {
    /// What error messages put before the limits: empty, or `a whole number, `.
    const WORD: &'static str;
    /// From a floating-point number; `None` where the type is whole.
    fn from_f64(number: f64) -> Option<Self>;
    /// From a whole number; `None` outside the type's range.
    fn from_i64(number: i64) -> Option<Self>;
}

impl Number for f64 {
    const WORD: &'static str = "";

    fn from_f64(number: f64) -> Option<Self> {
        Some(number)
    }

    fn from_i64(number: i64) -> Option<Self> {
        Some(number as f64)
    }
}

impl Number for u32 {
    const WORD: &'static str = "a whole number, ";

    fn from_f64(_: f64) -> Option<Self> {
        None
    }

    fn from_i64(number: i64) -> Option<Self> {
        Self::try_from(number).ok()
    }
}

impl Number for i32 {
    const WORD: &'static str = "a whole number, ";

    fn from_f64(_: f64) -> Option<Self> {
        None
    }

    fn from_i64(number: i64) -> Option<Self> {
        Self::try_from(number).ok()
    }
}

/// A newtype made by [`bounded!`](crate::bounded!) or [`one_of!`](crate::one_of!).
pub trait Bounded: Sized {
    /// The primitive type.
    type Number: Number;
    /// The value; `None` outside the limits.
    fn accept(number: Self::Number) -> Option<Self>;
    /// The limits with the unit, as error messages state them.
    fn expected() -> String;
}

struct BoundedVisitor<T>(PhantomData<T>);

impl<T: Bounded> Visitor<'_> for BoundedVisitor<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&T::expected())
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<T, E> {
        T::Number::from_f64(number).and_then(T::accept).ok_or_else(|| E::invalid_value(Unexpected::Float(number), &self))
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<T, E> {
        T::Number::from_i64(number).and_then(T::accept).ok_or_else(|| E::invalid_value(Unexpected::Signed(number), &self))
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<T, E> {
        i64::try_from(number)
            .ok()
            .and_then(T::Number::from_i64)
            .and_then(T::accept)
            .ok_or_else(|| E::invalid_value(Unexpected::Unsigned(number), &self))
    }
}

/// Reads a number from a document; the macros' [`Deserialize`](serde::Deserialize) calls it.
///
/// # Errors
/// When the value is no number or outside the limits.
pub fn deserialize_bounded<'de, T: Bounded, D: Deserializer<'de>>(deserializer: D) -> Result<T, D::Error> {
    deserializer.deserialize_any(BoundedVisitor(PhantomData))
}

/// Declares newtypes of numbers with limits, a unit and a default: `Name: f64 in 0.005..=1.0, "m", default 0.05;`.
///
/// A value outside the limits cannot be constructed, and neither can NaN. Error messages state the limits. The calling crate depends on `serde`.
#[macro_export]
macro_rules! bounded {
    ($($(#[$doc:meta])* $name:ident: $number:ident in $min:literal..=$max:literal, $unit:literal $(, default $default:literal)?;)+) => {$(
        $(#[$doc])*
        #[doc = concat!(" From ", stringify!($min), " to ", stringify!($max), " ", $unit, $(", by default ", stringify!($default),)? ".")]
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
        pub struct $name($number);

        impl $name {
            /// The smallest value.
            pub const MIN: Self = Self($min);
            /// The greatest value.
            pub const MAX: Self = Self($max);

            /// For constants: the assertion fails the build.
            #[allow(dead_code, reason = "not every number has a default in the code")]
            pub(crate) const fn literal(number: $number) -> Self {
                assert!(number >= Self::MIN.0 && number <= Self::MAX.0, "outside the limits");
                Self(number)
            }

            /// The number.
            #[must_use]
            pub const fn get(self) -> $number {
                self.0
            }
        }

        $(impl Default for $name {
            fn default() -> Self {
                const { Self::literal($default) }
            }
        })?

        impl $crate::Bounded for $name {
            type Number = $number;

            fn accept(number: $number) -> Option<Self> {
                (Self::MIN.0..=Self::MAX.0).contains(&number).then_some(Self(number))
            }

            fn expected() -> String {
                let range = format!("{}{} to {} {}", <$number as $crate::Number>::WORD, Self::MIN.0, Self::MAX.0, $unit);
                range.trim_end().to_owned()
            }
        }

        $crate::bounded_impls!($name, $number);
    )+};
}

/// Declares newtypes of numbers that have a few possible values: `Name: u32 of [9600, 19200];`. The calling crate depends on `serde`.
#[macro_export]
macro_rules! one_of {
    ($($(#[$doc:meta])* $name:ident: $number:ident of [$($possible:literal),+] $(, default $default:literal)?;)+) => {$(
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name($number);

        impl $name {
            /// Every possible value.
            pub const ALL: &'static [Self] = &[$(Self($possible)),+];

            /// The number.
            #[must_use]
            pub const fn get(self) -> $number {
                self.0
            }
        }

        $(impl Default for $name {
            fn default() -> Self {
                Self($default)
            }
        })?

        impl $crate::Bounded for $name {
            type Number = $number;

            fn accept(number: $number) -> Option<Self> {
                [$($possible),+].contains(&number).then_some(Self(number))
            }

            fn expected() -> String {
                let possible = [$($possible.to_string()),+];
                format!("one of {}", possible.join(", "))
            }
        }

        $crate::bounded_impls!($name, $number);
    )+};
}

/// What [`bounded!`] and [`one_of!`] share.
#[doc(hidden)]
#[macro_export]
macro_rules! bounded_impls {
    ($name:ident, $number:ident) => {
        impl TryFrom<$number> for $name {
            type Error = $crate::OutOfRange;

            fn try_from(number: $number) -> Result<Self, $crate::OutOfRange> {
                <Self as $crate::Bounded>::accept(number)
                    .ok_or_else(|| $crate::OutOfRange { found: number.to_string(), expected: <Self as $crate::Bounded>::expected() })
            }
        }

        impl serde::Serialize for $name {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serde::Serialize::serialize(&self.0, serializer)
            }
        }

        impl<'de> serde::Deserialize<'de> for $name {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                $crate::deserialize_bounded(deserializer)
            }
        }
    };
}
