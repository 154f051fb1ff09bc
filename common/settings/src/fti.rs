//! `[fti]`: fuzzy-tuned integration.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::bounded::bounded;

bounded! {
    /// Distance of what the sonars and the camera see.
    Correspondence: f64 in 0.0..=5.0, "m", default 0.5;
    /// Log-odds.
    Readiness: f64 in -20.0..=20.0, "", default 0.5;
    /// Sensor time.
    Patience: f64 in 0.0..=10.0, "s", default 0.5;
}

/// What decides about a reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum VerdictRule {
    /// The likelihood ratio of a walker against something that stands there, with everything seen until the horizon.
    #[default]
    Likelihood,
    /// Its arc enters the update region of a corresponding pair: the paper's Table 6.
    Paper,
}

/// How the place of a blob is read off the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Cue {
    /// From its foot on the floor.
    #[default]
    Ground,
    /// From its row and column, scaled linearly to the sonar cone: the paper's.
    Paper,
}

/// What becomes of a place where something moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Action {
    /// The whole arc of a reading that a moving thing caused is left out of the map.
    #[default]
    Withhold,
    /// The readings stay, and the cells of the update regions are set free: the paper's.
    Free,
}

/// Sets of a variable that counts from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Magnitude {
    /// Very small.
    VS,
    /// Small.
    S,
    /// Medium.
    M,
    /// Large.
    L,
    /// Very large.
    VL,
}

/// Sets of a variable that counts to either side of 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Side {
    /// Negative, big.
    NB,
    /// Negative, small.
    NS,
    /// Zero.
    Z,
    /// Positive, small.
    PS,
    /// Positive, big.
    PB,
}

/// `[fti]`: fuzzy-tuned integration (the paper's section 6).
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Fti {
    /// What decides about a reading.
    pub rule: VerdictRule,
    /// How the place of a blob is read off the picture.
    pub cue: Cue,
    /// What becomes of a place where something moves.
    pub action: Action,
    /// Farthest distance of a blob and a moving class that are one object (sigma_correspond).
    pub correspond_m: Correspondence,
    /// How ready the verdict is to withhold (w_0): 0 is careful.
    pub readiness: Readiness,
    /// Camera motion is to come: a scan waits for it. False: sonar alone.
    pub expect_camera: bool,
    /// How long a scan waits for the motion seen by sonars and camera at that time, at the pace of the sensors.
    pub patience_s: Patience,
    /// `[fti.tables]`: the rules from what the sonars (rows) and the camera (columns) see to what is there.
    pub tables: Tables,
}

/// `[fti.tables]`: Tables 3 to 5 of the paper. Rows: sets of C (sonars), columns: sets of B (camera), in the order of the sets; the
/// defaults are as printed, odd entries included.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Tables {
    /// Table 3: O_Centroid.x.
    pub centroid_x: [[Magnitude; 5]; 5],
    /// Table 4: O_Centroid.y.
    pub centroid_y: [[Side; 5]; 5],
    /// Table 5: O_Size.
    pub size: [[Magnitude; 5]; 5],
}

impl Default for Tables {
    fn default() -> Self {
        use Magnitude::{L, M, S, VL, VS};
        use Side::{NB, NS, PB, PS, Z};
        Self {
            centroid_x: [[VS, S, S, M, M], [VS, S, M, M, L], [S, S, M, L, L], [M, M, M, L, VL], [L, M, L, L, VL]],
            centroid_y: [[NB, NS, NS, Z, Z], [NB, NS, Z, Z, PS], [NS, NS, Z, PS, PS], [Z, Z, Z, PS, PB], [PS, Z, PS, PS, PB]],
            size: [[VS, S, S, L, VL], [S, S, M, L, VL], [M, M, M, L, VL], [L, L, L, L, VL], [VL, VL, VL, VL, VL]],
        }
    }
}
