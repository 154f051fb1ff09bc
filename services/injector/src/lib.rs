//! Faults on purpose: between a publisher and its readers, and on processes.
//!
//! A service that is routed in a deployment's settings goes through the injector: its publishers send to the injector, and the
//! injector sends to its readers. Neither they nor the readers are built for it. [`Line`] decides what becomes of each message;
//! whether a fault hits one follows from the fault's seed and the message's number alone, so that a run that is repeated, or a
//! message that is sent again, meets the same faults. [`Timetable`] says when a process is to be disturbed, or shared memory taken ([`Ballast`]).
//! That a fault begins and that it is over is told as [`News`].
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

mod ballast;
mod chance;
mod line;
mod order;
mod signals;
mod timetable;
mod words;

pub use ballast::{Ballast, BallastError};
pub use line::{Cargo, Counts, Line};
pub use order::{OrderError, give_order, take_orders};
pub use signals::{SignalError, Victim};
pub use timetable::{Deed, Harm, Timetable};
pub use words::{News, Wish};
