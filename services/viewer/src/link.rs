//! One connection over any stream that does not block: a request, then its answer or WebSocket.

use std::io::{ErrorKind, Read, Write};
use std::time::{Duration, Instant};

use tungstenite::protocol::frame::coding::CloseCode;
use tungstenite::protocol::{CloseFrame, Role, WebSocket, WebSocketConfig};
use tungstenite::{Error, Message, Utf8Bytes};

use crate::http::{self, Head, LONGEST_HEAD, Request};

/// How long a request may take to come.
const REQUEST_DEADLINE: Duration = Duration::from_secs(5);
/// How long the other end may take nothing of what it is sent.
const DEAF_DEADLINE: Duration = Duration::from_secs(10);
/// Bytes that are written to the stream without being asked to: more than is ever offered at once, so that only a flush writes.
const WRITE_BUFFER: usize = 32 << 20;
/// Most messages taken at once.
const MESSAGES_AT_ONCE: usize = 16;

/// A connection that speaks WebSocket once its request was answered so; `G` is what is known of who is at the other end.
pub(crate) struct Link<S: Read + Write, G> {
    state: State<S, G>,
    since: Instant,
}

enum State<S: Read + Write, G> {
    Asking { stream: S, head: Vec<u8> },
    Answering { stream: S, answer: Vec<u8>, written: usize },
    Speaking { line: Line<S>, guest: G },
    Over,
}

/// The answer to a request.
pub(crate) enum Reply<G> {
    /// These bytes, and the connection closes behind them.
    Answer(Vec<u8>),
    /// WebSocket.
    Switch {
        /// The head that says so.
        head: Vec<u8>,
        /// Longest message that is taken, bytes.
        longest: usize,
        /// Who speaks from now on.
        guest: G,
    },
}

/// What came of bringing bytes to the stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Flushed {
    /// It has taken everything.
    Everything,
    /// It has not.
    Waits,
    /// It is closed, or was deaf for too long.
    Gone,
}

/// A WebSocket and what waits to be taken at its other end.
struct Line<S: Read + Write> {
    socket: Box<WebSocket<S>>,
    /// Bytes sent since the other end last had everything.
    backlog: usize,
    deaf_since: Option<Instant>,
}

impl<S: Read + Write, G> Link<S, G> {
    /// A connection that has just been made; `stream` does not block.
    pub(crate) fn new(stream: S, now: Instant) -> Self {
        Self { state: State::Asking { stream, head: Vec::new() }, since: now }
    }

    /// Whether nothing more is to be done for it.
    pub(crate) fn is_over(&self) -> bool {
        matches!(self.state, State::Over)
    }

    /// Who is at the other end, once it speaks WebSocket.
    pub(crate) fn guest(&self) -> Option<&G> {
        match &self.state {
            State::Speaking { guest, .. } => Some(guest),
            _ => None,
        }
    }

    /// Who is at the other end, once it speaks WebSocket.
    pub(crate) fn guest_mut(&mut self) -> Option<&mut G> {
        match &mut self.state {
            State::Speaking { guest, .. } => Some(guest),
            _ => None,
        }
    }

    /// Bytes sent since the other end last had everything.
    pub(crate) fn backlog(&self) -> usize {
        match &self.state {
            State::Speaking { line, .. } => line.backlog,
            _ => 0,
        }
    }

    /// Whether something is on its way that the stream did not take yet.
    pub(crate) fn is_writing(&self) -> bool {
        matches!(self.state, State::Answering { .. }) || self.is_deaf()
    }

    /// Whether the other end has not taken what it was sent when it was last tried.
    pub(crate) fn is_deaf(&self) -> bool {
        matches!(&self.state, State::Speaking { line, .. } if line.deaf_since.is_some())
    }

    /// The stream, as long as it is open.
    pub(crate) fn stream(&self) -> Option<&S> {
        match &self.state {
            State::Asking { stream, .. } | State::Answering { stream, .. } => Some(stream),
            State::Speaking { line, .. } => Some(line.socket.get_ref()),
            State::Over => None,
        }
    }

