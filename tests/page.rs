//! The live page's data as a browser receives it, and a replay that obeys.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod harness;

use std::net::TcpStream;
use std::time::Duration;

use drivelog::Logged;
use harness::{Bench, Run, text};
use messages::SonarScan;
use serde_json::Value;
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

const CORRIDOR: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/config/worlds/corridor-empty.toml");

/// Longest the page may say nothing before the test is called hung; nothing is measured by it.
const WATCHDOG: Duration = Duration::from_secs(120);

/// Somebody who watches the page of the deployment that runs.
struct Watcher {
    socket: WebSocket<TcpStream>,
    tiles: usize,
}

impl Watcher {
    fn join(bench: &Bench) -> Self {
        let is_served = |process: &Value| process["note"].as_str().is_some_and(|note| note.starts_with("http://"));
        let viewer = bench.wait_for("viewer", "it serves the page", is_served);
        let address = viewer["note"].as_str().unwrap().trim_start_matches("http://").trim_end_matches('/').to_owned();
        let stream = TcpStream::connect(&address).unwrap();
        stream.set_read_timeout(Some(WATCHDOG)).unwrap();
        let (socket, _) = tungstenite::client(format!("ws://{address}/live"), stream).unwrap();
        Self { socket, tiles: 0 }
    }

    /// The next message of this kind for which `wanted` holds.
    fn wait(&mut self, kind: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        loop {
            match self.socket.read().expect("the page goes on") {
                Message::Text(json) => {
                    let message: Value = serde_json::from_str(&json).unwrap();
                    if message["kind"] == kind && wanted(&message) {
                        return message;
                    }
                }
                Message::Binary(bytes) if bytes[0] == 1 => self.tiles += (bytes.len() - 4) / 1036,
                _ => {}
            }
        }
    }

    fn ask(&mut self, paused: bool, times: f64) {
        self.socket.send(Message::text(format!("{{\"paused\":{paused},\"times\":{times}}}"))).unwrap();
    }
}

/// Foxglove as it connects to the port that the page names: the topics it can have, and a message of one of them.
fn foxglove(watcher: &mut Watcher, topic: &str) -> (Vec<String>, Vec<u8>) {
    let port = &watcher.wait("deployment", |deployment| deployment["foxglove_port"].is_u64())["foxglove_port"];
    let stream = TcpStream::connect(("127.0.0.1", u16::try_from(port.as_u64().unwrap()).unwrap())).unwrap();
    stream.set_read_timeout(Some(WATCHDOG)).unwrap();
    let mut request = format!("ws://127.0.0.1:{port}/").into_client_request().unwrap();
    request.headers_mut().insert("Sec-WebSocket-Protocol", HeaderValue::from_static("foxglove.sdk.v1"));
    let (mut socket, _) = tungstenite::client(request, stream).unwrap();
    let mut topics = Vec::new();
    loop {
        match socket.read().expect("the port goes on") {
            Message::Text(json) => {
                let said: Value = serde_json::from_str(&json).unwrap();
                for channel in said["channels"].as_array().into_iter().flatten() {
                    topics.push(channel["topic"].as_str().unwrap().to_owned());
                    if channel["topic"] == topic {
                        let wish = serde_json::json!({ "op": "subscribe", "subscriptions": [{ "id": 1, "channelId": channel["id"] }] });
                        socket.send(Message::text(wish.to_string())).unwrap();
                    }
                }
            }
            // After the kind of message, its subscription and its time.
            Message::Binary(bytes) if bytes[0] == 1 => return (topics, bytes[13..].to_vec()),
            _ => {}
        }
    }
}

/// Playback in a status.
fn playback(status: &Value) -> &Value {
    status["processes"].as_array().and_then(|all| all.iter().find(|process| process["name"] == "playback")).unwrap_or(&Value::Null)
}

#[test]
fn a_replay_stands_still_and_goes_on_as_it_is_asked() {
    let bench = Bench::new();
    let out = bench.path("out");
    let demo = Run::start(bench.stillmap(["demo", "--speed", "30", "--world", CORRIDOR, "--out", out.to_str().unwrap()]));
    let mut watcher = Watcher::join(&bench);
    let (topics, message) = foxglove(&mut watcher, "robot/scan");
    assert!(["map/picture", "camera/frame", "health/log"].iter().all(|topic| topics.iter().any(|it| it == topic)), "{topics:?}");
    let (seq, scan) = SonarScan::decode(&message).unwrap();
    assert!(seq > 0 && scan.count > 0, "{scan:?}");
    let scene = watcher.wait("scene", |scene| scene["scans"].as_u64() > Some(100));
    assert!(scene["replay"].is_null(), "a drive obeys nobody");
    assert!(scene["cones"].as_array().is_some_and(|beams| beams.len() > 3), "{scene}");
    watcher.wait("status", |status| status["processes"].as_array().is_some_and(|all| all.len() > 4));
    assert!(watcher.tiles > 4, "{} tiles", watcher.tiles);
    let demo = demo.end();
    assert!(text(&demo.stdout).contains("map sha256 "), "{}", text(&demo.stderr));

    let log = out.join("drive.mcap");
    let replay = ["replay", log.to_str().unwrap(), "--pace", "live", "--out", bench.path("again").to_str().unwrap()].map(str::to_owned);
    let replay = Run::start(bench.stillmap(replay));
    let mut watcher = Watcher::join(&bench);
    watcher.wait("scene", |scene| scene["scans"].as_u64() > Some(5) && scene["replay"]["paused"] == false);
    watcher.ask(true, 1.0);
    watcher.wait("scene", |scene| scene["replay"]["paused"] == true);
    let first = watcher.wait("status", |status| playback(status)["counters"]["paused"] == 1);
    let later = first["uptime_s"].as_f64().unwrap() + 2.0;
    let second = watcher.wait("status", |status| status["uptime_s"].as_f64() > Some(later));
    assert!(playback(&first)["counters"]["scans played"].as_u64() > Some(0));
    assert_eq!(playback(&first)["counters"]["scans played"], playback(&second)["counters"]["scans played"], "it stands still");
    watcher.ask(false, 40.0);
    let fast = watcher.wait("scene", |scene| scene["replay"]["times"] == 40.0);
    assert_eq!(fast["replay"]["paused"], false);
    watcher.wait("status", |status| status["ending"] == true);
    let replay = replay.end();
    assert!(text(&replay.stdout).contains("map sha256 "), "{}", text(&replay.stderr));
}
