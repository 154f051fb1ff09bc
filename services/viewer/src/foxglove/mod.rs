//! The port for Foxglove and Lichtblick: the topics of a log, as they are published.
//!
//! It implements Foxglove's WebSocket protocol, version 1, under both of its names. Channels, schemas and bytes are those that
//! `drivelog` writes; the scene is what the page draws over the map. The `foxglove` crate has a server for it that brings an async
//! runtime with threads of its own. A process here is one loop around `poll` that has a WebSocket for the page already, and the part
//! of the protocol that is used has two messages each way.
//!
//! A message is encoded once, if a client has subscribed to it. No client is waited for: messages for a client with a large backlog
//! are dropped and counted.

mod channels;
mod client;
mod feed;
mod port;
mod protocol;
mod scene;

pub use feed::{Feed, Sent};
pub use port::Port;
