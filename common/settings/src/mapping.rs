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
    /// Edge of a cell.
    pub cell_m: CellSize,
    /// Half the opening angle of a sonar: cells further off its axis are not touched.
    pub half_beam_deg: HalfBeam,
    /// Probability of a surface on the axis at the reading (k_o of the sensor model).
    pub k_o: OccupiedPeak,
    /// Spread of a reading in range (sigma_r of the sensor model).
    pub sigma_r_m: RangeSpread,
    /// Limit of a cell's log-odds, of either sign: the smaller, the sooner the map follows a thing that moved.
    pub l_max: LogOddsLimit,
    /// Commit horizon: sensor time for which a reading stays pending and its verdict may still change.
    pub horizon_s: Horizon,
    /// Keep a second map that ignores the verdicts, for comparison.
    pub keep_unfiltered: bool,
    /// In the map that is published, an occupied cell with fewer occupied neighbours than this, of eight, is free (the end of the
    /// paper's Table 6). 0: none is.
    pub lonely_below: Neighbours,
    /// How far a reading without an echo frees: beyond, silence may as well be a wall that reflects away.
    pub no_echo_free_m: NoEchoFree,
    /// The weight of a reading falls with its range, by `occupied_fade_m` and `free_fade_m`. False: the paper's sensor model.
    pub fades: bool,
    /// Range at which an echo has lost half its weight, where `fades` is true.
    pub occupied_fade_m: OccupiedFade,
    /// Distance at which free space has lost half its weight, where `fades` is true.
    pub free_fade_m: FreeFade,
    /// `[mapping.tuning]`: the fuzzy tuning of the sensor model.
    pub tuning: Tuning,
}

/// `[mapping.tuning]`: the fuzzy tuning of the sensor model; the defaults are its rule base.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Tuning {
    /// Tune. False: the rules for unknown surroundings (first row, first column) hold everywhere.
    pub enabled: bool,
    /// Centres of the sets of P_arc, the highest occupancy at the reading's range.
    pub p_arc: Centres,
    /// Centres of the sets of P_free, the highest occupancy before it.
    pub p_free: Centres,
    /// How far the axis turns towards the known surface; rows P_arc, columns P_free.
    pub gain: [[Gain; 3]; 3],
    /// Angular width; rows P_arc, columns P_free.
    pub sigma_theta_deg: [[AngularWidth; 3]; 3],
    /// Occupancy that a free reading leaves on its axis (k_e of the sensor model); rows P_arc, columns P_free.
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
