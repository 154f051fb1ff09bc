//! What the page is told of the deployment.

use serde::Serialize;

/// What the page is told of the deployment.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename = "deployment")]
pub struct Deployment {
    /// Its name.
    pub name: String,
    /// Edge of a cell of the map, m.
    pub cell_m: f64,
    /// Half the opening angle of a sonar cone, rad.
    pub half_beam_rad: f64,
    /// Whether there is a second layer: the map without the filter.
    pub has_unfiltered: bool,
    /// Whether the robot is simulated, so that the truth is known.
    pub is_simulated: bool,
    /// Whether there is a replay that obeys play and pause.
    pub playback: bool,
    /// Whether playback keeps a pace that can be set.
    pub has_pace: bool,
    /// The port that Foxglove connects to, once it can.
    pub foxglove_port: Option<u16>,
}
