//! One browser, over any stream that does not block.

use std::io::{ErrorKind, Read, Write};
use std::time::{Duration, Instant};

use serde::Deserialize;
use tungstenite::protocol::frame::coding::CloseCode;
use tungstenite::protocol::{CloseFrame, Role, WebSocket, WebSocketConfig};
use tungstenite::{Error, Message};

use crate::access::{Access, Refusal};
use crate::board::{Board, Cursor};
use crate::http::{self, Head, LONGEST_HEAD, Request};
use crate::page;

/// How long a request may take to come.
const REQUEST_DEADLINE: Duration = Duration::from_secs(5);
/// How long a browser may take nothing of what it is sent.
const DEAF_DEADLINE: Duration = Duration::from_secs(10);
/// Longest message from a browser, bytes.
const LONGEST_COMMAND: usize = 1024;
/// More than is ever offered at once, so that only a flush writes.
const WRITE_BUFFER: usize = 8 << 20;
/// Most messages taken from a browser at once.
const MESSAGES_AT_ONCE: usize = 16;
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
    state: State<S>,
    since: Instant,
}

enum State<S: Read + Write> {
    Asking { stream: S, head: Vec<u8> },
    Answering { stream: S, answer: Vec<u8>, written: usize },
    Watching { socket: Box<WebSocket<S>>, cursor: Cursor, deaf_since: Option<Instant> },
    Over,
}

impl<S: Read + Write> Connection<S> {
    /// A connection that has just been made; `stream` does not block.
    pub fn new(stream: S, now: Instant) -> Self {
        Self { state: State::Asking { stream, head: Vec::new() }, since: now }
    }

    /// Whether nothing more is to be done for it.
    #[must_use]
    pub fn is_over(&self) -> bool {
        matches!(self.state, State::Over)
    }

    /// Whether it is sent what is on the board.
    #[must_use]
    pub fn is_watching(&self) -> bool {
        matches!(self.state, State::Watching { .. })
    }

    /// Whether something is on its way that the stream did not take yet.
    #[must_use]
    pub fn is_writing(&self) -> bool {
        matches!(self.state, State::Answering { .. } | State::Watching { deaf_since: Some(_), .. })
    }

    /// The stream, as long as it is open.
    pub fn stream(&self) -> Option<&S> {
        match &self.state {
            State::Asking { stream, .. } | State::Answering { stream, .. } => Some(stream),
            State::Watching { socket, .. } => Some(socket.get_ref()),
            State::Over => None,
        }
    }

    /// Takes what has come and answers it; the commands among it. Whatever is wrong ends this connection and nothing else.
    pub fn advance(&mut self, site: Site<'_>, now: Instant) -> Vec<Command> {
        let mut commands = Vec::new();
        self.state = match std::mem::replace(&mut self.state, State::Over) {
            State::Asking { stream, head } => ask(stream, head, site),
            State::Watching { mut socket, cursor, deaf_since } => match listen(&mut socket, site, &mut commands) {
                true => State::Watching { socket, cursor, deaf_since },
                false => State::Over,
            },
            other => other,
        };
        self.write_answer();
        let asks_too_long = !self.is_watching() && now.saturating_duration_since(self.since) > REQUEST_DEADLINE;
        if asks_too_long {
            self.state = State::Over;
        }
        commands
    }

    /// Sends what the browser lacks, unless it has not taken what it was sent before.
    pub fn offer(&mut self, board: &Board, now: Instant) -> Offer {
        let State::Watching { socket, cursor, deaf_since } = &mut self.state else { return Offer::Absent };
        let mut sent = 0;
        if deaf_since.is_none() {
            for message in board.news(cursor) {
                sent += message.len();
                if socket.write(message).is_err() {
                    self.state = State::Over;
                    return Offer::Absent;
                }
            }
        }
        let was_deaf = deaf_since.is_some();
        match socket.flush() {
            Ok(()) => *deaf_since = None,
            Err(Error::Io(error)) if error.kind() == ErrorKind::WouldBlock => {
                let since = *deaf_since.get_or_insert(now);
                if now.saturating_duration_since(since) > DEAF_DEADLINE {
                    self.state = State::Over;
                    return Offer::Absent;
                }
            }
            Err(_) => {
                self.state = State::Over;
                return Offer::Absent;
            }
        }
        if was_deaf && board.has_news(cursor) { Offer::Missed } else { Offer::Taken(sent) }
    }

    /// Whether it watches and has not been sent everything, or has not taken it.
    pub fn is_behind(&self, board: &Board) -> bool {
        match &self.state {
            State::Watching { cursor, deaf_since, .. } => deaf_since.is_some() || board.has_news(cursor),
            _ => false,
        }
    }

    /// Says that nothing more comes.
    pub fn bid_farewell(&mut self) {
        if let State::Watching { socket, .. } = &mut self.state {
            let frame = CloseFrame { code: CloseCode::Away, reason: "the run has ended".into() };
            // Whoever does not hear it will find the connection closed.
            let _ = socket.close(Some(frame)).and_then(|()| socket.flush());
        }
    }

