//! The head of a request, as far as the page needs it.

/// Longest head that is read.
pub const LONGEST_HEAD: usize = 8 * 1024;
/// Most lines of a head.
const MOST_HEADERS: usize = 64;

/// What a browser asks for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Request {
    /// The path without its query.
    pub path: String,
    /// `token` of the query.
    pub token: Option<String>,
    /// The host it believes to talk to, with the port.
    pub host: Option<String>,
    /// The page that asks, when another page than the browser's own address line does.
    pub origin: Option<String>,
    /// The key of a WebSocket handshake, when it is one.
    pub websocket_key: Option<String>,
    /// The protocols that the handshake offers to speak over it.
    pub protocols: Vec<String>,
}

/// What the bytes so far are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Head {
    /// The beginning of a head.
    Incomplete,
    /// A request, and the bytes of its head.
    Complete(Request, usize),
    /// No request that is answered; why, in words.
    Refused(&'static str),
}

/// Reads the head of a request.
#[must_use]
pub fn parse(bytes: &[u8]) -> Head {
    let mut headers = [httparse::EMPTY_HEADER; MOST_HEADERS];
    let mut request = httparse::Request::new(&mut headers);
    match request.parse(bytes) {
        Ok(httparse::Status::Partial) if bytes.len() >= LONGEST_HEAD => Head::Refused("the head is too long"),
        Ok(httparse::Status::Partial) => Head::Incomplete,
        Err(_) => Head::Refused("this is no HTTP request"),
        Ok(httparse::Status::Complete(_)) if request.method != Some("GET") => Head::Refused("only GET is answered"),
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

/// A whole answer; the connection closes behind it. Nothing in it may come from elsewhere or be framed.
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

/// An answer that says why there is none.
#[must_use]
pub fn refusal(status: &str, why: &str) -> Vec<u8> {
    response(status, "text/plain", &format!("{why}\n"))
}

/// The answer that turns a connection into a WebSocket, over which this protocol is spoken if it has a name.
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
    fn a_handshake_is_read_whole_and_not_before() {
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
    fn the_protocols_that_are_offered_are_read() {
        let offer = HANDSHAKE.replace("Upgrade: websocket", "Upgrade: websocket\r\nSec-WebSocket-Protocol: b.v1, a.v1");
        let Head::Complete(request, _) = parse(offer.as_bytes()) else { panic!("complete") };
        assert_eq!(request.protocols, ["b.v1", "a.v1"]);
    }

    #[test]
    fn what_is_no_request_is_refused_in_words() {
        for (bytes, words) in [
            (b"POST / HTTP/1.1\r\n\r\n".to_vec(), "only GET"),
            (b"\x16\x03\x01\x02\x00".to_vec(), "no HTTP"),
            ([b"GET / HTTP/1.1\r\nA: ".as_slice(), &[b'a'; LONGEST_HEAD]].concat(), "too long"),
        ] {
            match parse(&bytes) {
                Head::Refused(why) => assert!(why.contains(words), "{why}"),
                other => panic!("{other:?}"),
            }
        }
        let old = HANDSHAKE.replace("Version: 13", "Version: 8");
        assert!(matches!(parse(old.as_bytes()), Head::Complete(Request { websocket_key: None, .. }, _)));
    }

    proptest! {
        #[test]
        fn no_bytes_are_too_much(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            let _ = parse(&bytes);
            let mut damaged = HANDSHAKE.as_bytes().to_vec();
            for (index, byte) in bytes.iter().enumerate().take(4) {
                let place = (index * 251 + usize::from(*byte)) % damaged.len();
                damaged[place] = *byte;
            }
            let _ = parse(&damaged);
        }
    }
}
