//! Typed configuration of a stillmap deployment: parse, validate, explain.
//!
//! A deployment is one TOML file. Each section is a struct of this crate; each number is a newtype with its limits, so that a
//! value that has been read is in range. [`Settings::check`] checks the sections against each other.
//!
//! Every problem is reported in one line: file and line, key, what was found, what was expected.
//!
//! ```
//! # use stillmap_settings as settings;
//! use settings::Settings;
//!
//! let text = r#"
//!     name = "example"
//!     process = [{ name = "driver", run = "pioneer" }, { name = "mapping", run = "mapping" }]
//!     [mapping]
//!     cell_m = 0.1
//! "#;
//! let settings = Settings::parse("example.toml", text)?;
//! assert_eq!(settings.mapping.cell_m.get(), 0.1);
//! assert_eq!(settings.mapping.horizon_s.get(), 3.0, "the default");
//!
//! let refused = Settings::parse("example.toml", &text.replace("0.1", "-0.05")).unwrap_err();
//! assert_eq!(refused.to_string(), "example.toml:5: mapping.cell_m = -0.05: expected 0.005 to 1 m");
//! # Ok::<(), settings::DocumentError>(())
//! ```
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

mod background_subtraction;
mod bounded;
mod camera;
mod check;
mod deployment;
mod effect;
mod faults;
mod files;
mod fti;
mod localisation;
mod mapping;
mod pioneer;
mod playback;
mod programs;
mod recorder;
mod reference;
mod robot;
mod simulator;
mod supervisor;
mod temporal_difference;
mod text;
mod viewer;

pub use background_subtraction::{BlobArea, CovarianceFactor, Deviations, Freedom, RegionBound, Sbs, SbsMethod, Takeover, TrainingFrames};
pub use camera::{
    Camera, CameraControl, CameraFormat, CameraGain, CameraHeight, CameraInput, ControlValue, Exposure, FieldOfView, FrameRate,
    HorizonShare, PictureHeight, PictureWidth, WhiteBalance,
};
pub use check::{MAX_FAULTS, MAX_PROCESSES, MAX_SONARS};
pub use deployment::{Pace, Settings};
pub use document::{DocumentError, Fault, OutOfRange};
pub use faults::{
    Disturbance, FaultKind, FaultLength, FaultPeriod, FaultRate, FaultSeed, FaultStart, Injector, NoSuchFault, PlannedFault, ProcessFault,
    RoutedService, StreamFault,
};
pub use fti::{Action, Correspondence, Cue, Fti, FtiMethod, FtiPaper, Magnitude, Patience, PriorLogOdds, Side, Tables};
pub use localisation::{Localisation, RightAngles};
pub use mapping::{
    AngularWidth, BadCentres, CellSize, Centres, FreeFade, FreePeak, Gain, HalfBeam, Horizon, LogOddsLimit, Mapping, Neighbours,
    NoEchoFree, OccupiedFade, OccupiedPeak, RangeSpread, Tuning,
};
pub use pioneer::{Baud, LinkTimeout, Pioneer, PulseInterval, SharePort, SpeedLimit, TurnLimit};
pub use playback::{LogTime, Playback, Window};
pub use programs::{BuiltIn, Process, Program, Published};
pub use recorder::{FlushInterval, FreeSpace, LogSpace, Recorder};
pub use reference::{reference, schema};
pub use robot::{HeadingUnits, Model, MountHeading, MountOffset, OdometryModulus, RangeLimit, Robot, Sonar, UnitLength};
pub use simulator::{Provides, Seed, SimulatedCamera, Simulator};
pub use supervisor::{
    DiskLow, FirstBackoff, HeartbeatTimeout, LastBackoff, RestartBudget, RestartPeriod, StartupDeadline, StopDeadline, Supervisor,
    SyncInterval,
};
pub use temporal_difference::{Aside, FreeFor, MovingCell, MovingShare, Span, Std, Tolerance};
pub use text::{BadText, FileName, Name, NetworkPort, Port};
pub use viewer::{Address, FoxglovePort, PagePort, Token, Viewer};
