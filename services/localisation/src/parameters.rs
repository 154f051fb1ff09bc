//! What localisation works by.

/// Whether walls are taken to meet at right angles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RightAngles {
    /// Where a long wall has set the building's direction, and weakly for walls that do not agree with it.
    #[default]
    Auto,
    /// Always, fully.
    On,
    /// Never.
    Off,
}

/// What localisation works by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters {
    /// Correct the odometry. False: the map frame is the odometry's.
    pub enabled: bool,
    /// Prior on the directions of walls.
    pub right_angles: RightAngles,
    /// Half the opening angle of a beam, rad, 0.01 to 1.5.
    pub half_beam_rad: f64,
    /// Age at which a scan's pose is answered for the map, ns: the filter's, 0 to 60 s.
    pub horizon_ns: u64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self { enabled: false, right_angles: RightAngles::Auto, half_beam_rad: 12.5_f64.to_radians(), horizon_ns: 3_000_000_000 }
    }
}

/// A parameter out of range.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{name} is {found}, expected {expected}")]
pub struct ParametersError {
    /// Which.
    pub name: &'static str,
    /// Its value.
    pub found: f64,
    /// What it may be.
    pub expected: &'static str,
}

impl Parameters {
    /// Whether every number is in its range.
    ///
    /// # Errors
    /// The first that is not.
    pub fn check(&self) -> Result<(), ParametersError> {
        let within = |name, found: f64, low: f64, high: f64, expected| {
            if (low..=high).contains(&found) { Ok(()) } else { Err(ParametersError { name, found, expected }) }
        };
        within("half_beam_rad", self.half_beam_rad, 0.01, 1.5, "0.01 to 1.5 rad")?;
        within("horizon_ns", self.horizon_ns as f64, 0.0, 60e9, "0 to 60 s")
    }
}
