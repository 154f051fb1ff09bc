//! What a map is made by: plain numbers with their units.

use fuzzy::{PartitionError, TableError};
use geometry::{CellSize, CellSizeError};

/// What the mapper works by.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    /// Edge of a cell, m, 0.005 to 1.
    pub cell_m: f64,
    /// Half the opening angle of a beam, rad, 0.01 to 1.5.
    pub half_beam_rad: f64,
    /// Eq. 2.
    pub sensor: SensorParameters,
    /// The fuzzy rules that tune eq. 2.
    pub tuning: TuningParameters,
    /// Greatest log-odds of a cell, of either sign, 0.5 to 10.
    pub l_max: f64,
    /// When a reading is integrated for good.
    pub commit: CommitRule,
    /// Where scans are placed in the map.
    pub poses: PoseRule,
    /// Keep a second map that ignores the verdicts.
    pub keep_unfiltered: bool,
    /// Occupied cells with fewer occupied neighbours, of eight, are published as free.
    pub lonely_below: u32,
}

/// Parameters of eq. 2 that no rule tunes, and of its limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorParameters {
    /// Peak probability of a surface (k_o), 0.55 to 0.99.
    pub k_o: f64,
    /// Spread in range (σ_r), m, 0.005 to 0.5.
    pub sigma_r_m: f64,
    /// How far a reading without an echo frees, m, 0 to 20.
    pub no_echo_free_m: f64,
    /// Far readings say less; `None` for the paper's own model.
    pub fades: Option<Fades>,
}

/// Where readings have lost half their weight, m, 0.1 to 20.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fades {
    /// An echo.
    pub occupied_m: f64,
    /// Emptiness.
    pub free_m: f64,
}

/// Rule base of the fuzzy tuning. Rows: the sets of P_arc, columns: those of P_free, each low, middle and high.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TuningParameters {
    /// Tune. False: the rules of the first row and column hold everywhere.
    pub enabled: bool,
    /// Centres of the sets of P_arc, the highest occupancy at the reading's range, ascending from 0 to 1.
    pub p_arc: [f64; 3],
    /// Centres of the sets of P_free, the highest occupancy before it, ascending from 0 to 1.
    pub p_free: [f64; 3],
    /// How far the axis turns towards the known surface, 0 to 1.
    pub gain: [[f64; 3]; 3],
    /// Angular width (σ_θ), rad, 0.01 to 1.6.
    pub sigma_theta_rad: [[f64; 3]; 3],
    /// Occupancy that a free reading leaves on its axis (k_e), 0.01 to 0.49.
    pub k_e: [[f64; 3]; 3],
}

/// When a reading is integrated for good. Times are ns of sensor time after the reading's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CommitRule {
    /// No verdicts: when a scan passes the horizon.
    Horizon {
        /// The horizon.
        horizon_ns: u64,
    },
    /// Lockstep: when its verdict is there, however long it takes.
    Verdict,
    /// Live: when its verdict is there, or a scan passes the deadline.
    VerdictOrDeadline {
        /// The deadline.
        deadline_ns: u64,
    },
}

/// Where scans are placed in the map. Times are ns of sensor time after the scan's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PoseRule {
    /// Odometry is exact.
    Odometry,
    /// Lockstep: where localisation estimates, however long that takes.
    Estimate,
    /// Live: where localisation estimates, or by odometry from the last estimate once a scan passes the deadline.
    EstimateOrDeadline {
        /// The deadline.
        deadline_ns: u64,
    },
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            cell_m: 0.05,
            half_beam_rad: 12.5_f64.to_radians(),
            sensor: SensorParameters::default(),
            tuning: TuningParameters::default(),
            l_max: 2.0,
            commit: CommitRule::Horizon { horizon_ns: 3_000_000_000 },
            poses: PoseRule::Odometry,
            keep_unfiltered: false,
            lonely_below: 0,
        }
    }
}

impl Default for SensorParameters {
    fn default() -> Self {
        Self { k_o: 0.8, sigma_r_m: 0.06, no_echo_free_m: 1.2, fades: Some(Fades { occupied_m: 2.0, free_m: 1.6 }) }
    }
}

