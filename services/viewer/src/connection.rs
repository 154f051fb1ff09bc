//! The connection of one browser: it receives the page, and then what is on the board.

use std::io::{Read, Write};
use std::time::Instant;

use serde::Deserialize;
use tungstenite::protocol::frame::coding::CloseCode;

use crate::access::{Access, Rejection};
use crate::board::{Board, Cursor};
use crate::http::{self, Request};
use crate::link::{Flushed, Link, Reply};
use crate::metrics;
use crate::page;

/// Longest message from a browser, bytes.
const LONGEST_COMMAND: usize = 1024;
/// Path of the page's data.
const LIVE: &str = "/live";
/// Path of the metrics for Prometheus.
const METRICS: &str = "/metrics";

/// A command for the replay.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Command {
    /// To pause.
    pub paused: bool,
    /// Speed relative to the drive.
    pub times: f64,
}

/// The page that a connection serves.
#[derive(Clone, Copy)]
pub struct Site<'a> {
    /// Which requests are admitted.
    pub access: &'a Access,
    /// Whether there is a replay to command.
    pub accepts_commands: bool,
    /// The newest state of the processes as metrics; `None` before the first.
    pub metrics: Option<&'a str>,
}

/// The result of an offer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Offer {
    /// The browser was sent so many bytes; 0 if it has received everything.
    Sent(usize),
    /// The browser is stalled and misses this update.
    Missed,
    /// The connection is no browser that shows the page.
    NotWatching,
}

/// One connection to the page.
pub struct Connection<S: Read + Write> {
    link: Link<S, Cursor>,
}

impl<S: Read + Write> Connection<S> {
    /// A new connection over a non-blocking stream.
    pub fn new(stream: S, now: Instant) -> Self {
        Self { link: Link::new(stream, now) }
    }

    /// Whether the connection is closed.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.link.is_closed()
    }

    /// Whether it is a browser that shows the page.
    #[must_use]
    pub fn is_watching(&self) -> bool {
        self.link.peer().is_some()
    }

    /// Whether something is still to be written to the stream.
    #[must_use]
    pub fn is_writing(&self) -> bool {
        self.link.is_writing()
    }

    /// The stream, while it is open.
    pub fn stream(&self) -> Option<&S> {
        self.link.stream()
    }

    /// Reads and answers what has arrived; returns the commands. Invalid input closes this connection and affects no other.
    pub fn advance(&mut self, site: Site<'_>, now: Instant) -> Vec<Command> {
        let mut commands = Vec::new();
        for text in self.link.advance(now, |request| answer(request, site)) {
            match serde_json::from_str(text.as_str()) {
                Ok(command) if site.accepts_commands => commands.push(command),
                _ => {
                    self.link.close(CloseCode::Policy, "this is not a valid command");
                    break;
                }
            }
        }
        commands
    }

    /// Sends what the browser has not received, unless it is stalled.
    pub fn offer(&mut self, board: &Board, now: Instant) -> Offer {
        let was_stalled = self.link.is_stalled();
        let updates = match self.link.peer_mut() {
            Some(cursor) if !was_stalled => board.updates(cursor),
            _ => Vec::new(),
        };
        let sent = updates.iter().map(tungstenite::Message::len).sum();
        updates.into_iter().for_each(|message| self.link.write(message));
        match (self.link.flush(now), self.link.peer()) {
            (Flushed::Closed, _) | (_, None) => Offer::NotWatching,
            (_, Some(cursor)) if was_stalled && board.has_updates(cursor) => Offer::Missed,
            _ => Offer::Sent(sent),
        }
    }

    /// Whether it is a browser that has not received everything.
    pub fn is_behind(&self, board: &Board) -> bool {
        self.link.peer().is_some_and(|cursor| self.link.is_stalled() || board.has_updates(cursor))
    }

    /// Closes the connection because the run has ended.
    pub fn close(&mut self) {
        self.link.close_at_end();
    }
}

fn answer(request: &Request, site: Site<'_>) -> Reply<Cursor> {
    let is_public = page::is_public(&request.path);
    let admission = if is_public { site.access.admit_host(request) } else { site.access.admit(request) };
    if let Err(rejection) = admission {
        return Reply::Response(reject(rejection));
    }
    Reply::Response(match (request.path.as_str(), &request.websocket_key) {
        (LIVE, Some(key)) => {
            return Reply::Switch { head: http::switch(key, None), longest: LONGEST_COMMAND, peer: Cursor::default() };
        }
        (LIVE, None) => http::error("426 Upgrade Required", "this path is for WebSocket only"),
        (METRICS, _) => match site.metrics {
            Some(metrics) => http::response("200 OK", metrics::CONTENT_TYPE, metrics),
            None => http::error("503 Service Unavailable", "no status of the supervisor has been received"),
        },
        (path, _) => match page::file(path) {
            Some(file) => http::response("200 OK", file.content_type, file.body),
            None => http::error("404 Not Found", "not found: the page is at /"),
        },
    })
}

/// The response to a request that is not admitted.
pub(crate) fn reject(rejection: Rejection) -> Vec<u8> {
    let status = if rejection == Rejection::Token { "401 Unauthorized" } else { "403 Forbidden" };
    http::error(status, &rejection.to_string())
}
