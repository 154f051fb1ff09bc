//! Which requests are admitted.

use std::net::IpAddr;

use crate::http::Request;

/// The site of Foxglove's web app, which connects to the port for Foxglove.
const FOXGLOVE_APP: &str = "https://app.foxglove.dev";

/// The rules for requests to one address.
#[derive(Clone, PartialEq, Eq)]
pub struct Access {
    address: IpAddr,
    token: Option<String>,
}

/// Why a request is rejected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Rejection {
    /// It has no valid token.
    #[error("the token is missing or wrong: open http://ADDRESS:PORT/?token=TOKEN with the token of the settings")]
    Token,
    /// A page of another site sent it.
    #[error("the request comes from the page of another site")]
    ForeignOrigin,
    /// Its `Host` is not this computer: a foreign name resolves to this address (DNS rebinding).
    #[error("the requested host is not this computer")]
    ForeignHost,
    /// A page of an unknown site sent it to the port for tools.
    #[error("the request comes from the page of another site: set a token in [viewer] and connect to ws://ADDRESS:PORT/?token=TOKEN")]
    ForeignTool,
}

impl Access {
    /// The rules for a server at this address, with a token if it has one.
    #[must_use]
    pub fn new(address: IpAddr, token: Option<&str>) -> Self {
        Self { address, token: token.map(str::to_owned) }
    }

    /// Checks a request for the page or its data.
    ///
    /// # Errors
    /// The reason to reject it.
    pub fn admit(&self, request: &Request) -> Result<(), Rejection> {
        self.admit_host(request)?;
        self.admit_token(request)
    }

    /// Checks a request of a tool: a program, a page of this computer, or Foxglove's web app. With a token, any client that has the
    /// token is admitted.
    ///
    /// # Errors
    /// The reason to reject it.
    pub fn admit_tool(&self, request: &Request) -> Result<(), Rejection> {
        self.admit_known_host(request)?;
        if self.token.is_some() {
            return self.admit_token(request);
        }
        match request.origin.as_deref() {
            Some(origin) if !is_tool(origin) => Err(Rejection::ForeignTool),
            _ => Ok(()),
        }
    }

    fn admit_token(&self, request: &Request) -> Result<(), Rejection> {
        let token = request.token.as_deref().unwrap_or_default();
        if self.token.as_deref().is_some_and(|expected| !equal(expected.as_bytes(), token.as_bytes())) {
            return Err(Rejection::Token);
        }
        Ok(())
    }

    /// Checks that a request does not come from a page of another site. The scripts of the page are public and need no token.
    ///
    /// # Errors
    /// The reason to reject it.
    pub fn admit_host(&self, request: &Request) -> Result<(), Rejection> {
        self.admit_known_host(request)?;
        let host = request.host.as_deref().unwrap_or_default();
        let origin = request.origin.as_deref().map(|origin| origin.split_once("://").map_or(origin, |(_, host)| host));
        match origin {
            Some(origin) if !origin.eq_ignore_ascii_case(host) => Err(Rejection::ForeignOrigin),
            _ => Ok(()),
        }
    }

    /// A foreign name may resolve to 127.0.0.1 and make its pages same-origin (DNS rebinding): at a loopback address only names of
    /// this computer are admitted.
    fn admit_known_host(&self, request: &Request) -> Result<(), Rejection> {
        let host = request.host.as_deref().unwrap_or_default();
        if self.address.is_loopback() && !is_this_computer(host) { Err(Rejection::ForeignHost) } else { Ok(()) }
    }
}

/// Whether an origin is a program (`file:` or a scheme of its own), a page of this computer, or Foxglove's web app. An opaque origin
/// is `null`.
fn is_tool(origin: &str) -> bool {
    match origin.split_once("://") {
        Some(("http" | "https", host)) => is_this_computer(host) || origin == FOXGLOVE_APP,
        Some(_) => true,
        None => false,
    }
}

fn is_this_computer(host: &str) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next().unwrap_or_default(),
        None => host.split(':').next().unwrap_or_default(),
    };
    name.eq_ignore_ascii_case("localhost") || name.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
}

