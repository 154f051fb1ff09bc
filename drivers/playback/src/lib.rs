//! A recorded log in place of the drivers.
//!
//! What the drivers published is published again, with the numbers and stamps of the log. *Live*, each message comes when the
//! deployment's clock has gone as far since the start as the log had; in *lockstep*, as soon as no consumer is further behind
//! than a window ([`Window`]), so that nothing is dropped and a replay takes as long as the slowest process. What the
//! consumers say of themselves is kept in [`Answers`], what a restarted playback goes on from in [`Resume`]. Scans and pictures
//! are streams of their own, each with its window; their messages come in the order of sensor time ([`turn()`]).
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

mod answers;
mod resume;
mod schedule;
mod turn;
mod window;

pub use answers::{Answers, Consumer};
pub use resume::{Resume, STREAMS, Stream};
pub use schedule::Schedule;
pub use turn::{Head, Turn, turn};
pub use window::Window;
