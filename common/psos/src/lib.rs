//! The Pioneer serial protocol (PSOS and P2OS): framing, commands, status packets, robot models. No I/O: bytes in, values out,
//! for both ends of the line.
//!
//! | part | holds |
//! | --- | --- |
//! | [`Deframer`], [`encode_frame`] | packets in a stream of bytes |
//! | [`Command`] | what a client tells the robot |
//! | [`Sip`] | what an open robot says ten times a second |
//! | [`Identity`] | who the robot is |
//! | [`Model`] | its factors, sonar ring and dimensions |
//!
//! A *frame* here is a packet whose checksum agrees. Its first data byte is a command's number or a packet's type.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

mod command;
mod frame;
mod identity;
mod model;
mod robots;
mod sip;

pub use command::{Argument, Command, CommandError, number};
pub use frame::{Deframer, Frame, FrameError, HEADER, LinkCounters, MAX_DATA, checksum, encode_frame};
pub use identity::{Identity, IdentityError};
pub use model::{Model, Mount, System};
pub use robots::MODELS;
pub use sip::{MOVING, RawReading, STOPPED, Sip, SipError};
