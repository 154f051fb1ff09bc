//! Payloads as JSON: the same field names, lists instead of a count beside a fixed array, texts instead of padded bytes.
//!
//! Made from the layout that each payload describes itself by. The way there and back changes no bit of a number. Fields that are
//! reserved are left out. A float that JSON has no number for is `null`, and is read as one that is not a number. Bytes are one text
//! of hexadecimal digits. Two numbers that are an entry of a list are an object of `x` and `y`: tools that draw logs know no list in a
//! list. Logs of earlier versions have such lists, and they are read.

use core::fmt;

use messages::{Field, Layout, Shape};
use serde::de::{self, DeserializeSeed, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde::ser::{SerializeMap, SerializeSeq, Serializer};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

/// Fields of this name are always 0.
const RESERVED: &str = "reserved";
/// The names of two numbers that are an entry of a list.
const POINT: [&str; 2] = ["x", "y"];
/// The name of the sequence number among the fields of a message.
const SEQ: &str = "seq";

/// The JSON of a message: its sequence number among the fields of its payload.
pub(crate) fn encode<T: Layout + bytemuck::Pod>(seq: u64, payload: &T) -> Vec<u8> {
    // Fails for maps whose keys are no text; no payload has a map.
    serde_json::to_vec(&Message { seq, payload: Encoded::of(payload) }).unwrap_or_default()
}

/// The sequence number and the payload of such a JSON.
pub(crate) fn decode<T: Layout + bytemuck::Pod>(data: &[u8]) -> Result<(u64, T), serde_json::Error> {
    let (mut payload, mut seq) = (T::zeroed(), None);
    let mut json = serde_json::Deserializer::from_slice(data);
    let root = Struct { fields: T::SHAPE.fields(), bytes: bytemuck::bytes_of_mut(&mut payload), seq: Some(&mut seq) };
    json.deserialize_map(root)?;
    json.end()?;
    let seq = seq.ok_or_else(|| de::Error::missing_field(SEQ))?;
    Ok((seq, payload))
}

/// Values as a list in JSON.
pub(crate) fn encode_list<T: Layout + bytemuck::Pod>(values: &[T]) -> String {
    serde_json::to_string(&values.iter().map(Encoded::of).collect::<Vec<_>>()).unwrap_or_default()
}

/// The values of such a list.
pub(crate) fn decode_list<T: Layout + bytemuck::Pod>(text: &str) -> Result<Vec<T>, serde_json::Error> {
    let mut json = serde_json::Deserializer::from_str(text);
    let values = json.deserialize_seq(Values(Vec::new()))?;
    json.end()?;
    Ok(values)
}

/// The JSON schema of a message; it names no other schema, since Foxglove does not follow references.
pub(crate) fn schema<T: Layout>(title: &str, doc: &str) -> Value {
    let mut schema = schema_of(&T::SHAPE, doc);
    schema["$schema"] = json!("http://json-schema.org/draft-07/schema#");
    schema["title"] = json!(title);
    schema["properties"][SEQ] = json!({ "type": "integer", "minimum": 0, "description": "Place in the source stream, from 1." });
    if let Some(required) = schema["required"].as_array_mut() {
        required.insert(0, json!(SEQ));
    }
    schema
}

fn schema_of(shape: &Shape, doc: &str) -> Value {
    let mut schema = match shape {
        Shape::U8 | Shape::U32 | Shape::U64 => json!({ "type": "integer", "minimum": 0 }),
        Shape::I32 => json!({ "type": "integer" }),
        Shape::F32 | Shape::F64 => json!({ "type": "number" }),
        Shape::Text(most) => json!({ "type": "string", "maxLength": most }),
        Shape::Array(Shape::U8, count) => json!({ "type": "string", "minLength": 2 * count, "maxLength": 2 * count }),
        Shape::Array(entry, count) => {
            let items = match entry {
                Shape::Array(number, 2) => {
                    let number = schema_of(number, "");
                    json!({ "type": "object", "properties": { "x": number, "y": number }, "required": POINT })
                }
                _ => schema_of(entry, ""),
            };
            json!({ "type": "array", "items": items, "minItems": count, "maxItems": count })
        }
        Shape::Struct { fields, .. } => {
            let mut properties = Map::new();
            for field in in_order(fields) {
                let mut schema = schema_of(&field.shape, field.doc);
                if let Some(list) = schema.as_object_mut().filter(|_| field.count.is_some()) {
                    list.remove("minItems");
                }
                properties.insert(field.name.to_owned(), schema);
            }
            let required: Vec<&str> = in_order(fields).map(|field| field.name).collect();
            json!({ "type": "object", "properties": properties, "required": required })
        }
    };
    if !doc.is_empty() {
        schema["description"] = json!(doc);
    }
    schema
}

/// The fields that are shown: first the single values, then the lists.
fn in_order(fields: &'static [Field]) -> impl Iterator<Item = &'static Field> {
    let is_count = |field: &Field| fields.iter().any(|list| list.count == Some(field.offset));
    let singles = fields.iter().filter(move |field| field.count.is_none() && field.name != RESERVED && !is_count(field));
    singles.chain(fields.iter().filter(|field| field.count.is_some()))
}

fn array<const N: usize>(bytes: &[u8]) -> [u8; N] {
    bytes.first_chunk().copied().unwrap_or([0; N])
}

/// As many entries of a list as its count says, and the array holds.
fn counted(count_at: usize, room: usize, bytes: &[u8]) -> usize {
    let count = u32::from_ne_bytes(array(bytes.get(count_at..).unwrap_or_default()));
    (count as usize).min(room)
}

/// A message on its way into JSON.
struct Message<'a> {
    seq: u64,
    payload: Encoded<'a>,
}

impl Serialize for Message<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry(SEQ, &self.seq)?;
        self.payload.fields(&mut map)?;
        map.end()
    }
}

