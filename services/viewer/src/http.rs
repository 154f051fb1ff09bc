//! HTTP requests and responses, as far as the page needs them.

/// Longest head of a request, bytes.
pub const LONGEST_HEAD: usize = 8 * 1024;
/// Most header fields of a request.
const MOST_HEADERS: usize = 64;

/// A request of a browser.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Request {
    /// The path without its query.
    pub path: String,
    /// The parameter `token` of the query.
    pub token: Option<String>,
    /// The header `Host`: name and port of the server as the client knows it.
    pub host: Option<String>,
    /// The header `Origin`: the site of the page that sends the request; `None` if the user opened the address.
    pub origin: Option<String>,
    /// The key of a WebSocket handshake, if it is one.
    pub websocket_key: Option<String>,
    /// The subprotocols that the handshake offers.
    pub protocols: Vec<String>,
}

/// The bytes received so far.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Head {
    /// The beginning of a head.
    Incomplete,
    /// A request, and the length of its head in bytes.
    Complete(Request, usize),
    /// Not a valid request, with the reason.
    Invalid(&'static str),
}

/// Reads the head of a request.
#[must_use]
pub fn parse(bytes: &[u8]) -> Head {
    let mut headers = [httparse::EMPTY_HEADER; MOST_HEADERS];
    let mut request = httparse::Request::new(&mut headers);
    match request.parse(bytes) {
        Ok(httparse::Status::Partial) if bytes.len() >= LONGEST_HEAD => Head::Invalid("the head is too long"),
        Ok(httparse::Status::Partial) => Head::Incomplete,
        Err(_) => Head::Invalid("this is not an HTTP request"),
        Ok(httparse::Status::Complete(_)) if request.method != Some("GET") => Head::Invalid("the only method is GET"),
        Ok(httparse::Status::Complete(length)) => Head::Complete(read(&request), length),
    }
}

fn read(request: &httparse::Request<'_, '_>) -> Request {
    let target = request.path.unwrap_or_default();
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    let token = query.split('&').find_map(|pair| pair.strip_prefix("token="));
    let header = |name: &str| {
        let found = request.headers.iter().find(|header| header.name.eq_ignore_ascii_case(name));
        found.and_then(|header| std::str::from_utf8(header.value).ok()).map(|value| value.trim().to_owned())
    };
    let has_word =
        |name: &str, word: &str| header(name).is_some_and(|value| value.split(',').any(|each| each.trim().eq_ignore_ascii_case(word)));
    let handshake = has_word("upgrade", "websocket") && has_word("connection", "upgrade") && has_word("sec-websocket-version", "13");
    Request {
        path: path.to_owned(),
        token: token.map(str::to_owned),
        host: header("host"),
        origin: header("origin"),
        websocket_key: handshake.then(|| header("sec-websocket-key")).flatten(),
        protocols: header("sec-websocket-protocol").iter().flat_map(|list| list.split(',')).map(|name| name.trim().to_owned()).collect(),
    }
}

/// A response after which the connection is closed. The browser may load nothing from other servers and must not frame it.
#[must_use]
pub fn response(status: &str, content_type: &str, body: &str) -> Vec<u8> {
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {content_type}; charset=utf-8\r\nContent-Length: {}\r\nConnection: close\r\n\
         Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n\
         Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src data:; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n\r\n",
        body.len()
    );
    [head.as_bytes(), body.as_bytes()].concat()
}

/// An error response with its reason as text.
#[must_use]
pub fn error(status: &str, reason: &str) -> Vec<u8> {
    response(status, "text/plain", &format!("{reason}\n"))
}

/// The response that switches a connection to WebSocket, with the subprotocol that was chosen.
#[must_use]
pub fn switch(key: &str, protocol: Option<&str>) -> Vec<u8> {
    let accept = tungstenite::handshake::derive_accept_key(key.as_bytes());
    let protocol = protocol.map(|name| format!("Sec-WebSocket-Protocol: {name}\r\n")).unwrap_or_default();
    format!(
        "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: {accept}\r\n{protocol}\r\n"
    )
    .into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const HANDSHAKE: &str = "GET /live?a=1&token=x-y HTTP/1.1\r\nHost: localhost:8088\r\nOrigin: http://localhost:8088\r\n\
        Upgrade: websocket\r\nConnection: keep-alive, Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n";

    #[test]
    fn a_handshake_is_parsed_once_it_is_complete() {
        for length in 0..HANDSHAKE.len() {
            assert_eq!(parse(&HANDSHAKE.as_bytes()[..length]), Head::Incomplete, "{length} bytes");
        }
        let Head::Complete(request, length) = parse(HANDSHAKE.as_bytes()) else { panic!("complete") };
        assert_eq!(length, HANDSHAKE.len());
        assert_eq!((request.path.as_str(), request.token.as_deref()), ("/live", Some("x-y")));
        assert_eq!(request.host.as_deref(), Some("localhost:8088"));
        let key = request.websocket_key.unwrap();
        // The example of RFC 6455, section 1.3.
        let plain = String::from_utf8(switch(&key, None)).unwrap();
        assert!(plain.ends_with("Sec-WebSocket-Accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo=\r\n\r\n"), "{plain}");
        let named = String::from_utf8(switch(&key, Some("a.v1"))).unwrap();
        assert!(named.ends_with("\r\nSec-WebSocket-Protocol: a.v1\r\n\r\n"), "{named}");
    }

    #[test]
    fn the_offered_subprotocols_are_parsed() {
        let offer = HANDSHAKE.replace("Upgrade: websocket", "Upgrade: websocket\r\nSec-WebSocket-Protocol: b.v1, a.v1");
        let Head::Complete(request, _) = parse(offer.as_bytes()) else { panic!("complete") };
        assert_eq!(request.protocols, ["b.v1", "a.v1"]);
    }

    #[test]
    fn an_invalid_request_gives_its_reason() {
        for (bytes, words) in [
            (b"POST / HTTP/1.1\r\n\r\n".to_vec(), "only method"),
            (b"\x16\x03\x01\x02\x00".to_vec(), "not an HTTP"),
            ([b"GET / HTTP/1.1\r\nA: ".as_slice(), &[b'a'; LONGEST_HEAD]].concat(), "too long"),
        ] {
            match parse(&bytes) {
                Head::Invalid(reason) => assert!(reason.contains(words), "{reason}"),
                other => panic!("{other:?}"),
            }
        }
        let old = HANDSHAKE.replace("Version: 13", "Version: 8");
        assert!(matches!(parse(old.as_bytes()), Head::Complete(Request { websocket_key: None, .. }, _)));
    }

    proptest! {
        #[test]
        fn any_bytes_can_be_parsed(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            let _ = parse(&bytes);
            let mut damaged = HANDSHAKE.as_bytes().to_vec();
            for (index, byte) in bytes.iter().enumerate().take(4) {
                let at = (index * 251 + usize::from(*byte)) % damaged.len();
                damaged[at] = *byte;
            }
            let _ = parse(&damaged);
        }
    }
}
