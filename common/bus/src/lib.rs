//! The ports of a process on the bus, and the one home of iceoryx2.
//!
//! A deployment lives in a [`Domain`] of its own: a folder, a prefix in shared memory and a lock. The supervisor opens it,
//! creates every service and holds them; processes only ever open what exists. A process joins with its [`Membership`] and opens
//! [`Ports`]: inputs ([`Reader`], for pictures [`FrameReader`]) and outputs ([`Writer`], [`FrameWriter`]). Waiting is a `poll` on
//! file descriptors: no busy polling, no sleeping. The run loop around them is in the crate `runtime`.
//!
//! Modes of failure that this crate answers for: lost, repeated and damaged messages are counted where they are read; a
//! process that dies leaves nothing that stops the next.

mod clock;
mod connections;
mod descriptors;
mod domain;
mod episode;
mod error;
mod fabric;
mod frame_reader;
mod frame_writer;
mod latency;
mod locks;
mod membership;
mod memory;
mod outlet;
mod paths;
mod ports;
mod raw;
mod reader;
mod running;
mod slot;
mod stream;
mod wait;
mod writer;

pub use clock::DeploymentClock;
pub use descriptors::needed_descriptors;
pub use domain::{Claim, Domain, Run, sweep};
pub use episode::Episode;
pub use error::{BusError, DomainError, EXIT_BROKEN_DOMAIN};
pub use frame_reader::{Frame, FrameReader, RefusedFrame};
pub use frame_writer::FrameWriter;
pub use membership::{Membership, MembershipError};
pub use memory::shared_memory_is_short;
pub use paths::make_private;
pub use ports::Ports;
pub use raw::{Injection, Raw, Tap};
pub use reader::{Message, Reader};
pub use running::RunningDomain;
pub use stream::Received;
pub use writer::Writer;