/// Bytes of this shape on their way into JSON.
struct Encoded<'a> {
    shape: &'static Shape,
    bytes: &'a [u8],
    /// Entries of an array that are shown.
    shown: usize,
}

impl<'a> Encoded<'a> {
    fn of<T: Layout + bytemuck::Pod>(value: &'a T) -> Self {
        Self { shape: &T::SHAPE, bytes: bytemuck::bytes_of(value), shown: usize::MAX }
    }

    fn fields<M: SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
        for field in in_order(self.shape.fields()) {
            let bytes = self.bytes.get(field.offset..).unwrap_or_default();
            let shown = field.count.map_or(usize::MAX, |at| counted(at, usize::MAX, self.bytes));
            map.serialize_entry(field.name, &Encoded { shape: &field.shape, bytes, shown })?;
        }
        Ok(())
    }
}

impl Serialize for Encoded<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.shape {
            Shape::U8 => serializer.serialize_u8(u8::from_ne_bytes(array(self.bytes))),
            Shape::U32 => serializer.serialize_u32(u32::from_ne_bytes(array(self.bytes))),
            Shape::U64 => serializer.serialize_u64(u64::from_ne_bytes(array(self.bytes))),
            Shape::I32 => serializer.serialize_i32(i32::from_ne_bytes(array(self.bytes))),
            Shape::F32 => serializer.serialize_f32(f32::from_ne_bytes(array(self.bytes))),
            Shape::F64 => serializer.serialize_f64(f64::from_ne_bytes(array(self.bytes))),
            Shape::Text(most) => serializer.serialize_str(messages::padded_text(self.bytes.get(..*most).unwrap_or_default())),
            Shape::Array(Shape::U8, count) => {
                let digits = self.bytes.iter().take(*count).map(|byte| format!("{byte:02x}"));
                serializer.serialize_str(&digits.collect::<String>())
            }
            Shape::Array(entry, count) => {
                let mut list = serializer.serialize_seq(None)?;
                for bytes in self.bytes.chunks_exact(entry.size()).take(*count).take(self.shown) {
                    match entry {
                        Shape::Array(number, 2) => list.serialize_element(&Point { number, bytes })?,
                        _ => list.serialize_element(&Encoded { shape: entry, bytes, shown: usize::MAX })?,
                    }
                }
                list.end()
            }
            Shape::Struct { .. } => {
                let mut map = serializer.serialize_map(None)?;
                self.fields(&mut map)?;
                map.end()
            }
        }
    }
}

/// Two numbers on their way into JSON.
struct Point<'a> {
    number: &'static Shape,
    bytes: &'a [u8],
}

impl Serialize for Point<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(POINT.len()))?;
        for (name, bytes) in POINT.iter().zip(self.bytes.chunks_exact(self.number.size())) {
            map.serialize_entry(name, &Encoded { shape: self.number, bytes, shown: usize::MAX })?;
        }
        map.end()
    }
}

/// Bytes of two numbers, all zero, that are read from JSON.
struct DecodedPoint<'a> {
    number: &'static Shape,
    bytes: &'a mut [u8],
}

impl<'de> DeserializeSeed<'de> for DecodedPoint<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, json: D) -> Result<(), D::Error> {
        json.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for DecodedPoint<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object of x and y")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let mut missing = POINT.to_vec();
        while let Some(name) = map.next_key::<String>()? {
            let Some(at) = missing.iter().position(|missing| *missing == name) else {
                map.next_value::<IgnoredAny>()?;
                continue;
            };
            let start = if missing.remove(at) == POINT[0] { 0 } else { self.number.size() };
            map.next_value_seed(Decoded { shape: self.number, bytes: &mut self.bytes[start..start + self.number.size()] })?;
        }
        missing.first().map_or(Ok(()), |name| Err(de::Error::missing_field(name)))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<(), A::Error> {
        let found = List { entry: self.number, room: POINT.len(), bytes: self.bytes }.visit_seq(list)?;
        if found == POINT.len() { Ok(()) } else { Err(de::Error::invalid_length(found, &"2 entries")) }
    }
}

