//! The messages of Foxglove's WebSocket protocol, version 1, as far as they are used here.

use data_encoding::BASE64;
use drivelog::Format;
use serde::{Deserialize, Serialize};
use tungstenite::Message;

/// The names of the protocol, the newer one first.
const NAMES: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
/// First byte of a message of a channel.
const MESSAGE_DATA: u8 = 1;
/// First byte of a message with the time.
const TIME: u8 = 2;
/// Level of a status: warning.
const WARNING: u8 = 1;

/// A request of a client.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub(super) enum Request {
    /// Send the messages of channels.
    Subscribe {
        /// The channels.
        subscriptions: Vec<Subscription>,
    },
    /// Stop sending them.
    Unsubscribe {
        /// The ids of the subscriptions.
        subscription_ids: Vec<u32>,
    },
    /// A request that needs a capability which is not offered.
    #[serde(other)]
    Other,
}

/// A subscription of a client to a channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Subscription {
    /// The client's id of the subscription.
    pub(super) id: u32,
    /// The id of the channel.
    pub(super) channel_id: u64,
}

/// A text message to a client.
#[derive(Serialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
enum Answer<'a> {
    ServerInfo { name: &'a str, capabilities: [&'a str; 1], session_id: String },
    Advertise { channels: Vec<Advertised<'a>> },
    Status { level: u8, message: &'a str },
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Advertised<'a> {
    id: u32,
    topic: &'a str,
    encoding: &'a str,
    schema_name: &'a str,
    schema_encoding: &'a str,
    schema: String,
}

/// The newest name of the protocol among those that the client offers.
pub(super) fn common(offered: &[String]) -> Option<&'static str> {
    NAMES.into_iter().find(|name| offered.iter().any(|other| other == name))
}

/// The first message of the server. A client drops what it shows when the run differs from the last one.
pub(super) fn server_info(name: &str, run: u64) -> Message {
    // With the capability `time` clients show sensor time: a replay has the time at which it was recorded.
    text(&Answer::ServerInfo { name, capabilities: ["time"], session_id: run.to_string() })
}

/// The channels with id, topic and format.
pub(super) fn advertise<'a>(channels: impl Iterator<Item = (u32, &'a str, &'a Format)>) -> Message {
    let channels = channels.map(|(id, topic, format)| Advertised {
        id,
        topic,
        encoding: &format.message_encoding,
        schema_name: &format.schema_name,
        schema_encoding: &format.schema_encoding,
        schema: match format.schema_encoding.as_str() {
            "protobuf" => BASE64.encode(&format.schema),
            _ => String::from_utf8_lossy(&format.schema).into_owned(),
        },
    });
    text(&Answer::Advertise { channels: channels.collect() })
}

/// A warning about a request.
pub(super) fn status(message: &str) -> Message {
    text(&Answer::Status { level: WARNING, message })
}

/// A message of a channel, under the id of a subscription.
pub(super) fn message_data(subscription: u32, log_ns: u64, data: &[u8]) -> Message {
    Message::binary([&[MESSAGE_DATA][..], &subscription.to_le_bytes(), &log_ns.to_le_bytes(), data].concat())
}

/// The current sensor time.
pub(super) fn time(log_ns: u64) -> Message {
    Message::binary([&[TIME][..], &log_ns.to_le_bytes()].concat())
}

fn text(answer: &Answer<'_>) -> Message {
    // Fails only for maps with keys that are not text; an answer has none.
    Message::text(serde_json::to_string(answer).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;
    use drivelog::PoseView;
    use serde_json::{Value, json};

    fn value(message: &Message) -> Value {
        serde_json::from_str(message.to_text().unwrap()).unwrap()
    }

    #[test]
    fn messages_follow_the_specification() {
        let info = json!({ "op": "serverInfo", "name": "demo", "capabilities": ["time"], "sessionId": "7" });
        assert_eq!(value(&server_info("demo", 7)), info);
        let format = Format {
            schema_name: "s.N".into(),
            schema_encoding: "jsonschema".into(),
            schema: b"{}".into(),
            message_encoding: "json".into(),
        };
        let channel =
            json!({ "id": 3, "topic": "a/b", "encoding": "json", "schemaName": "s.N", "schemaEncoding": "jsonschema", "schema": "{}" });
        assert_eq!(value(&advertise([(3, "a/b", &format)].into_iter())), json!({ "op": "advertise", "channels": [channel] }));
        assert_eq!(value(&status("no")), json!({ "op": "status", "level": 1, "message": "no" }));
        assert_eq!(message_data(0x0102, 3, b"xy").into_data(), [1, 2, 1, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0, b'x', b'y'].as_slice());
        assert_eq!(time(0x0102).into_data(), [2, 2, 1, 0, 0, 0, 0, 0, 0].as_slice());
    }

    #[test]
    fn a_binary_schema_is_sent_in_base64() {
        let format = PoseView::format();
        let advertised = value(&advertise([(1, "p", &format)].into_iter()));
        let schema = advertised["channels"][0]["schema"].as_str().unwrap();
        assert_eq!(BASE64.decode(schema.as_bytes()).unwrap(), format.schema);
        assert_eq!(advertised["channels"][0]["schemaName"], "foxglove.PoseInFrame");
    }

    #[test]
    fn requests_are_parsed_and_unknown_ones_recognised() {
        let read = |text: &str| serde_json::from_str::<Request>(text).ok();
        let one = Subscription { id: 1, channel_id: 2 };
        assert_eq!(
            read(r#"{"op":"subscribe","subscriptions":[{"id":1,"channelId":2}]}"#),
            Some(Request::Subscribe { subscriptions: vec![one] })
        );
        assert_eq!(read(r#"{"op":"unsubscribe","subscriptionIds":[1]}"#), Some(Request::Unsubscribe { subscription_ids: vec![1] }));
        assert_eq!(read(r#"{"op":"getParameters","parameterNames":[]}"#), Some(Request::Other));
        for bad in ["", "[]", "{}", r#"{"op":"subscribe"}"#, r#"{"op":"subscribe","subscriptions":[{"id":-1,"channelId":2}]}"#] {
            assert_eq!(read(bad), None, "{bad}");
        }
    }

    #[test]
    fn the_newest_protocol_name_is_chosen() {
        let choose = |offered: &[&str]| common(&offered.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>());
        assert_eq!(choose(&["foxglove.websocket.v1", "foxglove.sdk.v1"]), Some("foxglove.sdk.v1"));
        assert_eq!(choose(&["foxglove.websocket.v1"]), Some("foxglove.websocket.v1"));
        assert_eq!((choose(&["foxglove.sdk.v2", "foxglove.sdk.v1.1"]), choose(&[])), (None, None));
    }
}
