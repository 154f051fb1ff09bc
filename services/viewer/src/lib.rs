//! A page that shows a running deployment in a browser.
//!
//! The viewer reads what is on the bus and keeps the newest of it on a [`Board`]: the map by tiles, the robot with its sonar
//! cones and what moves, the processes. Whoever opens the page is sent what he has not been sent yet, twenty times a second,
//! over one WebSocket; what he is too slow for is superseded on the board and never queued, so that a browser that hangs costs
//! a few bytes of bookkeeping. The page itself is part of the command: no build step, nothing from other servers.
//!
//! Beside the page is a port for Foxglove and Lichtblick, which subscribe to what a log of the drive holds, as it happens.
//!
//! - Core: [`Board`], [`Scene`], [`Status`], the [`http`] heads and who may look ([`access`]), one [`Connection`] over any stream,
//!   and the [`Feed`](foxglove::Feed) of those who subscribe.
//! - Sockets: [`Server`] and [`Port`](foxglove::Port), which never block. The process that owns them, and the bus, are in the
//!   `stillmap` command.
//!
//! A page at an address of this computer is served to this computer's own pages only (`Host` and `Origin` are checked, so that
//! no other site's page can read it); one at another address asks for the token.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

pub mod access;
mod board;
pub mod camera;
mod connection;
mod deployment;
pub mod foxglove;
pub mod http;
mod link;
mod listener;
mod page;
mod scene;
mod server;
mod status;

pub use board::{Board, Cursor, Topic};
pub use connection::{Command, Connection, Offer, Site};
pub use deployment::Deployment;
pub use listener::{Listener, RETRY as LISTEN_RETRY};
pub use scene::{Beam, CameraView, Moving, Region, Replay, Scene, SceneView};
pub use server::{Served, Server};
pub use status::Status;
