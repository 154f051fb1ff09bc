//! The live page's data as a browser receives it, and a replay that is paused and sped up from there.

use std::net::TcpStream;

use drivelog::Logged;
use messages::SonarScan;
use serde_json::Value;
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

use crate::harness::{Run, Sandbox, WATCHDOG, worlds};

/// The address of the page of a run, once it is served.
pub(crate) fn page_address(run: &mut Run) -> String {
    run.wait_for("viewer", "it serves the page", |it| it.note.as_str().starts_with("http://")).note.to_string()
}

/// A client of the page.
struct Client {
    socket: WebSocket<TcpStream>,
    tiles: usize,
}

impl Client {
    fn connect(run: &mut Run) -> Self {
        let page = page_address(run);
        let address = page.trim_start_matches("http://").trim_end_matches('/');
        let stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(WATCHDOG)).unwrap();
        let (socket, _) = tungstenite::client(format!("ws://{address}/live"), stream).unwrap();
        Self { socket, tiles: 0 }
    }

    /// The next message of this kind for which `wanted` holds.
    fn wait(&mut self, kind: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        loop {
            match self.socket.read().expect("the page sends on") {
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

    fn request(&mut self, paused: bool, times: f64) {
        self.socket.send(Message::text(format!("{{\"paused\":{paused},\"times\":{times}}}"))).unwrap();
    }
}

/// Foxglove as it connects to the port that the page names: the topics it is offered, and a message of one of them.
fn foxglove(client: &mut Client, topic: &str) -> (Vec<String>, Vec<u8>) {
    let port = &client.wait("deployment", |deployment| deployment["foxglove_port"].is_u64())["foxglove_port"];
    let stream = TcpStream::connect(("127.0.0.1", u16::try_from(port.as_u64().unwrap()).unwrap())).unwrap();
    stream.set_read_timeout(Some(WATCHDOG)).unwrap();
    let mut request = format!("ws://127.0.0.1:{port}/").into_client_request().unwrap();
    request.headers_mut().insert("Sec-WebSocket-Protocol", HeaderValue::from_static("foxglove.sdk.v1"));
    let (mut socket, _) = tungstenite::client(request, stream).unwrap();
    let mut topics = Vec::new();
    loop {
        match socket.read().expect("the port sends on") {
            Message::Text(json) => {
                let said: Value = serde_json::from_str(&json).unwrap();
                for channel in said["channels"].as_array().into_iter().flatten() {
                    topics.push(channel["topic"].as_str().unwrap().to_owned());
                    if channel["topic"] == topic {
                        let request = serde_json::json!({ "op": "subscribe", "subscriptions": [{ "id": 1, "channelId": channel["id"] }] });
                        socket.send(Message::text(request.to_string())).unwrap();
                    }
                }
            }
            // The payload follows the kind of message, its subscription and its time.
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
fn a_drive_is_shown_on_the_page_and_in_foxglove() {
    let sandbox = Sandbox::new();
    let world = worlds::path("corridor-empty");
    let mut run = sandbox.start(sandbox.stillmap(["demo", "--speed", "6", "--world", world.to_str().unwrap()]));
    let mut client = Client::connect(&mut run);
    let (topics, message) = foxglove(&mut client, "robot/scan");
    assert!(["map/picture", "camera/frame", "health/log"].iter().all(|topic| topics.iter().any(|it| it == topic)), "{topics:?}");
    let (seq, scan) = SonarScan::decode(&message).unwrap();
    assert!(seq > 0 && scan.count > 0, "{scan:?}");
    let scene = client.wait("scene", |scene| scene["scans"].as_u64() > Some(100));
    assert!(scene["replay"].is_null(), "a drive has no replay controls");
    assert!(scene["cones"].as_array().is_some_and(|cones| cones.len() > 3), "{scene}");
    client.wait("status", |status| status["processes"].as_array().is_some_and(|all| all.len() > 4));
    assert!(client.tiles > 4, "{} tiles", client.tiles);
    run.end().map();
}

#[test]
fn a_live_replay_pauses_and_changes_speed_on_request() {
    let sandbox = Sandbox::new();
    let log = crate::harness::replay::DRIVE.log(&sandbox);
    let mut run = sandbox.start(sandbox.stillmap(["replay", log.to_str().unwrap(), "--pace", "live"]));
    let mut client = Client::connect(&mut run);
    client.wait("scene", |scene| scene["scans"].as_u64() > Some(5) && scene["replay"]["paused"] == false);
    client.request(true, 1.0);
    client.wait("scene", |scene| scene["replay"]["paused"] == true);
    let first = client.wait("status", |status| playback(status)["counters"]["paused"] == 1);
    let later = first["uptime_s"].as_f64().unwrap() + 2.0;
    let second = client.wait("status", |status| status["uptime_s"].as_f64() > Some(later));
    assert!(playback(&first)["counters"]["robot/scan played"].as_u64() > Some(0));
    assert_eq!(playback(&first)["counters"]["robot/scan played"], playback(&second)["counters"]["robot/scan played"], "paused");
    client.request(false, 40.0);
    let fast = client.wait("scene", |scene| scene["replay"]["times"] == 40.0);
    assert_eq!(fast["replay"]["paused"], false);
    client.wait("status", |status| status["ending"] == true);
    run.end().map();
}
