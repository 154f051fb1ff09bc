//! `[fti]`: fuzzy-tuned integration.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::bounded::bounded;

bounded! {
    /// Distance of what the sonars and the camera see.
    Correspondence: f64 in 0.0..=5.0, "m", default 0.5;
    /// Log-odds.
    PriorLogOdds: f64 in -20.0..=20.0, "", default 0.5;
    /// Sensor time.
    Patience: f64 in 0.0..=10.0, "s", default 0.5;
}

/// The method that decides whether a walker caused a reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum FtiMethod {
    /// The likelihood ratio of a walker against a stationary thing, from everything seen until the horizon.
    #[default]
    Likelihood,
    /// The paper's Table 6: the arc of the reading enters the update region of a corresponding pair.
    Paper,
}

/// How the position of a person is computed from a blob.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Cue {
    /// From the lowest row of the blob, which is on the floor.
    #[default]
    Ground,
    /// From row and column, scaled linearly to the sonar cone, as in the paper.
    Paper,
}

/// How the map is changed where something moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Action {
    /// The whole arc of a reading that a person caused is withheld from the map.
    #[default]
    Withhold,
    /// The readings are integrated, and the cells of the update regions are set free, as in the paper.
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
    /// Method that decides whether a walker caused a reading.
    pub method: FtiMethod,
    /// Prior log-odds that a walker caused a reading, with the method "likelihood" (w_0). With a higher value more readings are
    /// withheld.
    pub prior_log_odds: PriorLogOdds,
    /// Longest time that a scan waits for the motion seen by sonars and camera, with the pace "live".
    pub patience_s: Patience,
    /// `[fti.paper]`: the paper's method as printed. Refused unless `method` is "paper".
    pub paper: FtiPaper,
}

/// `[fti.paper]`: the paper's method as printed.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct FtiPaper {
    /// How the position of a person is computed from a blob.
    pub cue: Cue,
    /// How the map is changed where something moves.
    pub action: Action,
    /// Largest distance between a blob and a moving class of cells that belong to one object (sigma_correspond of eq. 11).
    pub correspond_m: Correspondence,
    /// `[fti.paper.tables]`: the fuzzy rules of Tables 3 to 5. Rows are the sets of C (sonars), columns those of B (camera).
    pub tables: Tables,
}

/// `[fti.paper.tables]`: Tables 3 to 5 of the paper. Rows: sets of C (sonars), columns: sets of B (camera), in the order of the sets; the
/// defaults are as printed, odd entries included.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Tables {
    /// Table 3: fuzzy sets of O_Centroid.x, the distance ahead of the robot.
    pub centroid_x: [[Magnitude; 5]; 5],
    /// Table 4: fuzzy sets of O_Centroid.y, the offset to the left.
    pub centroid_y: [[Side; 5]; 5],
    /// Table 5: fuzzy sets of O_Size, the extent of the update region.
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