/// Compares in a time that does not depend on the position of a difference.
fn equal(expected: &[u8], found: &[u8]) -> bool {
    let differences = expected.iter().zip(found).fold(0, |differences, (a, b)| differences | (a ^ b));
    expected.len() == found.len() && differences == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(host: &str, origin: Option<&str>, token: Option<&str>) -> Request {
        let owned = |text: Option<&str>| text.map(str::to_owned);
        Request {
            path: "/live".to_owned(),
            token: owned(token),
            host: Some(host.to_owned()),
            origin: owned(origin),
            websocket_key: None,
            protocols: Vec::new(),
        }
    }

    #[test]
    fn at_loopback_only_local_pages_are_admitted() {
        let access = Access::new("127.0.0.1".parse().unwrap(), None);
        for (host, origin, expected) in [
            ("localhost:8088", Some("http://localhost:8088"), Ok(())),
            ("127.0.0.1:8088", Some("http://127.0.0.1:8088"), Ok(())),
            ("[::1]:8088", Some("http://[::1]:8088"), Ok(())),
            ("127.0.0.1:8088", None, Ok(())),
            ("127.0.0.1:8088", Some("http://localhost:8088"), Err(Rejection::ForeignOrigin)),
            ("127.0.0.1:8088", Some("http://127.0.0.1:9000"), Err(Rejection::ForeignOrigin)),
            ("127.0.0.1:8088", Some("https://example.org"), Err(Rejection::ForeignOrigin)),
            ("127.0.0.1:8088", Some("null"), Err(Rejection::ForeignOrigin)),
            ("example.org:8088", Some("http://example.org:8088"), Err(Rejection::ForeignHost)),
            ("localhost.example.org", None, Err(Rejection::ForeignHost)),
            ("", None, Err(Rejection::ForeignHost)),
        ] {
            assert_eq!(access.admit(&request(host, origin, None)), expected, "{host} {origin:?}");
        }
    }

    #[test]
    fn at_other_addresses_the_token_is_required() {
        let access = Access::new("0.0.0.0".parse().unwrap(), Some("0123456789abcdef"));
        let robot = "robot.local:8088";
        for (token, expected) in [
            (Some("0123456789abcdef"), Ok(())),
            (None, Err(Rejection::Token)),
            (Some(""), Err(Rejection::Token)),
            (Some("0123456789abcde"), Err(Rejection::Token)),
            (Some("0123456789abcdeF"), Err(Rejection::Token)),
            (Some("0123456789abcdef0"), Err(Rejection::Token)),
        ] {
            assert_eq!(access.admit(&request(robot, Some("http://robot.local:8088"), token)), expected, "{token:?}");
        }
        assert_eq!(access.admit(&request(robot, Some("http://elsewhere"), Some("0123456789abcdef"))), Err(Rejection::ForeignOrigin));
        assert_eq!(access.admit_host(&request(robot, None, None)), Ok(()), "scripts and styles are public");
    }

    #[test]
    fn tools_are_programs_local_pages_and_clients_with_the_token() {
        let open = Access::new("127.0.0.1".parse().unwrap(), None);
        for (origin, expected) in [
            (None, Ok(())),
            (Some("file://"), Ok(())),
            (Some("lichtblick://app"), Ok(())),
            (Some("http://localhost:8080"), Ok(())),
            (Some("https://app.foxglove.dev"), Ok(())),
            (Some("https://app.foxglove.dev.example.org"), Err(Rejection::ForeignTool)),
            (Some("http://localhost.example.org"), Err(Rejection::ForeignTool)),
            (Some("https://example.org"), Err(Rejection::ForeignTool)),
            (Some("null"), Err(Rejection::ForeignTool)),
        ] {
            assert_eq!(open.admit_tool(&request("localhost:8765", origin, None)), expected, "{origin:?}");
        }
        assert_eq!(open.admit_tool(&request("example.org:8765", None, None)), Err(Rejection::ForeignHost));
        let guarded = Access::new("0.0.0.0".parse().unwrap(), Some("0123456789abcdef"));
        let ask = |token| guarded.admit_tool(&request("robot:8765", Some("https://tools.example.org"), token));
        assert_eq!((ask(None), ask(Some("0123456789abcdef"))), (Err(Rejection::Token), Ok(())));
    }
}
