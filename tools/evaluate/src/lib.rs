//! How good the map is, against the truth of the simulator.
//!
//! A [`Drive`] is a recorded way through a simulated world with what every sense said. [`judge()`] runs it through STD, FTI and
//! the mapper in this process, without a bus, and compares the map with the truth, with the map that true echo labels give
//! (*oracle*) and with the map of the same drive without walkers (*reference*).

mod causes;
mod comparison;
mod detection;
mod drive;
mod judge;
mod localised;
mod occupancy;
mod parallel;
mod recorded;
mod scan;
mod score;
mod setup;
mod trajectory;
mod trial;
mod truth;
mod variation;

pub use causes::{Causes, Share};
pub use comparison::{Cells, Overlap};
pub use detection::{Detection, track_errors_m};
pub use drive::{CameraSetup, Drive, Frame};
pub use judge::{Chain, FilterError, Outcome, filter, judge, mapped, oracle, unfiltered};
pub use localised::{ByPoses, LocalisationScore, Localised};
pub use occupancy::Occupancy;
pub use parallel::in_parallel;
pub use recorded::{NoTruth, Numbered, Recorded};
pub use scan::Scan;
pub use score::{Ghosts, Labels, Removed, Score, Tally};
pub use setup::{Driven, Setup};
pub use trajectory::TrajectoryError;
pub use trial::{Trial, reference};
pub use truth::Truth;
pub use variation::{Variation, VariationError, read_world};
