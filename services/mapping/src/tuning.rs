//! Fuzzy tuning of the sensor model from what the cone holds (section 3.2 of the paper; the rule base is this project's own).

use fuzzy::{Partition, RuleTable};

use crate::parameters::{ParametersError, TuningParameters};

/// What a beam's cone holds before the reading is integrated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Known {
    /// Highest occupancy among the cells of the arc, b ≤ z < c: is a surface known here?
    pub(crate) p_arc: f64,
    /// Azimuth of that cell, rad; among equals the one nearest to the axis.
    pub(crate) theta_max_rad: f64,
    /// Highest occupancy among the cells up to one cell before the arc: does the reading contradict a known surface?
    pub(crate) p_free: f64,
}

impl Known {
    /// Nothing.
    pub(crate) const NOTHING: Known = Known { p_arc: 0.5, theta_max_rad: 0.0, p_free: 0.5 };
}

/// The tuned parameters of eq. 2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tuned {
    /// Azimuth to which the echo is attributed (θ̄), rad.
    pub(crate) theta_bar_rad: f64,
    /// Angular width (σ_θ), rad.
    pub(crate) sigma_theta_rad: f64,
    /// Occupancy that a free reading leaves on its axis (k_e).
    pub(crate) k_e: f64,
}

/// The three rule tables over (P_arc, P_free).
#[derive(Debug, Clone)]
pub(crate) struct Tuning {
    enabled: bool,
    gain: RuleTable<2>,
    sigma_theta_rad: RuleTable<2>,
    k_e: RuleTable<2>,
}

impl Tuning {
    pub(crate) fn new(parameters: &TuningParameters) -> Result<Self, ParametersError> {
        let inputs = [Partition::new(parameters.p_arc.to_vec())?, Partition::new(parameters.p_free.to_vec())?];
        let table = |rules: &[[f64; 3]; 3]| RuleTable::new(inputs.clone(), rules.as_flattened().to_vec());
        Ok(Self {
            enabled: parameters.enabled,
            gain: table(&parameters.gain)?,
            sigma_theta_rad: table(&parameters.sigma_theta_rad)?,
            k_e: table(&parameters.k_e)?,
        })
    }

    /// Whether what is known has any say.
    pub(crate) fn enabled(&self) -> bool {
        self.enabled
    }

    /// The parameters for a cone that holds `known`.
    pub(crate) fn tune(&self, known: Known) -> Tuned {
        let inputs = [known.p_arc, known.p_free];
        Tuned {
            theta_bar_rad: self.gain.infer(inputs) * known.theta_max_rad,
            sigma_theta_rad: self.sigma_theta_rad.infer(inputs),
            k_e: self.k_e.infer(inputs),
        }
    }
}
