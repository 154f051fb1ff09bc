//! One browser: it is shown the page, and then what is on the board.

use std::io::{Read, Write};
use std::time::Instant;

use serde::Deserialize;
use tungstenite::protocol::frame::coding::CloseCode;

use crate::access::{Access, Refusal};
use crate::board::{Board, Cursor};
use crate::http::{self, Request};
use crate::link::{Flushed, Link, Reply};
use crate::page;

/// Longest message from a browser, bytes.
const LONGEST_COMMAND: usize = 1024;
/// Where the page asks for its data.
const LIVE: &str = "/live";

/// What a browser asks of a replay.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Command {
    /// To stand still.
    pub paused: bool,
    /// Times the drive's own pace.
    pub times: f64,
}

/// What a connection needs to know of the page it serves.
#[derive(Clone, Copy)]
pub struct Site<'a> {
    /// Who may look.
    pub access: &'a Access,
    /// Whether there is a replay that obeys commands.
    pub obeys: bool,
}

/// What came of an offer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Offer {
    /// It watches and was sent so many bytes; 0 when it has everything.
    Taken(usize),
    /// It watches, has not taken what it was sent before, and misses this.
    Missed,
    /// It does not watch.
    Absent,
}

/// One connection to the page.
pub struct Connection<S: Read + Write> {
    link: Link<S, Cursor>,
}

impl<S: Read + Write> Connection<S> {
    /// A connection that has just been made; `stream` does not block.
    pub fn new(stream: S, now: Instant) -> Self {
        Self { link: Link::new(stream, now) }
    }

    /// Whether nothing more is to be done for it.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.link.is_over()
    }

    /// Whether it is sent what is on the board.
    #[must_use]
    pub fn is_watching(&self) -> bool {
        self.link.guest().is_some()
    }

    /// Whether something is on its way that the stream did not take yet.
    #[must_use]
    pub fn is_writing(&self) -> bool {
        self.link.is_writing()
    }

    /// The stream, as long as it is open.
    pub fn stream(&self) -> Option<&S> {
        self.link.stream()
    }

    /// Takes what has come and answers it; the commands among it. Whatever is wrong ends this connection and nothing else.
    pub fn advance(&mut self, site: Site<'_>, now: Instant) -> Vec<Command> {
        let mut commands = Vec::new();
        for text in self.link.advance(now, |request| answer(request, site)) {
            match serde_json::from_str(text.as_str()) {
                Ok(command) if site.obeys => commands.push(command),
                _ => {
                    self.link.dismiss(CloseCode::Policy, "this is no command that is obeyed here");
                    break;
                }
            }
        }
        commands
    }

    /// Sends what the browser lacks, unless it has not taken what it was sent before.
    pub fn offer(&mut self, board: &Board, now: Instant) -> Offer {
        let was_deaf = self.link.is_deaf();
        let news = match self.link.guest_mut() {
            Some(cursor) if !was_deaf => board.news(cursor),
            _ => Vec::new(),
        };
        let sent = news.iter().map(tungstenite::Message::len).sum();
        news.into_iter().for_each(|message| self.link.write(message));
        match (self.link.flush(now), self.link.guest()) {
            (Flushed::Gone, _) | (_, None) => Offer::Absent,
            (_, Some(cursor)) if was_deaf && board.has_news(cursor) => Offer::Missed,
            _ => Offer::Taken(sent),
        }
    }

    /// Whether it watches and has not been sent everything, or has not taken it.
    pub fn is_behind(&self, board: &Board) -> bool {
        self.link.guest().is_some_and(|cursor| self.link.is_deaf() || board.has_news(cursor))
    }

    /// Says that nothing more comes.
    pub fn bid_farewell(&mut self) {
        self.link.bid_farewell();
    }
}

fn answer(request: &Request, site: Site<'_>) -> Reply<Cursor> {
    let is_public = page::is_public(&request.path);
    let admitted = if is_public { site.access.admit_host(request) } else { site.access.admit(request) };
    if let Err(refusal) = admitted {
        return Reply::Answer(refuse(refusal));
    }
    Reply::Answer(match (request.path.as_str(), &request.websocket_key) {
        (LIVE, Some(key)) => {
            return Reply::Switch { head: http::switch(key, None), longest: LONGEST_COMMAND, guest: Cursor::default() };
        }
        (LIVE, None) => http::refusal("426 Upgrade Required", "this address speaks WebSocket only"),
        (path, _) => match page::file(path) {
            Some(file) => http::response("200 OK", file.content_type, file.body),
            None => http::refusal("404 Not Found", "there is no such page here: the page is at /"),
        },
    })
}

/// The answer to who may not look.
pub(crate) fn refuse(refusal: Refusal) -> Vec<u8> {
    let status = if refusal == Refusal::Token { "401 Unauthorized" } else { "403 Forbidden" };
    http::refusal(status, &refusal.to_string())
}