impl Default for TuningParameters {
    fn default() -> Self {
        let [wide, middle, narrow] = [30.0_f64, 24.0, 16.0].map(f64::to_radians);
        Self {
            enabled: true,
            p_arc: [0.5, 0.7, 0.9],
            p_free: [0.5, 0.7, 0.9],
            // As P_arc grows the echo is attributed to the known surface: the axis turns to it and the beam narrows.
            gain: [[0.0; 3], [0.5; 3], [1.0; 3]],
            sigma_theta_rad: [[wide; 3], [middle; 3], [narrow; 3]],
            // As P_free grows one reading through a known wall does less harm.
            k_e: [[0.35, 0.40, 0.43]; 3],
        }
    }
}

/// Parameters that make no mapper.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParametersError {
    /// The edge of a cell.
    #[error(transparent)]
    Cell(#[from] CellSizeError),
    /// The sets of P_arc or P_free.
    #[error("sets of the fuzzy tuning: {0}")]
    Sets(#[from] PartitionError),
    /// A rule table of the fuzzy tuning.
    #[error("rules of the fuzzy tuning: {0}")]
    Rules(#[from] TableError),
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
        within("cell_m", self.cell_m, 0.005, 1.0, "0.005 to 1 m")?;
        within("half_beam_rad", self.half_beam_rad, 0.01, 1.5, "0.01 to 1.5 rad")?;
        within("l_max", self.l_max, 0.5, 10.0, "0.5 to 10")?;
        within("lonely_below", f64::from(self.lonely_below), 0.0, 8.0, "0 to 8 cells")?;
        let SensorParameters { k_o, sigma_r_m, no_echo_free_m, fades } = self.sensor;
        within("k_o", k_o, 0.55, 0.99, "0.55 to 0.99")?;
        within("sigma_r_m", sigma_r_m, 0.005, 0.5, "0.005 to 0.5 m")?;
        within("no_echo_free_m", no_echo_free_m, 0.0, 20.0, "0 to 20 m")?;
        if let Some(Fades { occupied_m, free_m }) = fades {
            within("fades.occupied_m", occupied_m, 0.1, 20.0, "0.1 to 20 m")?;
            within("fades.free_m", free_m, 0.1, 20.0, "0.1 to 20 m")?;
        }
        let rules = |name, rules: &[[f64; 3]; 3], low, high, expected| {
            rules.as_flattened().iter().try_for_each(|rule| within(name, *rule, low, high, expected))
        };
        rules("tuning.gain", &self.tuning.gain, 0.0, 1.0, "0 to 1")?;
        rules("tuning.sigma_theta_rad", &self.tuning.sigma_theta_rad, 0.01, 1.6, "0.01 to 1.6 rad")?;
        rules("tuning.k_e", &self.tuning.k_e, 0.01, 0.49, "0.01 to 0.49")?;
        Ok(CellSize::new(self.cell_m)?)
    }
}

fn within(name: &'static str, found: f64, low: f64, high: f64, expected: &'static str) -> Result<(), ParametersError> {
    if (low..=high).contains(&found) { Ok(()) } else { Err(ParametersError::OutOfRange { name, found, expected }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_out_of_range_are_refused() {
        assert!(Parameters::default().check().is_ok());
        let refused = |parameters: Parameters| parameters.check().unwrap_err().to_string();
        assert_eq!(refused(Parameters { cell_m: 0.0, ..Parameters::default() }), "cell_m is 0, expected 0.005 to 1 m");
        let sensor = SensorParameters { k_o: f64::NAN, ..SensorParameters::default() };
        assert_eq!(refused(Parameters { sensor, ..Parameters::default() }), "k_o is NaN, expected 0.55 to 0.99");
        let tuning = TuningParameters { k_e: [[0.4, 0.4, 0.5]; 3], ..TuningParameters::default() };
        assert_eq!(refused(Parameters { tuning, ..Parameters::default() }), "tuning.k_e is 0.5, expected 0.01 to 0.49");
    }
}
