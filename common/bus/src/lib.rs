//! The ports of a process on the bus, and the one home of iceoryx2.
//!
//! # Where to start
//!
//! A driver or any other process of a deployment uses the shell of the crate `stillmap-runtime`, which joins the bus and hands out the
//! [`Reader`]s and [`Writer`]s of this crate: `examples/text_driver.rs` is one in 30 lines, and `docs/wire.md` has its rules. Use this
//! crate itself for a process with a run loop of its own ([`Ports`]), or to open a domain for tests ([`Domain`]):
//!
//! ```
//! use messages::{Pose, SonarScan};
//! use stillmap_bus::{Domain, Ports, Received};
//!
//! let domain = Domain::open(&format!("example-bus-{}", std::process::id()), 1.0)?;
//! let mut ports = Ports::join(&domain.membership_for("driver", 0, "settings.toml".as_ref()))?;
//! let (mut scans, mut received) = (ports.writer::<SonarScan>()?, ports.reader::<SonarScan>()?);
//! scans.send(1, 1_000, &SonarScan::new(Pose::default(), &[], false))?;
//! let Some(Received::Message(scan)) = received.take()? else { panic!("a scan waits") };
//! assert_eq!((scan.seq(), scan.stamp_ns()), (1, 1_000));
//! # drop((scan, scans, received, ports));
//! domain.close()?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Domains and ports
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
pub use memory::{needed_memory, shared_memory_is_short};
pub use paths::make_private;
pub use ports::Ports;
pub use raw::{Injection, Raw, Tap};
pub use reader::{Message, Reader};
pub use running::RunningDomain;
pub use stream::Received;
pub use writer::Writer;
