//! The connection of a browser, over a socket pair.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::time::{Duration, Instant};

use messages::{MapTile, TILE_CELLS};
use proptest::prelude::*;
use stillmap_viewer::access::Access;
use stillmap_viewer::{Board, Command, Connection, Offer, Site, Topic};
use tungstenite::protocol::{Role, WebSocket};
use tungstenite::{Bytes, Message};

const HANDSHAKE: &str = "GET /live HTTP/1.1\r\nHost: localhost:8088\r\nOrigin: http://localhost:8088\r\nUpgrade: websocket\r\n\
    Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n";

struct Ends {
    server: Connection<UnixStream>,
    client: UnixStream,
    access: Access,
    metrics: Option<String>,
    now: Instant,
}

impl Ends {
    fn new() -> Self {
        let (server, client) = UnixStream::pair().unwrap();
        server.set_nonblocking(true).unwrap();
        let now = Instant::now();
        Self { server: Connection::new(server, now), client, access: Access::new("127.0.0.1".parse().unwrap(), None), metrics: None, now }
    }

    fn advance(&mut self) -> Vec<Command> {
        self.server.advance(Site { access: &self.access, accepts_commands: true, metrics: self.metrics.as_deref() }, self.now)
    }

    /// Sends a request and reads the whole response.
    fn ask(mut self, request: &str) -> String {
        self.client.write_all(request.as_bytes()).unwrap();
        while !self.server.is_closed() {
            self.advance();
        }
        drop(self.server);
        let mut answer = String::new();
        self.client.read_to_string(&mut answer).unwrap();
        answer
    }

    /// A browser that shows the page.
    fn watching() -> (Self, WebSocket<UnixStream>) {
        let mut ends = Self::new();
        ends.client.write_all(HANDSHAKE.as_bytes()).unwrap();
        ends.advance();
        let mut answer = Vec::new();
        while !answer.ends_with(b"\r\n\r\n") {
            let mut byte = [0];
            ends.client.read_exact(&mut byte).unwrap();
            answer.extend(byte);
        }
        assert!(answer.starts_with(b"HTTP/1.1 101 ") && ends.server.is_watching());
        let socket = WebSocket::from_raw_socket(ends.client.try_clone().unwrap(), Role::Client, None);
        (ends, socket)
    }
}

fn tile(column: i32, value: f32) -> MapTile {
    MapTile { cell_m: 0.05, column, tiles_in_layer: 1, log_odds: [value; TILE_CELLS], ..MapTile::default() }
}

#[test]
fn metrics_are_served_once_there_is_a_status() {
    let request = "GET /metrics HTTP/1.1\r\nHost: localhost:8088\r\n\r\n";
    assert!(Ends::new().ask(request).starts_with("HTTP/1.1 503 "));
    let answer = Ends { metrics: Some("stillmap_up 1\n".to_owned()), ..Ends::new() }.ask(request);
    assert!(answer.starts_with("HTTP/1.1 200 OK\r\nContent-Type: text/plain; version=0.0.4; charset=utf-8\r\n"), "{answer}");
    assert!(answer.ends_with("\r\n\r\nstillmap_up 1\n"), "{answer}");
    let access = Access::new("0.0.0.0".parse().unwrap(), Some("0123456789abcdef"));
    let refused = Ends { access, metrics: Some(String::new()), ..Ends::new() }.ask(request);
    assert!(refused.starts_with("HTTP/1.1 401 "), "without the token of the page: {refused}");
}

#[test]
fn only_the_files_of_the_page_are_served() {
    let get = |path: &str| Ends::new().ask(&format!("GET {path} HTTP/1.1\r\nHost: localhost:8088\r\n\r\n"));
    let page = get("/?x=1");
    assert!(page.starts_with("HTTP/1.1 200 OK\r\nContent-Type: text/html") && page.contains("default-src 'none'"), "{page}");
    assert!(page.ends_with("</html>\n"));
    assert!(get("/main.js").starts_with("HTTP/1.1 200 OK\r\nContent-Type: text/javascript"));
    for (path, status) in [("/../Cargo.toml", "404"), ("/main.js/", "404"), ("/live", "426"), ("*", "404")] {
        assert!(get(path).starts_with(&format!("HTTP/1.1 {status} ")), "{path}: {}", get(path));
    }
    assert!(Ends::new().ask("POST / HTTP/1.1\r\n\r\n").starts_with("HTTP/1.1 400 "));
    assert!(Ends::new().ask("\u{16}\u{3}\u{1} TLS\r\n\r\n").starts_with("HTTP/1.1 400 "));
}

