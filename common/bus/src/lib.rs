//! The shell of every stillmap process, and the one home of iceoryx2.
//!
//! A deployment lives in a [`Domain`] of its own: a folder, a prefix in shared memory and a lock. The supervisor opens it,
//! creates every service and holds them; processes only ever open what exists. A process joins with a [`Shell`], declares
//! its inputs ([`Reader`], for pictures [`FrameReader`]) and outputs ([`Writer`], [`FrameWriter`]) and hands over a [`Process`], whose `step` the shell calls whenever
//! something is there to be done. Waiting is a `poll` on file descriptors: no busy polling, no sleeping.
//!
//! Modes of failure that this crate answers for: lost, repeated and damaged messages are counted where they are read; a
//! process that dies leaves nothing that stops the next; a hung work loop sends no heartbeat, since no other thread does.

mod broken;
mod checkpoint;
mod clock;
mod domain;
mod fabric;
mod frame_reader;
mod frame_writer;
mod journal;
mod latency;
mod membership;
mod memory;
mod outlet;
mod paths;
mod raw;
mod reader;
mod recent;
mod shell;
mod signals;
mod slot;
mod state;
mod stream;
mod tool;
mod writer;

pub use broken::{BusError, EXIT_BROKEN_DOMAIN};
pub use checkpoint::{Checkpoint, Parts, Saved};
pub use clock::DeploymentClock;
pub use domain::{Domain, DomainError, RunningDomain, sweep};
pub use frame_reader::{Frame, FrameReader, RefusedFrame};
pub use frame_writer::FrameWriter;
pub use journal::PartKey;
pub use membership::{Membership, MembershipError};
pub use memory::shared_memory_is_short;
pub use raw::{Injection, Raw, Tap};
pub use reader::{Message, Reader};
pub use recent::Recent;
pub use shell::{Context, Next, Process, RunError, Shell, StepError};
pub use signals::Signals;
pub use state::Kept;
pub use stream::Received;
pub use tool::Tool;
pub use writer::Writer;
