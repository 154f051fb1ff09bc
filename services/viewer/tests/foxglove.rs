//! The port for Foxglove, over socket pairs.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::time::{Duration, Instant};

use drivelog::{Image, Logged, MapView, PoseView};
use messages::{CameraFrame, FrameLayout, LogLine, MapTile, PixelFormat, Pose, SonarScan, TILE_CELLS, Text};
use proptest::prelude::*;
use serde_json::{Value, json};
use stillmap_viewer::access::Access;
use stillmap_viewer::foxglove::{Feed, Sent};
use tungstenite::handshake::client::generate_key;
use tungstenite::protocol::{Role, WebSocket};
use tungstenite::{Bytes, Message};

/// Time after which a read fails, so that a hung test ends.
const WATCHDOG: Duration = Duration::from_secs(60);
const TOKEN: &str = "0123456789abcdef";

/// A port with clients.
struct Bench {
    feed: Feed<UnixStream>,
    now: Instant,
}

/// A connected client.
struct Foxglove {
    socket: WebSocket<UnixStream>,
    channels: BTreeMap<String, Value>,
}

fn scan(x_m: f64) -> SonarScan {
    SonarScan::new(Pose { x_m, y_m: 2.0, yaw_rad: 0.5 }, &[], false)
}

fn tile(column: i32) -> MapTile {
    MapTile { cell_m: 0.05, column, tiles_in_layer: 1, log_odds: [1.0; TILE_CELLS], ..MapTile::default() }
}

impl Bench {
    fn new() -> Self {
        Self::with(Access::new("127.0.0.1".parse().unwrap(), None))
    }

    fn with(access: Access) -> Self {
        let now = Instant::now();
        Self { feed: Feed::new("demo", 7, access, now), now }
    }

    /// A stream to the port, and its response to these lines.
    fn ask(&mut self, lines: &str) -> (UnixStream, String) {
        let (server, mut client) = UnixStream::pair().unwrap();
        server.set_nonblocking(true).unwrap();
        client.set_read_timeout(Some(WATCHDOG)).unwrap();
        self.feed.add_client(server, self.now);
        client.write_all(lines.as_bytes()).unwrap();
        self.feed.advance(self.now);
        let mut answer = Vec::new();
        let mut byte = [0];
        while !answer.ends_with(b"\r\n\r\n") && client.read(&mut byte).unwrap() == 1 {
            answer.extend(byte);
        }
        (client, String::from_utf8(answer).unwrap())
    }

    fn connect(&mut self) -> Foxglove {
        let (stream, answer) = self.ask(&handshake("/", "foxglove.websocket.v1, foxglove.sdk.v1", None));
        assert!(answer.starts_with("HTTP/1.1 101 ") && answer.contains("\r\nSec-WebSocket-Protocol: foxglove.sdk.v1\r\n"), "{answer}");
        self.flush();
        let mut socket = WebSocket::from_raw_socket(stream, Role::Client, None);
        let info = text(&mut socket);
        assert_eq!((&info["op"], &info["name"], &info["sessionId"]), (&json!("serverInfo"), &json!("stillmap demo"), &json!("7")));
        let advertised = text(&mut socket);
        assert_eq!(advertised["op"], "advertise");
        let channels = advertised["channels"].as_array().unwrap().iter();
        Foxglove { socket, channels: channels.map(|it| (it["topic"].as_str().unwrap().to_owned(), it.clone())).collect() }
    }

    fn flush(&mut self) {
        self.feed.flush(self.now);
    }

    /// Whether another client is served.
    fn serves_another(&mut self) -> bool {
        let mut other = self.connect();
        other.subscribe(self, &[(1, "robot/pose")]);
        self.feed.message(1, 10, &scan(1.0));
        self.flush();
        other.message(10).0 == 1
    }
}

impl Foxglove {
    fn send(&mut self, bench: &mut Bench, request: &Value) {
        self.socket.send(Message::text(request.to_string())).unwrap();
        bench.feed.advance(bench.now);
        bench.flush();
    }

    fn subscribe(&mut self, bench: &mut Bench, subscriptions: &[(u32, &str)]) {
        let subscriptions: Vec<Value> =
            subscriptions.iter().map(|(id, topic)| json!({ "id": id, "channelId": self.channels[*topic]["id"] })).collect();
        self.send(bench, &json!({ "op": "subscribe", "subscriptions": subscriptions }));
    }

    /// The next message, of this time: its subscription and bytes.
    fn message(&mut self, log_ns: u64) -> (u32, Bytes) {
        loop {
            let Message::Binary(bytes) = self.socket.read().unwrap() else { panic!("no data") };
            if bytes[0] == 1 {
                assert_eq!(u64::from_le_bytes(bytes[5..13].try_into().unwrap()), log_ns);
                return (u32::from_le_bytes(bytes[1..5].try_into().unwrap()), bytes.slice(13..));
            }
        }
    }

