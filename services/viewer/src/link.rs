//! One connection over any non-blocking stream: a request, then a response or a WebSocket.

use std::io::{ErrorKind, Read, Write};
use std::time::{Duration, Instant};

use tungstenite::protocol::frame::coding::CloseCode;
use tungstenite::protocol::{CloseFrame, Role, WebSocket, WebSocketConfig};
use tungstenite::{Error, Message, Utf8Bytes};

use crate::http::{self, Head, LONGEST_HEAD, Request};

/// Longest time until a request is complete.
const REQUEST_DEADLINE: Duration = Duration::from_secs(5);
/// Longest time in which the peer may take nothing of what it is sent.
const STALL_DEADLINE: Duration = Duration::from_secs(10);
/// Size of the write buffer: larger than any update, so that only a flush writes to the stream.
const WRITE_BUFFER: usize = 32 << 20;
/// Most messages read in one step.
const MESSAGES_AT_ONCE: usize = 16;

/// A connection that becomes a WebSocket if its request is answered so. `P` is what is known of the peer.
pub(crate) struct Link<S: Read + Write, P> {
    state: State<S, P>,
    since: Instant,
}

enum State<S: Read + Write, P> {
    /// Reading the request.
    Request {
        stream: S,
        head: Vec<u8>,
    },
    /// Writing the response.
    Response {
        stream: S,
        response: Vec<u8>,
        written: usize,
    },
    /// A WebSocket.
    Open {
        socket: Socket<S>,
        peer: P,
    },
    Closed,
}

/// The reply to a request.
pub(crate) enum Reply<P> {
    /// A response, after which the connection is closed.
    Response(Vec<u8>),
    /// A switch to WebSocket.
    Switch {
        /// The head of the response.
        head: Vec<u8>,
        /// Longest message that is accepted, bytes.
        longest: usize,
        /// The peer from now on.
        peer: P,
    },
}

/// The result of a flush.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Flushed {
    /// The stream has taken everything.
    Complete,
    /// Something is still to be written.
    Pending,
    /// The connection is closed.
    Closed,
}

/// A WebSocket with what its peer has not taken.
struct Socket<S: Read + Write> {
    socket: Box<WebSocket<S>>,
    /// Bytes written since the stream last had taken everything.
    backlog: usize,
    stalled_since: Option<Instant>,
}

impl<S: Read + Write, P> Link<S, P> {
    /// A new connection over a non-blocking stream.
    pub(crate) fn new(stream: S, now: Instant) -> Self {
        Self { state: State::Request { stream, head: Vec::new() }, since: now }
    }

    /// Whether the connection is closed.
    pub(crate) fn is_closed(&self) -> bool {
        matches!(self.state, State::Closed)
    }

    /// The peer, once the connection is a WebSocket.
    pub(crate) fn peer(&self) -> Option<&P> {
        match &self.state {
            State::Open { peer, .. } => Some(peer),
            _ => None,
        }
    }

    /// The peer, once the connection is a WebSocket.
    pub(crate) fn peer_mut(&mut self) -> Option<&mut P> {
        match &mut self.state {
            State::Open { peer, .. } => Some(peer),
            _ => None,
        }
    }

    /// Bytes written since the stream last had taken everything.
    pub(crate) fn backlog(&self) -> usize {
        match &self.state {
            State::Open { socket, .. } => socket.backlog,
            _ => 0,
        }
    }

    /// Whether something is still to be written to the stream.
    pub(crate) fn is_writing(&self) -> bool {
        matches!(self.state, State::Response { .. }) || self.is_stalled()
    }

    /// Whether the last flush could not write everything.
    pub(crate) fn is_stalled(&self) -> bool {
        matches!(&self.state, State::Open { socket, .. } if socket.stalled_since.is_some())
    }

    /// The stream, while it is open.
    pub(crate) fn stream(&self) -> Option<&S> {
        match &self.state {
            State::Request { stream, .. } | State::Response { stream, .. } => Some(stream),
            State::Open { socket, .. } => Some(socket.socket.get_ref()),
            State::Closed => None,
        }
    }

    /// Reads what has arrived: a request, which `reply` answers, and then messages, which are returned. Invalid input closes this
    /// connection and affects no other.
    pub(crate) fn advance(&mut self, now: Instant, reply: impl FnOnce(&Request) -> Reply<P>) -> Vec<Utf8Bytes> {
        let mut texts = Vec::new();
        self.state = match std::mem::replace(&mut self.state, State::Closed) {
            State::Request { stream, head } => read_request(stream, head, reply),
            State::Open { mut socket, peer } => match read_messages(&mut socket.socket, &mut texts) {
                true => State::Open { socket, peer },
                false => State::Closed,
            },
            other => other,
        };
        self.write_response();
        let is_late = self.peer().is_none() && now.saturating_duration_since(self.since) > REQUEST_DEADLINE;
        if is_late {
            self.state = State::Closed;
        }
        texts
    }

