//! Who may look.

use std::net::IpAddr;

use crate::http::Request;

/// The app that Foxglove serves from its own site: who opens a robot there wants its page to read this.
const FOXGLOVE_APP: &str = "https://app.foxglove.dev";

/// Who may look at a page.
#[derive(Clone, PartialEq, Eq)]
pub struct Access {
    address: IpAddr,
    token: Option<String>,
}

/// Why a request is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// It does not know the token.
    #[error("the token is missing or wrong: open http://ADDRESS:PORT/?token=TOKEN with the token of the settings")]
    Token,
    /// It was sent by the page of another site.
    #[error("another site's page asks for this: only the robot's own page is answered")]
    ForeignOrigin,
    /// It believes to talk to another host: a name that was made to lead here.
    #[error("the host asked for is not this computer")]
    ForeignHost,
    /// It is sent by a page that is not known as a tool's.
    #[error("another site's page asks for this: set a token in [viewer], and open ws://ADDRESS:PORT/?token=TOKEN in it")]
    ForeignTool,
}

impl Access {
    /// Access to a page at this address, with this token if there is one.
    #[must_use]
    pub fn new(address: IpAddr, token: Option<&str>) -> Self {
        Self { address, token: token.map(str::to_owned) }
    }

    /// Whether the page is shown, and data sent, to who asks so.
    ///
    /// # Errors
    /// Why not.
    pub fn admit(&self, request: &Request) -> Result<(), Refusal> {
        self.admit_host(request)?;
        self.admit_token(request)
    }

    /// Whether data is sent to a tool, which is a program, a page of this computer or Foxglove's: a site that somebody merely
    /// visits is none. Where there is a token, whoever knows it is a tool.
    ///
    /// # Errors
    /// Why not.
    pub fn admit_tool(&self, request: &Request) -> Result<(), Refusal> {
        self.admit_known_host(request)?;
        if self.token.is_some() {
            return self.admit_token(request);
        }
        match request.origin.as_deref() {
            Some(origin) if !is_tool(origin) => Err(Refusal::ForeignTool),
            _ => Ok(()),
        }
    }

    fn admit_token(&self, request: &Request) -> Result<(), Refusal> {
        let token = request.token.as_deref().unwrap_or_default();
        if self.token.as_deref().is_some_and(|expected| !equal(expected.as_bytes(), token.as_bytes())) {
            return Err(Refusal::Token);
        }
        Ok(())
    }

    /// Whether it comes from a page of this host: what is public, the page's scripts, needs no token.
    ///
    /// # Errors
    /// Why not.
    pub fn admit_host(&self, request: &Request) -> Result<(), Refusal> {
        self.admit_known_host(request)?;
        let host = request.host.as_deref().unwrap_or_default();
        let origin = request.origin.as_deref().map(|origin| origin.split_once("://").map_or(origin, |(_, host)| host));
        match origin {
            Some(origin) if !origin.eq_ignore_ascii_case(host) => Err(Refusal::ForeignOrigin),
            _ => Ok(()),
        }
    }

    /// A site can have its name lead to 127.0.0.1 and then be "the same origin": there only this computer's own names hold.
    fn admit_known_host(&self, request: &Request) -> Result<(), Refusal> {
        let host = request.host.as_deref().unwrap_or_default();
        if self.address.is_loopback() && !is_this_computer(host) { Err(Refusal::ForeignHost) } else { Ok(()) }
    }
}

/// Whether it is a program's origin (`file:` or a scheme of its own), a page of this computer, or Foxglove's app; a page that
/// hides where it comes from says `null`.
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

/// Compares in a time that does not tell how much of it is right.
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
    fn a_page_of_this_computer_is_for_its_own_pages() {
        let access = Access::new("127.0.0.1".parse().unwrap(), None);
        for (host, origin, expected) in [
            ("localhost:8088", Some("http://localhost:8088"), Ok(())),
            ("127.0.0.1:8088", Some("http://127.0.0.1:8088"), Ok(())),
            ("[::1]:8088", Some("http://[::1]:8088"), Ok(())),
            ("127.0.0.1:8088", None, Ok(())),
            ("127.0.0.1:8088", Some("http://localhost:8088"), Err(Refusal::ForeignOrigin)),
            ("127.0.0.1:8088", Some("http://127.0.0.1:9000"), Err(Refusal::ForeignOrigin)),
            ("127.0.0.1:8088", Some("https://example.org"), Err(Refusal::ForeignOrigin)),
            ("127.0.0.1:8088", Some("null"), Err(Refusal::ForeignOrigin)),
            ("example.org:8088", Some("http://example.org:8088"), Err(Refusal::ForeignHost)),
            ("localhost.example.org", None, Err(Refusal::ForeignHost)),
            ("", None, Err(Refusal::ForeignHost)),
        ] {
            assert_eq!(access.admit(&request(host, origin, None)), expected, "{host} {origin:?}");
        }
    }

    #[test]
    fn elsewhere_the_token_is_asked_for() {
        let access = Access::new("0.0.0.0".parse().unwrap(), Some("0123456789abcdef"));
        let robot = "robot.local:8088";
        for (token, expected) in [
            (Some("0123456789abcdef"), Ok(())),
            (None, Err(Refusal::Token)),
            (Some(""), Err(Refusal::Token)),
            (Some("0123456789abcde"), Err(Refusal::Token)),
            (Some("0123456789abcdeF"), Err(Refusal::Token)),
            (Some("0123456789abcdef0"), Err(Refusal::Token)),
        ] {
            assert_eq!(access.admit(&request(robot, Some("http://robot.local:8088"), token)), expected, "{token:?}");
        }
        assert_eq!(access.admit(&request(robot, Some("http://elsewhere"), Some("0123456789abcdef"))), Err(Refusal::ForeignOrigin));
        assert_eq!(access.admit_host(&request(robot, None, None)), Ok(()), "scripts and styles are public");
    }

    #[test]
    fn tools_are_programs_pages_of_this_computer_and_who_knows_the_token() {
        let open = Access::new("127.0.0.1".parse().unwrap(), None);
        for (origin, expected) in [
            (None, Ok(())),
            (Some("file://"), Ok(())),
            (Some("lichtblick://app"), Ok(())),
            (Some("http://localhost:8080"), Ok(())),
            (Some("https://app.foxglove.dev"), Ok(())),
            (Some("https://app.foxglove.dev.example.org"), Err(Refusal::ForeignTool)),
            (Some("http://localhost.example.org"), Err(Refusal::ForeignTool)),
            (Some("https://example.org"), Err(Refusal::ForeignTool)),
            (Some("null"), Err(Refusal::ForeignTool)),
        ] {
            assert_eq!(open.admit_tool(&request("localhost:8765", origin, None)), expected, "{origin:?}");
        }
        assert_eq!(open.admit_tool(&request("example.org:8765", None, None)), Err(Refusal::ForeignHost));
        let guarded = Access::new("0.0.0.0".parse().unwrap(), Some("0123456789abcdef"));
        let ask = |token| guarded.admit_tool(&request("robot:8765", Some("https://tools.example.org"), token));
        assert_eq!((ask(None), ask(Some("0123456789abcdef"))), (Err(Refusal::Token), Ok(())));
    }
}
