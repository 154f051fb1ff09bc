//! From a TOML document to a type, without losing where each value stands.
//!
//! The deserializer of the `toml` crate reports errors as finished prose; this one keeps path, place and kind apart, so that
//! every error can be told in the same words.

use core::fmt::{self, Display};
use core::ops::Range;
use std::borrow::Cow;

use serde::de::value::{MapAccessDeserializer, StrDeserializer};
use serde::de::{DeserializeSeed, Deserializer, Error, Expected, IntoDeserializer, MapAccess, SeqAccess, Unexpected, Visitor};
use serde::forward_to_deserialize_any;
use toml::Spanned;
use toml::de::{DeArray, DeInteger, DeString, DeTable, DeValue};

/// What is wrong, where.
#[derive(Debug)]
pub(crate) struct LocatedError {
    /// From the innermost segment to the outermost.
    path: Vec<Segment>,
    pub(crate) span: Option<Range<usize>>,
    /// Whether the span is one of a table, whose text says nothing.
    pub(crate) in_table: bool,
    pub(crate) kind: Kind,
}

#[derive(Debug)]
pub(crate) enum Kind {
    /// The value, with what was expected in its place.
    Value(String),
    UnknownKey {
        known: &'static [&'static str],
    },
    MissingKey,
}

#[derive(Debug)]
enum Segment {
    Key(String),
    Index(usize),
}

impl LocatedError {
    fn new(kind: Kind) -> Self {
        Self { path: Vec::new(), span: None, in_table: false, kind }
    }

    fn expected(expected: &str) -> Self {
        Self::new(Kind::Value(format!("expected {}", in_words(expected))))
    }

    /// Adds what the enclosing value knows: the innermost place wins.
    fn within(mut self, segment: Segment, value: &Spanned<DeValue<'_>>) -> Self {
        self.path.push(segment);
        self.at(value)
    }

    fn at(mut self, value: &Spanned<DeValue<'_>>) -> Self {
        if self.span.is_none() {
            self.span = Some(value.span());
            self.in_table = value.get_ref().is_table();
        }
        self
    }

    /// `process[0].name`.
    pub(crate) fn key(&self) -> String {
        let mut key = String::new();
        for segment in self.path.iter().rev() {
            match segment {
                Segment::Key(name) => {
                    if !key.is_empty() {
                        key.push('.');
                    }
                    key.push_str(&crate::error::shortened(name));
                }
                Segment::Index(index) => key.push_str(&format!("[{index}]")),
            }
        }
        key
    }
}

/// serde's words for its own types, for people.
fn in_words(expected: &str) -> Cow<'_, str> {
    if let Some(length) = expected.strip_prefix("an array of length ") {
        return format!("a list of {length}").into();
    }
    let words = match expected {
        "f64" | "f32" => "a finite number",
        "i8" | "i16" | "i32" | "i64" | "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number in range",
        "a boolean" => "true or false",
        "a sequence" => "a list",
        "path string" => "a path",
        other => other,
    };
    words.into()
}

impl Display for LocatedError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.kind {
            Kind::Value(expected) => f.write_str(expected),
            Kind::UnknownKey { .. } => f.write_str("unknown key"),
            Kind::MissingKey => f.write_str("missing key"),
        }
    }
}

impl core::error::Error for LocatedError {}

impl Error for LocatedError {
    /// What a `TryFrom` says becomes the problem as it is.
    fn custom<T: Display>(message: T) -> Self {
        Self::new(Kind::Value(message.to_string()))
    }

    fn invalid_type(_: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self::expected(&expected.to_string())
    }

    fn invalid_value(_: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self::expected(&expected.to_string())
    }

    fn invalid_length(_: usize, expected: &dyn Expected) -> Self {
        Self::expected(&expected.to_string())
    }

    fn unknown_variant(_: &str, variants: &'static [&'static str]) -> Self {
        Self::expected(&alternatives(variants))
    }

    fn unknown_field(field: &str, known: &'static [&'static str]) -> Self {
        Self { path: vec![Segment::Key(field.to_owned())], ..Self::new(Kind::UnknownKey { known }) }
    }

    fn missing_field(field: &'static str) -> Self {
        Self { path: vec![Segment::Key(field.to_owned())], ..Self::new(Kind::MissingKey) }
    }
}

/// `"live" or "lockstep"`.
fn alternatives(variants: &[&str]) -> String {
    let quoted: Vec<String> = variants.iter().map(|variant| format!("\"{variant}\"")).collect();
    match quoted.split_last() {
        Some((last, [])) => last.clone(),
        Some((last, others)) => format!("{} or {last}", others.join(", ")),
        None => "nothing".to_owned(),
    }
}

