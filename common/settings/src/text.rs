//! Texts with a form of their own.

use core::fmt;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};

/// A text that does not have the form of its setting.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("expected {expected}")]
pub struct BadText {
    /// The form.
    pub expected: &'static str,
}

/// A name of a deployment or a process: 1 to 24 of a-z, 0-9 and -.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Name(String);

/// The name of a file, without a folder.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct FileName(String);

/// Where a robot is connected.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "PathBuf", into = "PathBuf")]
pub enum Port {
    /// The pseudo-terminal of this deployment's simulator: `robot` in the domain's folder.
    Simulator,
    /// A serial device.
    Device(PathBuf),
}

/// The word that stands for [`Port::Simulator`].
const SIMULATOR: &str = "simulator";

impl Name {
    /// For names written in the code; a test holds them to the form.
    pub(crate) fn literal(text: &'static str) -> Self {
        Self(text.to_owned())
    }

    /// The name.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl FileName {
    /// For names written in the code; a test holds them to the form.
    pub(crate) fn literal(text: &'static str) -> Self {
        Self(text.to_owned())
    }

    /// The name.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl TryFrom<String> for Name {
    type Error = BadText;

    fn try_from(text: String) -> Result<Self, BadText> {
        let allowed = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-';
        if (1..=24).contains(&text.len()) && text.bytes().all(allowed) {
            Ok(Self(text))
        } else {
            Err(BadText { expected: "1 to 24 of a-z, 0-9 and -" })
        }
    }
}

impl TryFrom<String> for FileName {
    type Error = BadText;

    fn try_from(text: String) -> Result<Self, BadText> {
        let plain = Path::new(&text).file_name().is_some_and(|name| name.to_str() == Some(&text));
        if plain && text.len() <= 200 && !text.contains(char::is_control) {
            Ok(Self(text))
        } else {
            Err(BadText { expected: "the name of a file, without a folder, at most 200 bytes" })
        }
    }
}

impl TryFrom<PathBuf> for Port {
    type Error = BadText;

    fn try_from(path: PathBuf) -> Result<Self, BadText> {
        if path.as_os_str() == SIMULATOR {
            Ok(Self::Simulator)
        } else if begins_with_tilde(&path) {
            Err(BadText { expected: NO_TILDE })
        } else if names_a_place(&path) {
            Ok(Self::Device(path))
        } else {
            Err(BadText { expected: "\"simulator\" or the path of a serial device" })
        }
    }
}

/// Deserializes a path that can be opened at all.
pub(crate) fn path<'de, D: Deserializer<'de>>(deserializer: D) -> Result<PathBuf, D::Error> {
    let path = PathBuf::deserialize(deserializer)?;
    if begins_with_tilde(&path) {
        return Err(D::Error::custom(BadText { expected: NO_TILDE }));
    }
    if names_a_place(&path) { Ok(path) } else { Err(D::Error::custom(BadText { expected: "a path" })) }
}

/// What is expected in place of `~`, which shells expand and a settings file does not: a folder of this name would appear instead.
pub(crate) const NO_TILDE: &str = "a path without ~, which only a shell expands: write the folder out, or ./~ for a name";

pub(crate) fn begins_with_tilde(path: &Path) -> bool {
    path.as_os_str().as_encoded_bytes().starts_with(b"~")
}

fn names_a_place(path: &Path) -> bool {
    let bytes = path.as_os_str().as_encoded_bytes();
    !bytes.is_empty() && !bytes.contains(&0)
}

impl From<Port> for PathBuf {
    fn from(port: Port) -> Self {
        match port {
            Port::Simulator => Self::from(SIMULATOR),
            Port::Device(path) => path,
        }
    }
}

impl From<Name> for String {
    fn from(name: Name) -> Self {
        name.0
    }
}

impl From<FileName> for String {
    fn from(name: FileName) -> Self {
        name.0
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl fmt::Display for FileName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl JsonSchema for Name {
    fn schema_name() -> Cow<'static, str> {
        "Name".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "pattern": "^[a-z0-9-]{1,24}$", "x-form": "1 to 24 of a-z, 0-9 and -" })
    }
}

impl JsonSchema for FileName {
    fn schema_name() -> Cow<'static, str> {
        "FileName".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "pattern": "^[^/]{1,200}$", "x-form": "name of a file" })
    }
}

impl JsonSchema for Port {
    fn schema_name() -> Cow<'static, str> {
        "Port".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "minLength": 1, "x-form": "path of a device, or `\"simulator\"`" })
    }
}
