//! A recorded log in place of the drivers.
//!
//! The messages of the drivers are published again, with the numbers and stamps of the log. *Live*, a message is due when the
//! deployment's clock has advanced as far since the start as the log had ([`Schedule`]). In *lockstep* it is due as soon as no consumer
//! is farther behind than a window ([`Window`]), so that nothing is dropped and a replay takes as long as the slowest process.
//! [`Answers`] are the reports of the consumers, [`Resume`] is what a restarted playback resumes from. Each stream has its own window;
//! the messages are sent in the order of sensor time ([`turn()`]).
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

mod answers;
mod resume;
mod schedule;
mod turn;
mod window;

pub use answers::{Answers, Behind, Consumer};
pub use resume::{Resume, STREAMS, Stream};
pub use schedule::Schedule;
pub use turn::{Head, Turn, turn};
pub use window::Window;