/// Bytes of this shape, all zero, that are read from JSON.
struct Decoded<'a> {
    shape: &'static Shape,
    bytes: &'a mut [u8],
}

impl Decoded<'_> {
    fn set(&mut self, value: &[u8]) {
        self.bytes[..value.len()].copy_from_slice(value);
    }
}

impl<'de> DeserializeSeed<'de> for Decoded<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(mut self, json: D) -> Result<(), D::Error> {
        match self.shape {
            Shape::U8 => self.set(&u8::deserialize(json)?.to_ne_bytes()),
            Shape::U32 => self.set(&u32::deserialize(json)?.to_ne_bytes()),
            Shape::U64 => self.set(&u64::deserialize(json)?.to_ne_bytes()),
            Shape::I32 => self.set(&i32::deserialize(json)?.to_ne_bytes()),
            Shape::F32 => self.set(&Option::<f32>::deserialize(json)?.unwrap_or(f32::NAN).to_ne_bytes()),
            Shape::F64 => self.set(&Option::<f64>::deserialize(json)?.unwrap_or(f64::NAN).to_ne_bytes()),
            Shape::Text(most) => {
                let text = String::deserialize(json)?;
                if text.len() > *most {
                    return Err(de::Error::invalid_length(text.len(), &format!("a text of at most {most} bytes").as_str()));
                }
                self.set(text.as_bytes());
            }
            Shape::Array(Shape::U8, count) => {
                let text = String::deserialize(json)?;
                let expected = || de::Error::invalid_value(de::Unexpected::Str(&text), &"hexadecimal digits of the right number");
                if text.len() != 2 * count || !text.is_ascii() {
                    return Err(expected());
                }
                for (byte, digits) in self.bytes.iter_mut().zip(text.as_bytes().chunks_exact(2)) {
                    let digit = |at: usize| char::from(digits[at]).to_digit(16).ok_or_else(expected);
                    *byte = (16 * digit(0)? + digit(1)?) as u8;
                }
            }
            Shape::Array(entry, count) => {
                let found = json.deserialize_seq(List { entry, room: *count, bytes: self.bytes })?;
                if found != *count {
                    return Err(de::Error::invalid_length(found, &format!("{count} entries").as_str()));
                }
            }
            Shape::Struct { fields, .. } => json.deserialize_map(Struct { fields, bytes: self.bytes, seq: None })?,
        }
        Ok(())
    }
}

/// A list of at most so many entries; its value is how many there were.
struct List<'a> {
    entry: &'static Shape,
    room: usize,
    bytes: &'a mut [u8],
}

impl<'de> Visitor<'de> for List<'_> {
    type Value = usize;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a list of at most {} entries", self.room)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<usize, A::Error> {
        let Self { entry, room, bytes } = self;
        let mut count = 0;
        for bytes in bytes.chunks_exact_mut(entry.size()).take(room) {
            let next = match entry {
                Shape::Array(number, 2) => list.next_element_seed(DecodedPoint { number, bytes })?,
                _ => list.next_element_seed(Decoded { shape: entry, bytes })?,
            };
            match next {
                Some(()) => count += 1,
                None => return Ok(count),
            }
        }
        match list.next_element::<IgnoredAny>()? {
            Some(_) => Err(de::Error::invalid_length(room + 1, &format!("at most {room} entries").as_str())),
            None => Ok(count),
        }
    }
}

/// As [`List`], a seed.
impl<'de> DeserializeSeed<'de> for List<'_> {
    type Value = usize;

    fn deserialize<D: Deserializer<'de>>(self, json: D) -> Result<usize, D::Error> {
        json.deserialize_seq(self)
    }
}

/// A list of values without a limit.
struct Values<T>(Vec<T>);

impl<'de, T: Layout + bytemuck::Pod> Visitor<'de> for Values<T> {
    type Value = Vec<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list")
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut list: A) -> Result<Vec<T>, A::Error> {
        loop {
            let mut value = T::zeroed();
            match list.next_element_seed(Decoded { shape: &T::SHAPE, bytes: bytemuck::bytes_of_mut(&mut value) })? {
                Some(()) => self.0.push(value),
                None => return Ok(self.0),
            }
        }
    }
}

/// Fields of a struct; at the top, the sequence number is among them.
struct Struct<'a> {
    fields: &'static [Field],
    bytes: &'a mut [u8],
    seq: Option<&'a mut Option<u64>>,
}

