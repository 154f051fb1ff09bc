//! `[viewer]`: the page that a browser shows, and the port that Foxglove connects to.

use std::borrow::Cow;
use std::net::{IpAddr, Ipv4Addr};

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use crate::bounded::bounded;
use crate::text::BadText;

bounded! {
    /// The port of the page. When it is taken, the next nine are tried.
    PagePort: u32 in 1024..=65526, "", default 8088;

    /// The port that Foxglove connects to; its default is Foxglove's. When it is taken, the next nine are tried.
    FoxglovePort: u32 in 1024..=65526, "", default 8765;
}

/// Where the page is served.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Address(IpAddr);

/// What a browser has to know to be served.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Token(String);

/// `[viewer]`: the page that a browser shows, and the port that Foxglove and Lichtblick connect to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Viewer {
    /// Address at which the page and the port for Foxglove are served. An address other than loopback requires a token.
    pub address: Address,
    /// Port of the page. If it is in use, the next nine are tried.
    pub port: PagePort,
    /// Port for Foxglove and Lichtblick, `ws://ADDRESS:PORT`. If it is in use, the next nine are tried. Pages of other sites than
    /// Foxglove's own require the token.
    pub foxglove_port: FoxglovePort,
    /// Token that a browser or Foxglove sends: `http://ADDRESS:PORT/?token=TOKEN`, `ws://ADDRESS:PORT/?token=TOKEN`. It is not
    /// encrypted on the network.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub token: Option<Token>,
}

impl Default for Viewer {
    fn default() -> Self {
        Self {
            address: Address(IpAddr::V4(Ipv4Addr::LOCALHOST)),
            port: PagePort::default(),
            foxglove_port: FoxglovePort::default(),
            token: None,
        }
    }
}

impl Address {
    /// The address.
    #[must_use]
    pub fn get(self) -> IpAddr {
        self.0
    }
}

impl Token {
    /// The token.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

/// A token is not for logs.
impl core::fmt::Debug for Token {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("Token(…)")
    }
}

impl TryFrom<String> for Address {
    type Error = BadText;

    fn try_from(text: String) -> Result<Self, BadText> {
        text.parse().map(Self).map_err(|_| BadText { expected: "an IP address, such as \"127.0.0.1\" or \"0.0.0.0\"" })
    }
}

impl TryFrom<String> for Token {
    type Error = BadText;

    fn try_from(text: String) -> Result<Self, BadText> {
        let allowed = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'-' || byte == b'_';
        if (16..=128).contains(&text.len()) && text.bytes().all(allowed) {
            Ok(Self(text))
        } else {
            Err(BadText { expected: "16 to 128 of a-z, A-Z, 0-9, - and _" })
        }
    }
}

impl From<Address> for String {
    fn from(address: Address) -> Self {
        address.0.to_string()
    }
}

impl From<Token> for String {
    fn from(token: Token) -> Self {
        token.0
    }
}

impl JsonSchema for Address {
    fn schema_name() -> Cow<'static, str> {
        "Address".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "minLength": 2, "x-form": "IP address" })
    }
}

impl JsonSchema for Token {
    fn schema_name() -> Cow<'static, str> {
        "Token".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "pattern": "^[A-Za-z0-9_-]{16,128}$", "x-form": "16 to 128 of a-z, A-Z, 0-9, - and _" })
    }
}
