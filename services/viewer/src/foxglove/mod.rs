//! The port that Foxglove and Lichtblick connect to: what a log holds, as it happens.
//!
//! Spoken is Foxglove's WebSocket protocol, version 1, under both of its names; channels, schemas and bytes are those that
//! `drivelog` writes, and the scene is what the page draws over the map. The `foxglove` library has a server for it, on an async runtime with threads of its own; a process here is
//! one loop around `poll`, which has a WebSocket for the page already, and the protocol is two messages each way.
//!
//! A message is encoded when somebody has subscribed to it, once for everybody. Whoever takes nothing is not waited for: what
//! comes while much is still on its way to him is dropped, and counted.

mod channels;
mod client;
mod feed;
mod port;
mod protocol;
mod scene;

pub use feed::{Feed, Sent};
pub use port::Port;