    fn write_answer(&mut self) {
        let State::Answering { stream, answer, written } = &mut self.state else { return };
        while let Some(rest) = answer.get(*written..).filter(|rest| !rest.is_empty()) {
            match stream.write(rest) {
                Ok(count @ 1..) => *written += count,
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Ok(_) | Err(_) => break,
            }
        }
        self.state = State::Over;
    }
}

/// Reads on in the head of the request, and turns to its answer when it is whole.
fn ask<S: Read + Write>(mut stream: S, mut head: Vec<u8>, site: Site<'_>) -> State<S> {
    let mut bytes = [0; 2048];
    while head.len() < LONGEST_HEAD {
        match stream.read(&mut bytes) {
            Ok(count @ 1..) => head.extend_from_slice(bytes.get(..count).unwrap_or_default()),
            Err(error) if error.kind() == ErrorKind::WouldBlock => break,
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Ok(_) | Err(_) => return State::Over,
        }
    }
    match http::parse(&head) {
        Head::Incomplete => State::Asking { stream, head },
        Head::Refused(why) => refuse(stream, "400 Bad Request", why),
        Head::Complete(request, length) => answer(stream, &request, head.get(length..).unwrap_or_default(), site),
    }
}

fn answer<S: Read + Write>(mut stream: S, request: &Request, rest: &[u8], site: Site<'_>) -> State<S> {
    let is_public = page::is_public(&request.path);
    let admitted = if is_public { site.access.admit_host(request) } else { site.access.admit(request) };
    match admitted {
        Ok(()) => {}
        Err(refusal @ Refusal::Token) => return refuse(stream, "401 Unauthorized", &refusal.to_string()),
        Err(refusal) => return refuse(stream, "403 Forbidden", &refusal.to_string()),
    }
    match (request.path.as_str(), &request.websocket_key) {
        (LIVE, Some(key)) => {
            let switch = http::switch(key);
            // A stream that has carried nothing takes this at once, or is not worth waiting for.
            if !matches!(stream.write(&switch), Ok(written) if written == switch.len()) {
                return State::Over;
            }
            let config = WebSocketConfig::default()
                .read_buffer_size(4 * LONGEST_COMMAND)
                .write_buffer_size(WRITE_BUFFER)
                .max_message_size(Some(LONGEST_COMMAND))
                .max_frame_size(Some(LONGEST_COMMAND));
            let socket = Box::new(WebSocket::from_partially_read(stream, rest.to_vec(), Role::Server, Some(config)));
            State::Watching { socket, cursor: Cursor::default(), deaf_since: None }
        }
        (LIVE, None) => refuse(stream, "426 Upgrade Required", "this address speaks WebSocket only"),
        (path, _) => match page::file(path) {
            Some(file) => State::Answering { stream, answer: http::response("200 OK", file.content_type, file.body), written: 0 },
            None => refuse(stream, "404 Not Found", "there is no such page here: the page is at /"),
        },
    }
}

fn refuse<S: Read + Write>(stream: S, status: &str, why: &str) -> State<S> {
    State::Answering { stream, answer: http::response(status, "text/plain", &format!("{why}\n")), written: 0 }
}

/// Takes what the browser says; false when the connection is over.
fn listen<S: Read + Write>(socket: &mut WebSocket<S>, site: Site<'_>, commands: &mut Vec<Command>) -> bool {
    for _ in 0..MESSAGES_AT_ONCE {
        match socket.read() {
            Ok(Message::Text(text)) => match serde_json::from_str(text.as_str()) {
                Ok(command) if site.obeys => commands.push(command),
                _ => return dismiss(socket, CloseCode::Policy, "this is no command that is obeyed here"),
            },
            Ok(Message::Binary(_)) => return dismiss(socket, CloseCode::Unsupported, "commands are text"),
            Ok(Message::Ping(_) | Message::Pong(_) | Message::Close(_) | Message::Frame(_)) => {}
            Err(Error::Io(error)) if error.kind() == ErrorKind::WouldBlock => return true,
            Err(Error::Capacity(_)) => return dismiss(socket, CloseCode::Size, "a command is short"),
            Err(Error::Utf8(_)) => return dismiss(socket, CloseCode::Invalid, "commands are UTF-8"),
            Err(Error::Protocol(_)) => return dismiss(socket, CloseCode::Protocol, "this is not WebSocket"),
            Err(_) => return false,
        }
    }
    true
}

/// Ends a connection with a word why; false, for it is over.
fn dismiss<S: Read + Write>(socket: &mut WebSocket<S>, code: CloseCode, why: &'static str) -> bool {
    // Whoever cannot be told is dismissed all the same.
    let _ = socket.close(Some(CloseFrame { code, reason: why.into() })).and_then(|()| socket.flush());
    false
}
