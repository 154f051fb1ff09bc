//! `[std]`: sonar temporal difference.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::bounded::bounded;

bounded! {
    /// The time span τ in scans.
    Span: u32 in 1..=100, "scans", default 4;
    /// How far a tag may lie from a cell and still make it stationary.
    Tolerance: u32 in 0..=5, "cells", default 1;
    /// Share of the cells of a class.
    MovingShare: f64 in 0.0..=1.0, "", default 0.3;
    /// For how many scans a cell counts as seen free.
    FreeFor: u32 in 1..=100000, "scans", default 300;
    /// Angle from straight ahead.
    Aside: f64 in 0.0..=180.0, "deg", default 37.5;
}

/// Rule by which a cell with an echo counts as moving.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum MovingCell {
    /// The cell had no echo within the span and was recently measured as free.
    #[default]
    Visible,
    /// The cell had no echo within the span (the paper's Table 1).
    Paper,
}

/// `[std]`: sonar temporal difference (the paper's section 4).
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Std {
    /// Rule by which a cell with an echo counts as moving.
    pub rule: MovingCell,
    /// Time span in scans. It must cover at least the scans in which every sonar fires once.
    pub span_scans: Span,
    /// Largest distance of an earlier echo that makes a cell stationary.
    pub tolerance_cells: Tolerance,
    /// Share of moving cells from which a class of cells counts as moving (the paper: 0.5).
    pub moving_share: MovingShare,
    /// Number of scans for which a cell counts as measured free, with the rule "visible".
    pub free_for_scans: FreeFor,
    /// Largest angle of a sonar from straight ahead. Sonars that look farther aside are not used, because most of their detections
    /// along a wall are false.
    pub aside_deg: Aside,
}
