//! Typed configuration of a stillmap deployment: parse, validate, explain.
//!
//! A deployment is one TOML file. Each section is a struct of this crate; each number is a newtype with its limits, so that a
//! value that has been read is a value that can be meant.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

mod bounded;
mod check;
mod deployment;
mod document;
mod error;
mod files;
mod located;
mod mapping;
mod pioneer;
mod playback;
mod programs;
mod recorder;
mod robot;
mod simulator;
mod supervisor;
mod text;

pub use bounded::OutOfRange;
pub use check::{MAX_PROCESSES, MAX_SONARS};
pub use deployment::{Pace, Settings};
pub use document::{MAX_BYTES, parse, parse_checked, read_text};
pub use error::{Fault, SettingsError};
pub use mapping::{
    AngularWidth, BadCentres, CellSize, Centres, FreeFade, FreePeak, Gain, HalfBeam, Horizon, LogOddsLimit, Mapping, NoEchoFree,
    OccupiedFade, OccupiedPeak, RangeSpread, Tuning,
};
pub use pioneer::{Baud, LinkTimeout, Pioneer, PulseInterval, SpeedLimit, TurnLimit};
pub use playback::{Playback, Window};
pub use programs::{BuiltIn, Process, Program};
pub use recorder::{FlushInterval, Recorder};
pub use robot::{Model, MountHeading, MountOffset, OdometryModulus, RangeLimit, Robot, Sonar};
pub use simulator::{Seed, Simulator};
pub use supervisor::{
    FirstBackoff, HeartbeatTimeout, LastBackoff, RestartBudget, RestartPeriod, StartupDeadline, StopDeadline, Supervisor,
};
pub use text::{BadText, FileName, Name, Port};
