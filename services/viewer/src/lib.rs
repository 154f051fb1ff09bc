//! A page that shows a running deployment in a browser.
//!
//! The viewer keeps the newest state of the deployment on a [`Board`]: the map by tiles, the robot with its sonar cones and the
//! walkers, the processes. Every browser receives what changed since its last update, twenty times a second, over one WebSocket.
//! Updates that a browser is too slow for are superseded on the board and never queued, so that a stalled browser costs a few bytes.
//! The page is part of the command: there is no build step, and nothing is loaded from other servers.
//!
//! A second port serves Foxglove and Lichtblick, which subscribe to the topics of a log as they are published.
//!
//! - Core: [`Board`], [`Scene`], the [`http`] requests and the [`access`] rules, one [`Connection`] over any stream, and
//!   the [`Feed`](foxglove::Feed) of the subscribers.
//! - Sockets: [`Server`] and [`Port`](foxglove::Port), which never block. The process that owns them and the bus are in the
//!   `stillmap` command.
//!
//! At a loopback address the page is served to pages of this computer only: `Host` and `Origin` are checked, so that no page of
//! another site can read it. At any other address the page requires the token.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

pub mod access;
mod board;
mod camera;
mod connection;
mod deployment;
pub mod foxglove;
pub mod http;
mod link;
mod listener;
mod metrics;
mod page;
mod scene;
mod server;
mod status;

pub use board::{Board, Cursor, Topic};
pub use connection::{Command, Connection, Offer, Site};
pub use deployment::Deployment;
pub use listener::{Listener, RETRY as LISTEN_RETRY};
pub use metrics::metrics;
pub use scene::{CameraView, Region, Replay, Scene, SceneView, SonarCone, WalkerView};
pub use server::{Served, Server};