#[test]
fn foreign_pages_and_wrong_tokens_are_refused() {
    let foreign = HANDSHAKE.replace("Origin: http://localhost:8088", "Origin: https://example.org");
    assert!(Ends::new().ask(&foreign).starts_with("HTTP/1.1 403 "));
    let with_token = || Ends { access: Access::new("0.0.0.0".parse().unwrap(), Some("0123456789abcdef")), ..Ends::new() };
    assert!(with_token().ask(HANDSHAKE).starts_with("HTTP/1.1 401 "));
    assert!(with_token().ask("GET / HTTP/1.1\r\nHost: localhost:8088\r\n\r\n").starts_with("HTTP/1.1 401 "));
    assert!(with_token().ask("GET /?token=0123456789abcdef HTTP/1.1\r\nHost: robot\r\n\r\n").starts_with("HTTP/1.1 200 "));
}

#[test]
fn a_request_may_come_in_pieces_before_the_deadline() {
    let mut ends = Ends::new();
    for byte in HANDSHAKE.bytes() {
        assert!(!ends.server.is_watching());
        ends.client.write_all(&[byte]).unwrap();
        ends.advance();
    }
    assert!(ends.server.is_watching());
    let mut slow = Ends::new();
    slow.client.write_all(b"GET / HT").unwrap();
    slow.advance();
    assert!(!slow.server.is_closed());
    slow.now += Duration::from_secs(6);
    slow.advance();
    assert!(slow.server.is_closed());
}

#[test]
fn a_browser_receives_updates_and_sends_commands() {
    let (mut ends, mut socket) = Ends::watching();
    let mut board = Board::default();
    board.put(Topic::Status, Message::text("{}"));
    board.message(&tile(0, 1.0));
    assert_eq!(ends.server.offer(&board, ends.now), Offer::Sent(2 + 4 + 12 + TILE_CELLS));
    assert_eq!(socket.read().unwrap(), Message::text("{}"));
    assert_eq!(socket.read().unwrap().len(), 4 + 12 + TILE_CELLS);
    assert_eq!(ends.server.offer(&board, ends.now), Offer::Sent(0));
    socket.send(Message::text("{\"paused\":true,\"times\":2.5}")).unwrap();
    assert_eq!(ends.advance(), [Command { paused: true, times: 2.5 }]);
    socket.close(None).unwrap();
    ends.advance();
    ends.advance();
    assert!(ends.server.is_closed());
}

#[test]
fn a_stalled_browser_misses_updates_and_is_closed() {
    let (mut ends, _socket) = Ends::watching();
    let mut board = Board::default();
    let mut missed = 0;
    let mut sent = 0;
    for round in 0_u16..2_000 {
        (0..32).for_each(|column| board.message(&tile(column, f32::from(round % 4) - 1.5)));
        match ends.server.offer(&board, ends.now) {
            Offer::Sent(bytes) => sent += bytes,
            Offer::Missed => missed += 1,
            Offer::NotWatching => panic!("closed before the deadline"),
        }
    }
    assert!(missed > 1_900, "{missed} missed");
    assert!(sent < 2_000_000, "{sent} bytes are queued");
    ends.now += Duration::from_secs(11);
    assert_eq!(ends.server.offer(&board, ends.now), Offer::NotWatching);
    assert!(ends.server.is_closed());
}

/// Whether these bytes of a browser close its connection.
fn is_closed_by(bytes: &[u8]) -> bool {
    let (mut ends, _socket) = Ends::watching();
    ends.client.write_all(bytes).unwrap();
    ends.advance();
    ends.server.is_closed()
}

#[test]
fn invalid_input_closes_the_connection() {
    let closes = |message: Message| {
        let (mut ends, mut socket) = Ends::watching();
        socket.send(message).unwrap();
        let commands = ends.advance();
        assert!(commands.is_empty(), "{commands:?}");
        ends.server.is_closed()
    };
    for text in
        ["", "{}", "{\"paused\":1,\"times\":1}", "{\"paused\":true,\"times\":1,\"more\":1}", "[]", "{\"paused\":true,\"times\":null}"]
    {
        assert!(closes(Message::text(text)), "{text}");
    }
    assert!(closes(Message::binary(vec![0; 10])));
    assert!(closes(Message::text(" ".repeat(2_000))), "too long");
    assert!(is_closed_by(b"\x81\x02{}"), "not masked");
    assert!(is_closed_by(&[0xff; 20]), "no frame");
    assert!(!closes(Message::Ping(Bytes::from_static(b"?"))));
}

proptest! {
    #[test]
    fn any_bytes_at_most_close_the_connection(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        is_closed_by(&bytes);
        let mut ends = Ends::new();
        ends.client.write_all(&bytes).unwrap();
        ends.advance();
    }
}