    /// Queues a message for the next [`flush`](Self::flush).
    pub(crate) fn write(&mut self, message: Message) {
        let State::Open { socket, .. } = &mut self.state else { return };
        socket.backlog += message.len();
        match socket.socket.write(message) {
            Ok(()) => {}
            // The buffer is full, and the stream takes nothing now.
            Err(Error::Io(error)) if error.kind() == ErrorKind::WouldBlock => {}
            Err(_) => self.state = State::Closed,
        }
    }

    /// Writes what is queued to the stream, as far as the stream takes it.
    pub(crate) fn flush(&mut self, now: Instant) -> Flushed {
        let State::Open { socket, .. } = &mut self.state else { return Flushed::Closed };
        match socket.socket.flush() {
            Ok(()) => {
                (socket.backlog, socket.stalled_since) = (0, None);
                return Flushed::Complete;
            }
            Err(Error::Io(error)) if error.kind() == ErrorKind::WouldBlock => {
                let since = *socket.stalled_since.get_or_insert(now);
                if now.saturating_duration_since(since) <= STALL_DEADLINE {
                    return Flushed::Pending;
                }
            }
            Err(_) => {}
        }
        self.state = State::Closed;
        Flushed::Closed
    }

    /// Closes the connection with a code and a reason.
    pub(crate) fn close(&mut self, code: CloseCode, reason: &'static str) {
        if let State::Open { socket, .. } = &mut self.state {
            close(&mut socket.socket, code, reason);
        }
        self.state = State::Closed;
    }

    /// Closes the connection because the run has ended.
    pub(crate) fn close_at_end(&mut self) {
        self.close(CloseCode::Away, "the run has ended");
    }

    fn write_response(&mut self) {
        let State::Response { stream, response, written } = &mut self.state else { return };
        while let Some(rest) = response.get(*written..).filter(|rest| !rest.is_empty()) {
            match stream.write(rest) {
                Ok(count @ 1..) => *written += count,
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Ok(_) | Err(_) => break,
            }
        }
        self.state = State::Closed;
    }
}

/// Reads more of the head of the request, and replies when it is complete.
fn read_request<S: Read + Write, P>(mut stream: S, mut head: Vec<u8>, reply: impl FnOnce(&Request) -> Reply<P>) -> State<S, P> {
    let mut bytes = [0; 2048];
    while head.len() < LONGEST_HEAD {
        match stream.read(&mut bytes) {
            Ok(count @ 1..) => head.extend_from_slice(bytes.get(..count).unwrap_or_default()),
            Err(error) if error.kind() == ErrorKind::WouldBlock => break,
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Ok(_) | Err(_) => return State::Closed,
        }
    }
    match http::parse(&head) {
        Head::Incomplete => State::Request { stream, head },
        Head::Invalid(reason) => State::Response { stream, response: http::error("400 Bad Request", reason), written: 0 },
        Head::Complete(request, length) => match reply(&request) {
            Reply::Response(response) => State::Response { stream, response, written: 0 },
            Reply::Switch { head: switch, longest, peer } => {
                // The send buffer of a new connection has room for this.
                if !matches!(stream.write(&switch), Ok(written) if written == switch.len()) {
                    return State::Closed;
                }
                let config = WebSocketConfig::default()
                    .read_buffer_size(4 * longest)
                    .write_buffer_size(WRITE_BUFFER)
                    .max_message_size(Some(longest))
                    .max_frame_size(Some(longest));
                let rest = head.get(length..).unwrap_or_default().to_vec();
                let socket = Box::new(WebSocket::from_partially_read(stream, rest, Role::Server, Some(config)));
                State::Open { socket: Socket { socket, backlog: 0, stalled_since: None }, peer }
            }
        },
    }
}

/// Reads the texts that have arrived; false when the connection is closed.
fn read_messages<S: Read + Write>(socket: &mut WebSocket<S>, texts: &mut Vec<Utf8Bytes>) -> bool {
    for _ in 0..MESSAGES_AT_ONCE {
        match socket.read() {
            Ok(Message::Text(text)) => texts.push(text),
            Ok(Message::Binary(_)) => return close(socket, CloseCode::Unsupported, "requests are text messages"),
            Ok(Message::Ping(_) | Message::Pong(_) | Message::Close(_) | Message::Frame(_)) => {}
            Err(Error::Io(error)) if error.kind() == ErrorKind::WouldBlock => return true,
            Err(Error::Capacity(_)) => return close(socket, CloseCode::Size, "this request is too long"),
            Err(Error::Utf8(_)) => return close(socket, CloseCode::Invalid, "requests are UTF-8"),
            Err(Error::Protocol(_)) => return close(socket, CloseCode::Protocol, "this violates the WebSocket protocol"),
            Err(_) => return false,
        }
    }
    true
}

/// Closes a WebSocket with a code and a reason. Returns false: the connection is closed.
fn close<S: Read + Write>(socket: &mut WebSocket<S>, code: CloseCode, reason: &'static str) -> bool {
    // The connection is closed even if the peer cannot be told the reason.
    let _ = socket.close(Some(CloseFrame { code, reason: reason.into() })).and_then(|()| socket.flush());
    false
}
