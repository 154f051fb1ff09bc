//! One client of the port.

use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::time::Instant;

use tungstenite::Message;
use tungstenite::protocol::frame::coding::CloseCode;

use super::channels::Channels;
use super::protocol::{self, Request, Subscription};
use crate::access::Access;
use crate::connection::refuse;
use crate::http;
use crate::link::{Link, Reply};

/// Longest message from a client, bytes: far more than a subscription to every channel.
const LONGEST_REQUEST: usize = 16 * 1024;
/// While so many bytes are on their way to a client, it misses what comes.
const MOST_WAITING: usize = 1 << 20;

/// What a client is told of first, and who is one.
pub(super) struct Offer {
    pub(super) access: Access,
    pub(super) channels: Channels,
    pub(super) greeting: [Message; 2],
}

/// A connection to the port.
pub(super) struct Client<S: Read + Write> {
    /// Known of a client are its subscriptions: the channel of each.
    pub(super) link: Link<S, BTreeMap<u32, u32>>,
}

impl<S: Read + Write> Client<S> {
    /// A connection that has just been made; `stream` does not block.
    pub(super) fn new(stream: S, now: Instant) -> Self {
        Self { link: Link::new(stream, now) }
    }

    /// Takes what has come; the channels that were subscribed to. Whatever is wrong ends this connection and nothing else.
    pub(super) fn advance(&mut self, offer: &Offer, now: Instant) -> Vec<u32> {
        let was_known = self.link.guest().is_some();
        let texts = self.link.advance(now, |request| answer(request, &offer.access));
        if !was_known && self.link.guest().is_some() {
            offer.greeting.iter().for_each(|message| self.link.write(message.clone()));
        }
        let mut subscribed = Vec::new();
        for text in texts {
            match serde_json::from_str(text.as_str()) {
                Ok(Request::Subscribe { subscriptions }) => {
                    subscribed.extend(subscriptions.into_iter().filter_map(|wish| self.subscribe(wish, &offer.channels)));
                }
                Ok(Request::Unsubscribe { subscription_ids }) => {
                    let Some(subscriptions) = self.link.guest_mut() else { break };
                    subscriptions.retain(|id, _| !subscription_ids.contains(id));
                }
                Ok(Request::Other) => self.link.write(protocol::status("this is not offered here: see the capabilities")),
                Err(_) => {
                    self.link.dismiss(CloseCode::Policy, "this is no request of Foxglove's protocol");
                    break;
                }
            }
        }
        subscribed
    }

    /// The channel that is subscribed to now.
    fn subscribe(&mut self, wish: Subscription, channels: &Channels) -> Option<u32> {
        let subscriptions = self.link.guest_mut()?;
        let trouble = match channels.known(wish.channel_id) {
            None => "a subscription names a channel that there is not",
            Some(_) if subscriptions.contains_key(&wish.id) => "a subscription's number is taken already",
            // A client has use for one to each channel.
            Some(_) if subscriptions.len() >= 4 * channels.count() => "there are too many subscriptions",
            Some(channel) => {
                subscriptions.insert(wish.id, channel);
                return Some(channel);
            }
        };
        self.link.write(protocol::status(trouble));
        None
    }

    /// Whether it has subscribed to a channel.
    pub(super) fn wants(&self, channel: u32) -> bool {
        self.link.guest().is_some_and(|subscriptions| subscriptions.values().any(|it| *it == channel))
    }

    /// Sends a message of a channel under each number that it was subscribed to with; false when too much is on its way already.
    pub(super) fn send(&mut self, channel: u32, log_ns: u64, data: &[u8]) -> bool {
        if self.link.backlog() > MOST_WAITING {
            return false;
        }
        let subscriptions = self.link.guest().into_iter().flatten();
        let ids: Vec<u32> = subscriptions.filter(|(_, it)| **it == channel).map(|(id, _)| *id).collect();
        ids.into_iter().for_each(|id| self.link.write(protocol::message_data(id, log_ns, data)));
        true
    }
}

fn answer(request: &http::Request, access: &Access) -> Reply<BTreeMap<u32, u32>> {
    if let Err(refusal) = access.admit_tool(request) {
        return Reply::Answer(refuse(refusal));
    }
    match (&request.websocket_key, protocol::common(&request.protocols)) {
        (Some(key), Some(name)) => Reply::Switch { head: http::switch(key, Some(name)), longest: LONGEST_REQUEST, guest: BTreeMap::new() },
        (Some(_), None) => Reply::Answer(http::refusal("400 Bad Request", "spoken here is foxglove.sdk.v1, or foxglove.websocket.v1")),
        (None, _) => {
            Reply::Answer(http::refusal("426 Upgrade Required", "this port is for Foxglove and Lichtblick: open it in one of them"))
        }
    }
}
