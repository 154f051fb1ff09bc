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
    /// A robot simulator or a serial bridge in the network.
    Network(NetworkPort),
}

/// A TCP port of a host: `tcp://HOST:PORT`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NetworkPort {
    /// Its name or address; an IPv6 address without brackets.
    pub host: String,
    /// The port.
    pub port: u16,
}

/// What a [`Port::Network`] starts with.
const TCP: &str = "tcp://";

/// The port on which robot simulators and robots' own network bridges listen, unless another is named.
const DEFAULT_TCP_PORT: u16 = 8101;

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
        let network = path.to_str().and_then(|text| text.strip_prefix(TCP));
        if path.as_os_str() == SIMULATOR {
            Ok(Self::Simulator)
        } else if let Some(address) = network {
            NetworkPort::parse(address).map(Self::Network).ok_or(BadText { expected: "tcp://HOST:PORT, an IPv6 address in [ ]" })
        } else if begins_with_tilde(&path) {
            Err(BadText { expected: NO_TILDE })
        } else if names_a_place(&path) {
            Ok(Self::Device(path))
        } else {
            Err(BadText { expected: "\"simulator\", the path of a serial device, or tcp://HOST:PORT" })
        }
    }
}

impl NetworkPort {
    /// Reads `HOST`, `HOST:PORT`, `[IPV6]` or `[IPV6]:PORT`.
    fn parse(text: &str) -> Option<Self> {
        let (host, port) = match text.strip_prefix('[') {
            Some(rest) => {
                let (host, port) = rest.split_once(']')?;
                host.parse::<std::net::Ipv6Addr>().ok()?;
                (host, if port.is_empty() { None } else { Some(port.strip_prefix(':')?) })
            }
            None => text.split_once(':').map_or((text, None), |(host, port)| (host, Some(port))),
        };
        let is_host = |byte: u8| byte.is_ascii_alphanumeric() || b".-_:".contains(&byte);
        let port = port.map_or(Some(DEFAULT_TCP_PORT), |port| port.parse().ok().filter(|&port| port > 0))?;
        (!host.is_empty() && host.len() <= 253 && host.bytes().all(is_host)).then(|| Self { host: host.to_owned(), port })
    }
}

impl fmt::Display for NetworkPort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { host, port } = self;
        if host.contains(':') { write!(f, "{TCP}[{host}]:{port}") } else { write!(f, "{TCP}{host}:{port}") }
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

/// As [`path`], for a key that may be left out.
pub(crate) fn optional_path<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<PathBuf>, D::Error> {
    path(deserializer).map(Some)
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
            Port::Network(network) => Self::from(network.to_string()),
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
        json_schema!({ "type": "string", "minLength": 1, "x-form": "path of a device, `\"simulator\"`, or `\"tcp://HOST:PORT\"`" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(text: &str, expect: Option<&str>) {
        let read = Port::try_from(PathBuf::from(text)).ok().map(|port| PathBuf::from(port).display().to_string());
        assert_eq!(read.as_deref(), expect, "{text}");
    }

    #[test]
    fn network_ports_are_read_with_and_without_a_port() {
        check("tcp://robot.local:8101", Some("tcp://robot.local:8101"));
        check("tcp://10.0.126.32", Some("tcp://10.0.126.32:8101"));
        check("tcp://[::1]:7000", Some("tcp://[::1]:7000"));
        check("tcp://[fe80::1]", Some("tcp://[fe80::1]:8101"));
    }

    #[test]
    fn what_is_no_network_port_is_refused() {
        for text in ["tcp://", "tcp://:8101", "tcp://::1:8101", "tcp://a:b", "tcp://a:0", "tcp://a:65536", "tcp://[::1", "tcp://[a]:1"] {
            check(text, None);
        }
        for text in ["tcp://a b:1", "tcp://a/b:1", "tcp://user@host:1", "tcp://a:1:2"] {
            check(text, None);
        }
    }
}
