//! The deployment as the page receives it.

use serde::Serialize;

/// The deployment as the page receives it.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename = "deployment")]
pub struct Deployment {
    /// Its name.
    pub name: String,
    /// Edge of a cell of the map, m.
    pub cell_m: f64,
    /// Half the opening angle of a sonar cone, rad.
    pub half_beam_rad: f64,
    /// Whether the map has a second layer, the unfiltered map.
    pub has_unfiltered: bool,
    /// Whether the robot is simulated, so that the true walkers are known.
    pub is_simulated: bool,
    /// Whether a log is replayed, which can be paused.
    pub playback: bool,
    /// Whether the speed of the replay can be set.
    pub has_pace: bool,
    /// The port for Foxglove, once it is open.
    pub foxglove_port: Option<u16>,
}
