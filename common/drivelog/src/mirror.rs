//! Payloads as JSON: the same field names, lists instead of a count beside a fixed array, texts instead of padded bytes.

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize};

use messages::Text;

/// JSON that is well formed and does not fit the payload it stands for.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field} is {found}, expected {expected}")]
pub struct Unfit {
    /// What does not fit.
    pub field: &'static str,
    /// Its size or content.
    pub found: String,
    /// What fits.
    pub expected: String,
}

/// A payload, or a part of one, with its shape in the log; the way there and back changes no bit of a value.
pub(crate) trait Mirrored: Sized {
    /// The shape.
    type Json: Serialize + DeserializeOwned + JsonSchema;

    /// This value in that shape.
    fn to_json(&self) -> Self::Json;

    /// The value that stands in that shape.
    fn from_json(json: Self::Json) -> Result<Self, Unfit>;
}

/// A number in JSON; what JSON cannot say, a number that is none, is `null`.
#[derive(Serialize)]
pub(crate) struct Number<T>(T);

impl<'de, T: Deserialize<'de> + From<f32>> Deserialize<'de> for Number<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(Self(Option::<T>::deserialize(deserializer)?.unwrap_or_else(|| T::from(f32::NAN))))
    }
}

impl<T: JsonSchema> JsonSchema for Number<T> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> std::borrow::Cow<'static, str> {
        T::schema_name()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        T::json_schema(generator)
    }
}

macro_rules! numbers {
    ($($ty:ty),*) => { $(
        impl Mirrored for $ty {
            type Json = Number<$ty>;

            fn to_json(&self) -> Number<$ty> {
                Number(*self)
            }

            fn from_json(json: Number<$ty>) -> Result<Self, Unfit> {
                Ok(json.0)
            }
        }
    )* };
}
numbers!(f32, f64);

macro_rules! whole_numbers {
    ($($ty:ty),*) => { $(
        impl Mirrored for $ty {
            type Json = $ty;

            fn to_json(&self) -> $ty {
                *self
            }

            fn from_json(json: $ty) -> Result<Self, Unfit> {
                Ok(json)
            }
        }
    )* };
}
whole_numbers!(u32, u64);

/// A short list of numbers of fixed length; serde takes arrays of up to 32.
macro_rules! fixed_lists {
    ($([$ty:ty; $length:literal]),*) => { $(
        impl Mirrored for [$ty; $length] {
            type Json = [Number<$ty>; $length];

            fn to_json(&self) -> Self::Json {
                self.map(Number)
            }

            fn from_json(json: Self::Json) -> Result<Self, Unfit> {
                Ok(json.map(|number| number.0))
            }
        }
    )* };
}
fixed_lists!([f32; 2], [f64; 2], [f64; 9]);

impl<const N: usize> Mirrored for Text<N> {
    type Json = String;

    fn to_json(&self) -> String {
        self.as_str().to_owned()
    }

    fn from_json(json: String) -> Result<Self, Unfit> {
        if json.len() <= N {
            Ok(Self::new(&json))
        } else {
            Err(Unfit { field: "a text", found: format!("{} bytes long", json.len()), expected: format!("at most {N}") })
        }
    }
}

/// A hash, in hexadecimal.
impl Mirrored for [u8; 32] {
    type Json = String;

    fn to_json(&self) -> String {
        self.iter().map(|byte| format!("{byte:02x}")).collect()
    }

    fn from_json(json: String) -> Result<Self, Unfit> {
        let unfit = || Unfit { field: "a hash", found: format!("{json:?}"), expected: "64 hexadecimal digits".to_owned() };
        let mut hash = [0; 32];
        if json.len() != 64 || !json.bytes().all(|digit| digit.is_ascii_hexdigit()) {
            return Err(unfit());
        }
        for (byte, digits) in hash.iter_mut().zip(json.as_bytes().chunks(2)) {
            let digits = core::str::from_utf8(digits).map_err(|_| unfit())?;
            *byte = u8::from_str_radix(digits, 16).map_err(|_| unfit())?;
        }
        Ok(hash)
    }
}

/// Puts a list into the array of a payload and says how long it is.
pub(crate) fn fill<T: Mirrored>(field: &'static str, array: &mut [T], list: Vec<T::Json>) -> Result<u32, Unfit> {
    let (room, count) = (array.len(), list.len());
    if count > room {
        return Err(Unfit { field, found: format!("{count} entries long"), expected: format!("at most {room}") });
    }
    for (place, json) in array.iter_mut().zip(list) {
        *place = T::from_json(json)?;
    }
    Ok(count as u32)
}

/// Declares the shape of payloads: each field under its own name, then `; entries[count]` for an array with its count.
/// Fields left out are those that are always 0.
macro_rules! mirror {
    ($($(#[$meta:meta])* $payload:ident { $($field:ident: $ty:ty),* $(; $list:ident[$count:ident]: $item:ty)* })*) => { $(
        $(#[$meta])*
        #[derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
        pub(crate) struct $payload {
            $($field: <$ty as $crate::mirror::Mirrored>::Json,)*
            $($list: Vec<<$item as $crate::mirror::Mirrored>::Json>,)*
        }

        impl $crate::mirror::Mirrored for messages::$payload {
            type Json = $payload;

            fn to_json(&self) -> $payload {
                $payload {
                    $($field: self.$field.to_json(),)*
                    $($list: self.$list.iter().take(self.$count as usize).map($crate::mirror::Mirrored::to_json).collect(),)*
                }
            }

            fn from_json(json: $payload) -> Result<Self, $crate::mirror::Unfit> {
                let mut payload = Self::default();
                $(payload.$field = $crate::mirror::Mirrored::from_json(json.$field)?;)*
                $(payload.$count = $crate::mirror::fill(stringify!($list), &mut payload.$list, json.$list)?;)*
                Ok(payload)
            }
        }
    )* };
}
pub(crate) use mirror;