    /// Takes what has come: a request, which `reply` answers, and then messages, which are returned. Whatever is wrong ends this
    /// connection and nothing else.
    pub(crate) fn advance(&mut self, now: Instant, reply: impl FnOnce(&Request) -> Reply<G>) -> Vec<Utf8Bytes> {
        let mut texts = Vec::new();
        self.state = match std::mem::replace(&mut self.state, State::Over) {
            State::Asking { stream, head } => ask(stream, head, reply),
            State::Speaking { mut line, guest } => match listen(&mut line.socket, &mut texts) {
                true => State::Speaking { line, guest },
                false => State::Over,
            },
            other => other,
        };
        self.write_answer();
        let asks_too_long = self.guest().is_none() && now.saturating_duration_since(self.since) > REQUEST_DEADLINE;
        if asks_too_long {
            self.state = State::Over;
        }
        texts
    }

    /// Adds a message to what the other end is sent with the next [`flush`](Self::flush).
    pub(crate) fn write(&mut self, message: Message) {
        let State::Speaking { line, .. } = &mut self.state else { return };
        line.backlog += message.len();
        match line.socket.write(message) {
            Ok(()) => {}
            // More than the buffer holds is on its way, and the stream takes no more for now.
            Err(Error::Io(error)) if error.kind() == ErrorKind::WouldBlock => {}
            Err(_) => self.state = State::Over,
        }
    }

    /// Brings what was written to the stream, as far as it takes it.
    pub(crate) fn flush(&mut self, now: Instant) -> Flushed {
        let State::Speaking { line, .. } = &mut self.state else { return Flushed::Gone };
        match line.socket.flush() {
            Ok(()) => {
                (line.backlog, line.deaf_since) = (0, None);
                return Flushed::Everything;
            }
            Err(Error::Io(error)) if error.kind() == ErrorKind::WouldBlock => {
                let since = *line.deaf_since.get_or_insert(now);
                if now.saturating_duration_since(since) <= DEAF_DEADLINE {
                    return Flushed::Waits;
                }
            }
            Err(_) => {}
        }
        self.state = State::Over;
        Flushed::Gone
    }

    /// Ends the connection with a word why.
    pub(crate) fn dismiss(&mut self, code: CloseCode, why: &'static str) {
        if let State::Speaking { line, .. } = &mut self.state {
            dismiss(&mut line.socket, code, why);
        }
        self.state = State::Over;
    }

    /// Says that nothing more comes.
    pub(crate) fn bid_farewell(&mut self) {
        self.dismiss(CloseCode::Away, "the run has ended");
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
fn ask<S: Read + Write, G>(mut stream: S, mut head: Vec<u8>, reply: impl FnOnce(&Request) -> Reply<G>) -> State<S, G> {
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
        Head::Refused(why) => State::Answering { stream, answer: http::refusal("400 Bad Request", why), written: 0 },
        Head::Complete(request, length) => match reply(&request) {
            Reply::Answer(answer) => State::Answering { stream, answer, written: 0 },
            Reply::Switch { head: switch, longest, guest } => {
                // A stream that has carried nothing takes this at once, or is not worth waiting for.
                if !matches!(stream.write(&switch), Ok(written) if written == switch.len()) {
                    return State::Over;
                }
                let config = WebSocketConfig::default()
                    .read_buffer_size(4 * longest)
                    .write_buffer_size(WRITE_BUFFER)
                    .max_message_size(Some(longest))
                    .max_frame_size(Some(longest));
                let rest = head.get(length..).unwrap_or_default().to_vec();
                let socket = Box::new(WebSocket::from_partially_read(stream, rest, Role::Server, Some(config)));
                State::Speaking { line: Line { socket, backlog: 0, deaf_since: None }, guest }
            }
        },
    }
}

/// Takes the texts that have come; false when the connection is over.
fn listen<S: Read + Write>(socket: &mut WebSocket<S>, texts: &mut Vec<Utf8Bytes>) -> bool {
    for _ in 0..MESSAGES_AT_ONCE {
        match socket.read() {
            Ok(Message::Text(text)) => texts.push(text),
            Ok(Message::Binary(_)) => return dismiss(socket, CloseCode::Unsupported, "what is asked here is text"),
            Ok(Message::Ping(_) | Message::Pong(_) | Message::Close(_) | Message::Frame(_)) => {}
            Err(Error::Io(error)) if error.kind() == ErrorKind::WouldBlock => return true,
            Err(Error::Capacity(_)) => return dismiss(socket, CloseCode::Size, "what is asked here is short"),
            Err(Error::Utf8(_)) => return dismiss(socket, CloseCode::Invalid, "what is asked here is UTF-8"),
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
