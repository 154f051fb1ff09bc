//! The wire contract of stillmap: the messages between the processes of a deployment.
//!
//! # Where to start
//!
//! A driver publishes [`SonarScan`]s, with a camera also pictures on [`CameraFrame`]. It is a program of its own that uses this crate
//! and `stillmap-runtime`, whose shell joins the deployment, sends the heartbeat and ends in order:
//!
//! - `examples/text_driver.rs` is a whole driver in 30 lines;
//! - [`reference()`] is the contract as a page (`docs/wire.md`): the rules for a driver, and every field with its offset and range;
//! - [`SERVICES`] is the registry: name, version and delivery of every [`Service`].
//!
//! ```
//! use stillmap_messages::{Payload, Pose, SonarReading, SonarScan};
//!
//! // The robot stands at the origin. Its sonar 0, at the front, has an echo at 1.4 m.
//! let reading = SonarReading::new(0, Pose::new(0.1, 0.0, 0.0), 1.4, true);
//! let scan = SonarScan::new(Pose::default(), &[reading], false);
//! assert_eq!(SonarScan::SERVICE.name, "robot/scan");
//! // Readers refuse a message that does not pass this check.
//! assert_eq!(scan.validate(), Ok(()));
//! ```
//!
//! # Conventions
//!
//! Every payload is a `repr(C)` struct of plain numbers and fixed arrays without padding, so that every bit pattern is a valid value
//! of its type. Readers check the ranges of the values with [`Payload::validate`].
//!
//! SI units: metres, radians, seconds; stamps are nanoseconds of sensor time since the Unix epoch (or since the start of an
//! imported log that has no epoch). Frames, as in ROS REP 105: *map* (right-handed, fixed to the building), *odom* (where the wheels
//! count from: it drifts against the map), *robot* (x forward, y left, yaw counter-clockwise); *image* (u right, v down). Scans and
//! what is detected in them are in *odom*; [`RobotEstimate`] has the odometry frame in the map frame. Without localisation both are
//! the same.

mod camera;
mod control;
mod delivery;
mod estimate;
mod header;
mod health;
mod layout;
mod map;
mod motion;
mod name;
mod numbered;
pub mod payload_bytes;
mod printable;
mod python;
mod range;
mod reference;
mod registry;
mod scan;
mod service;
mod time;
mod truth;
mod verdict;

pub use camera::{CameraBackground, CameraFrame, CameraMask, FrameHeader, FrameLayout, MAX_FRAME_BYTES, PixelFormat, TruthMask};
pub use control::{PlaybackControl, SimulatedTime};
pub use delivery::{Qos, Replay};
pub use estimate::{EstimateStatus, MAX_MOVED, MAX_SMOOTHED, MovedStretch, RobotEstimate, SmoothedPose, TrajectoryRevision};
pub use header::{Header, Kind, StreamCursor};
pub use health::{
    Counter, DeploymentStatus, Heartbeat, InputCounters, LogLevel, LogLine, MAX_COUNTERS, MAX_INPUTS, MAX_PROCESSES, Phase, ProcessState,
    ProcessStatus, Progress,
};
pub use layout::{Field, Layout, Shape};
pub use map::{Layer, MAX_WAY_POINTS, MapSummary, MapTile, TILE_CELLS, TILE_EDGE, Trajectory, WayChunk};
pub use motion::{Blob, CameraMotion, CameraStatus, MAX_BLOBS, MAX_MOVERS, Mover, SonarMotion};
pub use name::{Text, padded_text};
pub use printable::printable;
pub use python::python_module;
pub use reference::reference;
pub use registry::{SERVICES, visit_services};
pub use scan::{AFTER_DOUBT, AFTER_LOSS, MAX_READINGS, Pose, SonarReading, SonarScan};
pub use service::{Invalid, Payload, Pictures, Recorded, Service, ServiceVisitor};
pub use time::seconds;
pub use truth::{EchoLabel, MAX_SURFACES_PER_CHUNK, MAX_TRUE_WALKERS, Surface, TrueReading, TruthScan, TruthSurfaces};
pub use verdict::{
    FilterAction, FilterVerdict, MAX_OUTLOOK_SCANS, MAX_REGIONS, MAX_TRACKED_WALKERS, OutlookScan, TrackedWalker, UpdateRegion,
    VerdictOutlook, Walkers,
};