/// A value of a document.
pub(crate) struct Located<'t>(pub(crate) &'t Spanned<DeValue<'t>>);

impl<'de> Deserializer<'de> for Located<'_> {
    type Error = LocatedError;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, LocatedError> {
        let visited = match self.0.get_ref() {
            DeValue::String(text) => visitor.visit_str(text),
            DeValue::Integer(number) => match integer(number) {
                Some(number) => visitor.visit_i64(number),
                None => Err(LocatedError::invalid_value(Unexpected::Other("a number too large"), &visitor)),
            },
            // No setting means infinity or NaN.
            DeValue::Float(number) => match number.as_str().parse::<f64>() {
                Ok(number) if number.is_finite() => visitor.visit_f64(number),
                _ => Err(LocatedError::invalid_value(Unexpected::Other("no finite number"), &visitor)),
            },
            DeValue::Boolean(truth) => visitor.visit_bool(*truth),
            DeValue::Datetime(_) => Err(LocatedError::invalid_type(Unexpected::Other("a date"), &visitor)),
            DeValue::Array(list) => whole_list(list, visitor),
            DeValue::Table(table) => visitor.visit_map(Keys::of(table)),
        };
        visited.map_err(|error| error.at(self.0))
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, LocatedError> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(self, _: &'static str, visitor: V) -> Result<V::Value, LocatedError> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, LocatedError> {
        let visited = match self.0.get_ref() {
            DeValue::String(text) => {
                let name: StrDeserializer<'_, LocatedError> = text.as_ref().into_deserializer();
                visitor.visit_enum(name)
            }
            DeValue::Table(table) => visitor.visit_enum(MapAccessDeserializer::new(Keys::of(table))),
            _ => Err(LocatedError::expected(&alternatives(variants))),
        };
        visited.map_err(|error| error.at(self.0))
    }

    forward_to_deserialize_any! {
        bool u8 u16 u32 u64 i8 i16 i32 i64 f32 f64 char str string seq bytes byte_buf map unit
        ignored_any unit_struct tuple_struct tuple identifier struct
    }
}

/// Visits a list, of which nothing may be left over.
fn whole_list<'de, V: Visitor<'de>>(list: &DeArray<'_>, visitor: V) -> Result<V::Value, LocatedError> {
    let mut entries = Entries { list, next: 0 };
    let value = visitor.visit_seq(&mut entries)?;
    match entries.next {
        taken if taken == list.len() => Ok(value),
        taken => Err(LocatedError::custom(format_args!("expected a list of {taken}"))),
    }
}

fn integer(number: &DeInteger<'_>) -> Option<i64> {
    i64::from_str_radix(number.as_str(), number.radix()).ok()
}

struct Entries<'t> {
    list: &'t DeArray<'t>,
    next: usize,
}

impl<'de> SeqAccess<'de> for &mut Entries<'_> {
    type Error = LocatedError;

    fn next_element_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, LocatedError> {
        let index = self.next;
        let Some(value) = self.list.get(index) else { return Ok(None) };
        self.next += 1;
        seed.deserialize(Located(value)).map(Some).map_err(|error| error.within(Segment::Index(index), value))
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.list.len() - self.next)
    }
}

type Entry<'t> = (&'t Spanned<DeString<'t>>, &'t Spanned<DeValue<'t>>);

struct Keys<'t> {
    entries: std::vec::IntoIter<Entry<'t>>,
    value: Option<Entry<'t>>,
}

impl<'t> Keys<'t> {
    /// The keys in the order of the file, so that the first problem of the file is the one that is told.
    fn of(table: &'t DeTable<'t>) -> Self {
        let mut entries: Vec<Entry<'t>> = table.iter().collect();
        entries.sort_by_key(|(key, _)| key.span().start);
        Self { entries: entries.into_iter(), value: None }
    }
}

impl<'de> MapAccess<'de> for Keys<'_> {
    type Error = LocatedError;

    fn next_key_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, LocatedError> {
        self.value = self.entries.next();
        let Some((key, _)) = self.value else { return Ok(None) };
        let name: StrDeserializer<'_, LocatedError> = key.get_ref().as_ref().into_deserializer();
        seed.deserialize(name).map(Some).map_err(|error| LocatedError { span: Some(key.span()), ..error })
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, LocatedError> {
        let (key, value) = self.value.take().ok_or_else(|| LocatedError::custom("a value asked for before its key"))?;
        seed.deserialize(Located(value)).map_err(|error| error.within(Segment::Key(key.get_ref().to_string()), value))
    }
}