    /// The next text message.
    fn text(&mut self) -> Value {
        text(&mut self.socket)
    }
}

fn text(socket: &mut WebSocket<UnixStream>) -> Value {
    loop {
        if let Message::Text(json) = socket.read().unwrap() {
            return serde_json::from_str(&json).unwrap();
        }
    }
}

fn handshake(path: &str, protocols: &str, origin: Option<&str>) -> String {
    let origin = origin.map(|origin| format!("Origin: {origin}\r\n")).unwrap_or_default();
    let key = generate_key();
    format!(
        "GET {path} HTTP/1.1\r\nHost: localhost:8765\r\n{origin}Upgrade: websocket\r\nConnection: Upgrade\r\n\
         Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}\r\nSec-WebSocket-Protocol: {protocols}\r\n\r\n"
    )
}

#[test]
fn channels_and_messages_are_those_of_a_log() {
    let mut bench = Bench::new();
    let mut foxglove = bench.connect();
    for (topic, schema, encoding) in [
        ("robot/scan", "stillmap.SonarScan", "json"),
        ("robot/pose", "foxglove.PoseInFrame", "protobuf"),
        ("camera/frame", "foxglove.RawImage", "protobuf"),
        ("camera/mask", "foxglove.RawImage", "protobuf"),
        ("map/tile", "foxglove.Grid", "protobuf"),
        ("map/picture", "foxglove.Grid", "protobuf"),
        ("viewer/scene", "foxglove.SceneUpdate", "protobuf"),
        ("health/status", "stillmap.DeploymentStatus", "json"),
        ("health/log", "foxglove.Log", "protobuf"),
    ] {
        let channel = &foxglove.channels[topic];
        assert_eq!((&channel["schemaName"], &channel["encoding"]), (&json!(schema), &json!(encoding)), "{topic}");
    }
    let schema = foxglove.channels["robot/scan"]["schema"].as_str().unwrap().as_bytes();
    assert_eq!(schema, SonarScan::format().schema);

    foxglove.subscribe(&mut bench, &[(5, "robot/scan"), (6, "robot/pose"), (9, "camera/frame")]);
    let (scan, layout) = (scan(1.5), FrameLayout { width: 2, height: 1, stride: 2, format: PixelFormat::Grey as u32 });
    bench.feed.message(3, 1_000, &scan);
    bench.feed.picture::<CameraFrame>(4, 2_000, &layout, &[7, 8]);
    bench.flush();
    let (id, bytes) = foxglove.message(1_000);
    assert_eq!((id, SonarScan::decode(&bytes).unwrap()), (5, (3, scan)));
    assert_eq!(foxglove.message(1_000), (6, PoseView::encode(&scan, &Pose::default(), 1_000).into()));
    assert_eq!(foxglove.message(2_000), (9, Image::encode(&layout, &[7, 8], 4, 2_000).into()));
    assert_eq!(bench.feed.sent(), Sent { messages: 3, ..Sent::default() });
    assert!(bench.feed.wants::<CameraFrame>());
}

#[test]
fn every_shown_service_of_the_registry_has_a_channel() {
    let foxglove = Bench::new().connect();
    for service in messages::SERVICES {
        assert_eq!(foxglove.channels.contains_key(service.name), service.shown, "{}", service.name);
    }
}

#[test]
fn reports_are_sent_at_sensor_time() {
    let mut bench = Bench::new();
    let mut foxglove = bench.connect();
    foxglove.subscribe(&mut bench, &[(1, "health/log")]);
    let line = LogLine { process: Text::new("mapping"), ..LogLine::default() };
    bench.feed.message(1, 5_000, &scan(0.0));
    bench.feed.message(1, 99, &line);
    bench.flush();
    foxglove.message(5_000);
    let time = foxglove.socket.read().unwrap().into_data();
    assert_eq!((time[0], u64::from_le_bytes(time[1..9].try_into().unwrap())), (2, 5_000));
}

#[test]
fn a_late_subscriber_receives_the_whole_map_once() {
    let mut bench = Bench::new();
    bench.feed.message(1, 50, &tile(0));
    bench.feed.message(2, 60, &tile(1));
    let mut expected = MapView::default();
    (0..2).for_each(|column| expected.take(&tile(column)));
    let expected = Bytes::from(expected.draw(60).unwrap());
    for id in [1, 2] {
        let mut foxglove = bench.connect();
        foxglove.subscribe(&mut bench, &[(id, "map/picture")]);
        bench.now += Duration::from_secs(1);
        bench.flush();
        assert_eq!(foxglove.message(60), (id, expected.clone()));
        foxglove.send(&mut bench, &json!({ "op": "unsubscribe", "subscriptionIds": [id] }));
    }
    let before = bench.feed.sent();
    bench.now += Duration::from_secs(1);
    bench.feed.message(3, 70, &tile(1));
    bench.flush();
    assert_eq!(bench.feed.sent(), before, "no client subscribes to it");
}

