//! What STD works by.

use geometry::{CellSize, CellSizeError};

/// When a cell that an echo fell in counts as moving.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rule {
    /// Nothing was there within the span, and it was seen free lately.
    Visible,
    /// Nothing was there within the span: the paper's Table 1.
    Paper,
}

/// What STD works by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters {
    /// Edge of a cell of the TVM, m: the map's.
    pub cell_m: f64,
    /// Half the opening angle of a beam, rad, above 0 and below a right angle.
    pub half_beam_rad: f64,
    /// Which cells move.
    pub rule: Rule,
    /// The time span τ in scans (n of τ = n t), 1 to 100: at least one firing cycle of the sonars.
    pub span_scans: u32,
    /// How far, in cells, a tag may lie from a cell and still make it stationary; 0 to 5.
    pub tolerance_cells: u32,
    /// Least share of moving cells of a class that moves, 0 to 1. The paper's majority is 0.5.
    pub moving_share: f64,
    /// For how many scans a cell counts as seen free (m), 1 to 100 000.
    pub free_for_scans: u32,
    /// Sonars that look further aside than this take no part, rad from straight ahead. The paper looks ahead 75°.
    pub aside_rad: f64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            cell_m: 0.05,
            half_beam_rad: 12.5_f64.to_radians(),
            rule: Rule::Visible,
            span_scans: 4,
            tolerance_cells: 1,
            moving_share: 0.3,
            free_for_scans: 300,
            aside_rad: 37.5_f64.to_radians(),
        }
    }
}

/// Parameters out of range.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParametersError {
    /// The edge of a cell.
    #[error(transparent)]
    Cell(#[from] CellSizeError),
    /// A number outside its limits.
    #[error("{name} is {found}, expected {expected}")]
    OutOfRange {
        /// Which.
        name: &'static str,
        /// Its value.
        found: f64,
        /// Its limits.
        expected: &'static str,
    },
}

impl Parameters {
    /// Checks what the types do not.
    pub(crate) fn check(&self) -> Result<CellSize, ParametersError> {
        let within = |name, found: f64, low: f64, high: f64, expected| {
            if (low..=high).contains(&found) { Ok(()) } else { Err(ParametersError::OutOfRange { name, found, expected }) }
        };
        within("cell_m", self.cell_m, 0.005, 1.0, "0.005 to 1 m")?;
        within("half_beam_rad", self.half_beam_rad, 0.01, 1.5, "0.01 to 1.5 rad")?;
        within("span_scans", f64::from(self.span_scans), 1.0, 100.0, "1 to 100 scans")?;
        within("tolerance_cells", f64::from(self.tolerance_cells), 0.0, 5.0, "0 to 5 cells")?;
        within("moving_share", self.moving_share, 0.0, 1.0, "0 to 1")?;
        within("free_for_scans", f64::from(self.free_for_scans), 1.0, 1e5, "1 to 100000 scans")?;
        within("aside_rad", self.aside_rad, 0.0, 7.0, "0 to 7 rad")?;
        Ok(CellSize::new(self.cell_m)?)
    }
}
