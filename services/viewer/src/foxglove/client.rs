//! The connection of one client of the port.

use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::time::Instant;

use tungstenite::Message;
use tungstenite::protocol::frame::coding::CloseCode;

use super::channels::Channels;
use super::protocol::{self, Request, Subscription};
use crate::access::Access;
use crate::connection::reject;
use crate::http;
use crate::link::{Link, Reply};

/// Longest message from a client, bytes: far more than a subscription to every channel.
const LONGEST_REQUEST: usize = 16 * 1024;
/// A client with a backlog of more bytes misses further messages.
const MOST_BACKLOG: usize = 1 << 20;

/// What every client is offered.
pub(super) struct Offer {
    pub(super) access: Access,
    pub(super) channels: Channels,
    pub(super) greeting: [Message; 2],
}

/// A connection to the port.
pub(super) struct Client<S: Read + Write> {
    /// The peer's subscriptions by id, with the channel of each.
    pub(super) link: Link<S, BTreeMap<u32, u32>>,
}

impl<S: Read + Write> Client<S> {
    /// A new connection over a non-blocking stream.
    pub(super) fn new(stream: S, now: Instant) -> Self {
        Self { link: Link::new(stream, now) }
    }

    /// Reads what has arrived; returns the channels of new subscriptions. Invalid input closes this connection and affects no other.
    pub(super) fn advance(&mut self, offer: &Offer, now: Instant) -> Vec<u32> {
        let was_open = self.link.peer().is_some();
        let texts = self.link.advance(now, |request| answer(request, &offer.access));
        if !was_open && self.link.peer().is_some() {
            offer.greeting.iter().for_each(|message| self.link.write(message.clone()));
        }
        let mut subscribed = Vec::new();
        for text in texts {
            match serde_json::from_str(text.as_str()) {
                Ok(Request::Subscribe { subscriptions }) => {
                    subscribed.extend(subscriptions.into_iter().filter_map(|subscription| self.subscribe(subscription, &offer.channels)));
                }
                Ok(Request::Unsubscribe { subscription_ids }) => {
                    let Some(subscriptions) = self.link.peer_mut() else { break };
                    subscriptions.retain(|id, _| !subscription_ids.contains(id));
                }
                Ok(Request::Other) => self.link.write(protocol::status("this capability is not offered")),
                Err(_) => {
                    self.link.close(CloseCode::Policy, "this is not a request of Foxglove's protocol");
                    break;
                }
            }
        }
        subscribed
    }

    /// Adds a subscription; returns its channel.
    fn subscribe(&mut self, subscription: Subscription, channels: &Channels) -> Option<u32> {
        let subscriptions = self.link.peer_mut()?;
        let problem = match channels.known(subscription.channel_id) {
            None => "a subscription names an unknown channel",
            Some(_) if subscriptions.contains_key(&subscription.id) => "the id of a subscription is already in use",
            // A client needs one for each channel.
            Some(_) if subscriptions.len() >= 4 * channels.count() => "there are too many subscriptions",
            Some(channel) => {
                subscriptions.insert(subscription.id, channel);
                return Some(channel);
            }
        };
        self.link.write(protocol::status(problem));
        None
    }

    /// Whether it has subscribed to a channel.
    pub(super) fn wants(&self, channel: u32) -> bool {
        self.link.peer().is_some_and(|subscriptions| subscriptions.values().any(|it| *it == channel))
    }

    /// Sends a message of a channel under the id of each of its subscriptions; false if the backlog is too large.
    pub(super) fn send(&mut self, channel: u32, log_ns: u64, data: &[u8]) -> bool {
        if self.link.backlog() > MOST_BACKLOG {
            return false;
        }
        let subscriptions = self.link.peer().into_iter().flatten();
        let ids: Vec<u32> = subscriptions.filter(|(_, it)| **it == channel).map(|(id, _)| *id).collect();
        ids.into_iter().for_each(|id| self.link.write(protocol::message_data(id, log_ns, data)));
        true
    }
}

fn answer(request: &http::Request, access: &Access) -> Reply<BTreeMap<u32, u32>> {
    if let Err(rejection) = access.admit_tool(request) {
        return Reply::Response(reject(rejection));
    }
    match (&request.websocket_key, protocol::common(&request.protocols)) {
        (Some(key), Some(name)) => Reply::Switch { head: http::switch(key, Some(name)), longest: LONGEST_REQUEST, peer: BTreeMap::new() },
        (Some(_), None) => Reply::Response(http::error("400 Bad Request", "the subprotocol is foxglove.sdk.v1 or foxglove.websocket.v1")),
        (None, _) => {
            Reply::Response(http::error("426 Upgrade Required", "this port is for Foxglove and Lichtblick: connect with one of them"))
        }
    }
}