#[test]
fn a_stalled_client_misses_messages_and_is_closed() {
    let mut bench = Bench::new();
    let mut stalled = bench.connect();
    stalled.subscribe(&mut bench, &[(1, "map/tile")]);
    let bytes = tile(0).encode(1, 1).len() as u64;
    for seq in 1..2_000 {
        bench.feed.message(seq, seq, &tile(0));
        bench.flush();
    }
    let sent = bench.feed.sent();
    assert!(sent.messages * bytes < 3_000_000 && sent.dropped > 1_000, "{sent:?}");
    assert!(bench.serves_another() && bench.feed.is_writing());
    bench.now += Duration::from_secs(11);
    bench.flush();
    bench.flush();
    assert!(!bench.feed.is_writing(), "it is closed");
}

#[test]
fn invalid_input_closes_the_connection() {
    for message in [
        Message::text(""),
        Message::text("{}"),
        Message::text(r#"{"op":"subscribe","subscriptions":[{"id":1}]}"#),
        Message::text(format!("{{\"op\":\"subscribe\",\"subscriptions\":[{}]}}", " ".repeat(20_000))),
        Message::binary(vec![1; 20]),
    ] {
        let mut bench = Bench::new();
        let mut foxglove = bench.connect();
        foxglove.socket.send(message.clone()).unwrap();
        bench.feed.advance(bench.now);
        assert_eq!(bench.feed.clients(), 0, "{message:?}");
        assert!(bench.serves_another());
    }
}

#[test]
fn an_invalid_request_is_answered_with_a_status() {
    let mut bench = Bench::new();
    let mut foxglove = bench.connect();
    for (request, words) in [
        (json!({ "op": "subscribe", "subscriptions": [{ "id": 1, "channelId": 4_000_000_000_000_u64 }] }), "unknown channel"),
        (json!({ "op": "subscribe", "subscriptions": [{ "id": 1, "channelId": 1 }, { "id": 1, "channelId": 2 }] }), "already in use"),
        (json!({ "op": "getParameters", "parameterNames": [] }), "not offered"),
        (
            json!({ "op": "subscribe", "subscriptions": (10..100).map(|id| json!({ "id": id, "channelId": 1 })).collect::<Vec<_>>() }),
            "too many",
        ),
    ] {
        foxglove.send(&mut bench, &request);
        let status = foxglove.text();
        assert!(status["op"] == "status" && status["message"].as_str().unwrap().contains(words), "{status}");
    }
    assert!(bench.feed.clients() == 1 && bench.serves_another());
}

#[test]
fn a_request_that_is_not_admitted_gets_an_error() {
    let response = |bench: &mut Bench, request: &str| bench.ask(request).1.lines().next().unwrap().to_owned();
    let sdk = "foxglove.sdk.v1";
    let mut open = Bench::new();
    assert_eq!(response(&mut open, &handshake("/", sdk, Some("https://example.org"))), "HTTP/1.1 403 Forbidden");
    assert_eq!(response(&mut open, &handshake("/", "chat", None)), "HTTP/1.1 400 Bad Request");
    assert_eq!(response(&mut open, "GET / HTTP/1.1\r\nHost: localhost:8765\r\n\r\n"), "HTTP/1.1 426 Upgrade Required");
    assert_eq!(response(&mut open, &handshake("/", sdk, Some("https://app.foxglove.dev"))), "HTTP/1.1 101 Switching Protocols");
    let mut guarded = Bench::with(Access::new("0.0.0.0".parse().unwrap(), Some(TOKEN)));
    assert_eq!(response(&mut guarded, &handshake("/", sdk, None)), "HTTP/1.1 401 Unauthorized");
    assert_eq!(response(&mut guarded, &handshake(&format!("/?token={TOKEN}"), sdk, None)), "HTTP/1.1 101 Switching Protocols");
}

#[test]
fn the_number_of_clients_is_limited() {
    let mut bench = Bench::new();
    let clients: Vec<Foxglove> = (0..8).map(|_| bench.connect()).collect();
    let (server, mut client) = UnixStream::pair().unwrap();
    bench.feed.add_client(server, bench.now);
    assert_eq!((client.read(&mut [0]).unwrap(), bench.feed.clients(), bench.feed.sent().refused), (0, 8, 1));
    drop(clients);
    bench.feed.advance(bench.now);
    assert!(bench.serves_another(), "closed clients no longer count");
}

proptest! {
    #[test]
    fn any_bytes_at_most_close_the_connection(bytes in prop::collection::vec(any::<u8>(), 0..400), request in ".{0,80}") {
        let mut bench = Bench::new();
        let mut foxglove = bench.connect();
        foxglove.socket.send(Message::text(request)).unwrap();
        foxglove.socket.get_mut().write_all(&bytes).unwrap();
        bench.feed.advance(bench.now);
        bench.flush();
    }
}
