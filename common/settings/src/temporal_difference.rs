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

/// When a cell that an echo fell in counts as moving.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum MovingCell {
    /// Nothing was there within the span, and it was seen free lately.
    #[default]
    Visible,
    /// Nothing was there within the span: the paper's Table 1.
    Paper,
}

/// `[std]`: sonar temporal difference (the paper's section 4).
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Std {
    /// When a cell that an echo fell in counts as moving.
    pub rule: MovingCell,
    /// The time span: at least as many scans as the sonars need to fire all round.
    pub span_scans: Span,
    /// How far an earlier echo may lie from a cell and still make it stationary.
    pub tolerance_cells: Tolerance,
    /// Least share of moving cells of a class that moves (the paper: 0.5).
    pub moving_share: MovingShare,
    /// For how many scans a cell counts as seen free, where the rule is "visible".
    pub free_for_scans: FreeFor,
    /// Sonars that look further aside than this from straight ahead take no part: along a wall they are mostly wrong.
    pub aside_deg: Aside,
}
