//! `[mapping]`: the fuzzy-tuned grid map.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use crate::bounded::bounded;

bounded! {
    /// Edge of a cell.
    CellSize: f64 in 0.005..=1.0, "m", default 0.05;
    /// Half the opening angle of a sonar.
    HalfBeam: f64 in 1.0..=60.0, "deg", default 12.5;
    /// Probability that an echo shows a surface, on the axis at the reading.
    OccupiedPeak: f64 in 0.55..=0.99, "", default 0.8;
    /// Spread of a reading in range.
    RangeSpread: f64 in 0.005..=0.5, "m", default 0.06;
    /// Greatest log-odds of a cell, of either sign.
    LogOddsLimit: f64 in 0.5..=10.0, "", default 2.0;
    /// A number of neighbours of a cell.
    Neighbours: u32 in 0..=8, "cells", default 0;
    /// Sensor time for which a reading stays pending.
    Horizon: f64 in 0.0..=10.0, "s", default 3.0;
    /// How far a reading without an echo frees.
    NoEchoFree: f64 in 0.0..=20.0, "m", default 1.2;
    /// Range at which an echo has lost half its weight.
    OccupiedFade: f64 in 0.1..=20.0, "m", default 2.0;
    /// Distance at which emptiness has lost half its weight.
    FreeFade: f64 in 0.1..=20.0, "m", default 1.6;
    /// Share of the azimuth of the known surface by which the beam's axis moves.
    Gain: f64 in 0.0..=1.0, "";
    /// Angular width of the beam in the sensor model.
    AngularWidth: f64 in 1.0..=90.0, "deg";
    /// Occupancy that a free reading leaves on its axis.
    FreePeak: f64 in 0.01..=0.49, "";
}

/// `[mapping]`: the fuzzy-tuned grid map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Mapping {
    /// Edge length of a cell.
    pub cell_m: CellSize,
    /// Half of the opening angle of a sonar. Cells farther from the axis are not updated.
    pub half_beam_deg: HalfBeam,
    /// Probability of an occupied cell on the axis at the measured range (k_o of the sensor model).
    pub k_o: OccupiedPeak,
    /// Standard deviation of a measured range (sigma_r of the sensor model).
    pub sigma_r_m: RangeSpread,
    /// Limit of the log-odds of a cell, of either sign. With a smaller limit the map adapts sooner to an object that moved.
    pub l_max: LogOddsLimit,
    /// Commit horizon: sensor time for which a reading stays pending while its verdict can change.
    pub horizon_s: Horizon,
    /// Whether a second map that ignores the verdicts is made for comparison.
    pub keep_unfiltered: bool,
    /// Despeckling of the published map: an occupied cell with fewer occupied neighbours than this, of eight, is published as free
    /// (the end of the paper's Table 6). With 0 no cell is changed.
    pub lonely_below: Neighbours,
    /// Range up to which a reading without an echo marks cells as free. Beyond it a wall may have reflected the sound away.
    pub no_echo_free_m: NoEchoFree,
    /// Whether the weight of a reading falls with its range, by `occupied_fade_m` and `free_fade_m`. With false the sensor model is that
    /// of the paper.
    pub fades: bool,
    /// Range at which the weight of an echo is one half, if `fades` is true.
    pub occupied_fade_m: OccupiedFade,
    /// Distance at which the weight of free space is one half, if `fades` is true.
    pub free_fade_m: FreeFade,
    /// `[mapping.tuning]`: the fuzzy tuning of the sensor model.
    pub tuning: Tuning,
}

/// `[mapping.tuning]`: the fuzzy tuning of the sensor model; the defaults are its rule base.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Tuning {
    /// Whether the sensor model is tuned. With false the rule for unknown surroundings (first row, first column) holds everywhere.
    pub enabled: bool,
    /// Centres of the fuzzy sets of P_arc, the highest occupancy at the measured range.
    pub p_arc: Centres,
    /// Centres of the fuzzy sets of P_free, the highest occupancy before the measured range.
    pub p_free: Centres,
    /// Share by which the axis turns towards the known surface. Rows are sets of P_arc, columns sets of P_free.
    pub gain: [[Gain; 3]; 3],
    /// Angular width of the beam. Rows are sets of P_arc, columns sets of P_free.
    pub sigma_theta_deg: [[AngularWidth; 3]; 3],
    /// Occupancy of free cells on the axis (k_e of the sensor model). Rows are sets of P_arc, columns sets of P_free.
    pub k_e: [[FreePeak; 3]; 3],
}

/// Centres of three fuzzy sets over an occupancy: strictly ascending, from 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "[f64; 3]", into = "[f64; 3]")]
pub struct Centres([f64; 3]);

/// Centres that do not ascend or are no occupancies.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("expected three ascending numbers from 0 to 1")]
pub struct BadCentres;

impl Centres {
    /// The centres of low, middle and high.
    #[must_use]
    pub const fn get(self) -> [f64; 3] {
        self.0
    }
}

impl TryFrom<[f64; 3]> for Centres {
    type Error = BadCentres;

    fn try_from(centres: [f64; 3]) -> Result<Self, BadCentres> {
        let [low, middle, high] = centres;
        if low >= 0.0 && low < middle && middle < high && high <= 1.0 { Ok(Self(centres)) } else { Err(BadCentres) }
    }
}

impl From<Centres> for [f64; 3] {
    fn from(centres: Centres) -> Self {
        centres.0
    }
}

impl JsonSchema for Centres {
    fn schema_name() -> Cow<'static, str> {
        "Centres".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "array", "items": { "type": "number", "minimum": 0.0, "maximum": 1.0 }, "minItems": 3, "maxItems": 3, "x-form": "three ascending numbers, 0 to 1" })
    }
}

impl Default for Mapping {
    fn default() -> Self {
        Self {
            cell_m: CellSize::default(),
            half_beam_deg: HalfBeam::default(),
            k_o: OccupiedPeak::default(),
            sigma_r_m: RangeSpread::default(),
            l_max: LogOddsLimit::default(),
            horizon_s: Horizon::default(),
            keep_unfiltered: false,
            lonely_below: Neighbours::default(),
            no_echo_free_m: NoEchoFree::default(),
            fades: true,
            occupied_fade_m: OccupiedFade::default(),
            free_fade_m: FreeFade::default(),
            tuning: Tuning::default(),
        }
    }
}

impl Default for Tuning {
    fn default() -> Self {
        const CENTRES: Centres = Centres([0.5, 0.7, 0.9]);
        // As P_arc grows the echo is attributed to the known surface: the axis turns to it and the beam narrows.
        const GAIN: [[Gain; 3]; 3] = [[Gain::literal(0.0); 3], [Gain::literal(0.5); 3], [Gain::literal(1.0); 3]];
        const SIGMA_THETA_DEG: [[AngularWidth; 3]; 3] =
            [[AngularWidth::literal(30.0); 3], [AngularWidth::literal(24.0); 3], [AngularWidth::literal(16.0); 3]];
        // As P_free grows one reading through a known wall does less harm.
        const K_E: [[FreePeak; 3]; 3] = [[FreePeak::literal(0.35), FreePeak::literal(0.40), FreePeak::literal(0.43)]; 3];
        Self { enabled: true, p_arc: CENTRES, p_free: CENTRES, gain: GAIN, sigma_theta_deg: SIGMA_THETA_DEG, k_e: K_E }
    }
}