impl<'de> Visitor<'de> for Struct<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let Self { fields, bytes, mut seq } = self;
        let mut missing: Vec<&'static Field> = in_order(fields).collect();
        while let Some(name) = map.next_key::<String>()? {
            if let Some(seq) = seq.as_deref_mut().filter(|_| name == SEQ) {
                *seq = Some(map.next_value()?);
                continue;
            }
            let Some(at) = missing.iter().position(|field| field.name == name) else {
                map.next_value::<IgnoredAny>()?;
                continue;
            };
            let field = missing.remove(at);
            let end = field.offset + field.shape.size();
            match (field.count, &field.shape) {
                (Some(count_at), Shape::Array(entry, room)) => {
                    let count = map.next_value_seed(List { entry, room: *room, bytes: &mut bytes[field.offset..end] })?;
                    bytes[count_at..count_at + 4].copy_from_slice(&(count as u32).to_ne_bytes());
                }
                (_, shape) => map.next_value_seed(Decoded { shape, bytes: &mut bytes[field.offset..end] })?,
            }
        }
        match missing.first() {
            Some(field) => Err(de::Error::missing_field(field.name)),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{MapSummary, PlaybackControl, Progress, WayChunk};

    fn check<T: Layout + bytemuck::Pod>(json: &str, expect: &str) {
        let problem = decode::<T>(json.as_bytes()).map(|_| ()).unwrap_err().to_string();
        assert!(problem.starts_with(expect), "{problem}, expected {expect}");
    }

    #[test]
    fn json_that_does_not_fit_is_refused() {
        check::<PlaybackControl>(r#"{"speed":1.0,"paused":0}"#, "missing field `seq`");
        check::<PlaybackControl>(r#"{"seq":1,"paused":0}"#, "missing field `speed`");
        check::<PlaybackControl>(r#"{"seq":1,"speed":1.0,"paused":-1}"#, "invalid value: integer `-1`, expected u32");
        check::<PlaybackControl>(r#"{"seq":1,"speed":1.0,"paused":0}}"#, "trailing characters");
        let long = format!(r#"{{"seq":1,"process":"{}","service":"","answered":0}}"#, "x".repeat(33));
        check::<Progress>(&long, "invalid length 33, expected a text of at most 32 bytes");
        let points =
            |count: usize| format!(r#"{{"seq":1,"first":0,"total":0,"trajectory":0,"points_m":[{}]}}"#, vec!["[1,2]"; count].join(","));
        assert_eq!(decode::<WayChunk>(points(256).as_bytes()).unwrap().1.count, 256);
        let of = |entry: &str| format!(r#"{{"seq":1,"first":0,"total":0,"trajectory":0,"points_m":[{entry}]}}"#);
        assert_eq!(decode::<WayChunk>(of(r#"{"y":2,"z":{},"x":1}"#).as_bytes()).unwrap().1.points_m[0], [1.0, 2.0]);
        check::<WayChunk>(&of(r#"{"y":2}"#), "missing field `x`");
        check::<WayChunk>(&of("7"), "invalid type: integer `7`, expected an object of x and y");
        check::<WayChunk>(&points(257), "invalid length 257, expected at most 256 entries");
        check::<WayChunk>(&points(2).replace("1,2", "1"), "invalid length 1, expected 2 entries");
        let hash = |hash: &str| {
            format!(r#"{{"seq":1,"sha256":"{hash}","scans":0,"readings":0,"withheld":0,"undecided":0,"tiles":0,"way_m":0.0}}"#)
        };
        assert_eq!(decode::<MapSummary>(hash(&"0f".repeat(32)).as_bytes()).unwrap().1.sha256, [15; 32]);
        for wrong in ["0f".repeat(31), "0g".repeat(32), "é".repeat(32)] {
            check::<MapSummary>(&hash(&wrong), "invalid value: string");
        }
    }

    #[test]
    fn fields_that_are_not_known_are_ignored() {
        let json = br#"{"seq":3,"speed":2.0,"later":{"a":[1]},"paused":1}"#;
        assert_eq!(decode::<PlaybackControl>(json).unwrap(), (3, PlaybackControl { speed: 2.0, paused: 1, reserved: 0 }));
    }

    #[test]
    fn a_schema_names_what_is_encoded_and_what_it_means() {
        let schema = schema::<WayChunk>("WayChunk", "A piece.");
        let mut names: Vec<&String> = schema["properties"].as_object().unwrap().keys().collect();
        // In which order depends on the features of serde_json.
        names.sort();
        assert_eq!(names, ["first", "points_m", "seq", "total", "trajectory"]);
        assert_eq!(schema["properties"]["points_m"]["maxItems"], 256);
        assert_eq!(schema["properties"]["points_m"]["items"]["required"], json!(["x", "y"]));
        assert!(schema["properties"]["first"]["description"].as_str().is_some_and(|doc| !doc.is_empty()));
    }
}
