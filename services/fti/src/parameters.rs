//! What FTI works by.

use std::f64::consts::FRAC_PI_2;

use geometry::{CellSize, CellSizeError};
use messages::Pose;

use crate::tables::{PAPER_PIXELS, Ranges, Tables};

/// `C_Size` and `O_Size` run up to this many cells.
const MOST_CELLS: f64 = 100.0;
/// `B_Size` runs up to this share of the picture: 4800 px of 160 × 120.
/// It concerns the method of the paper only. Half or twice of it gives the same verdicts.
const MOST_PIXELS_SHARE: f64 = 0.25;

/// The camera, roughly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Where it sits and looks, in the robot frame.
    pub mount: Pose,
    /// Above the floor, m.
    pub height_m: f64,
    /// Horizontal field of view, rad.
    pub field_of_view_rad: f64,
    /// Row of the horizon as a share of the picture's height, from its top.
    pub horizon_share: f64,
}

/// What decides about a reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rule {
    /// The likelihood ratio of a walker against something that stands there, with everything seen until the horizon.
    Likelihood,
    /// Its arc enters the update region of a corresponding pair: the paper's Table 6.
    Paper,
}

/// How the place of a blob is read off the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cue {
    /// From its foot on the floor.
    Ground,
    /// From its row and column, scaled linearly to the sonar cone: the paper's.
    Paper,
}

/// What becomes of a place where something moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// The whole arc of a reading that a moving thing caused is left out of the map.
    Withhold,
    /// The readings stay, and the cells of the update regions are set free: the paper's.
    Free,
}

/// How long the streams wait for each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Patience {
    /// Lockstep: until what is missing comes or its stream ends.
    Endless,
    /// Live: until the newest scan is this much younger, s of sensor time.
    Seconds(f64),
}

/// What FTI works by.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    /// Edge of a cell, m: the map's.
    pub cell_m: f64,
    /// Half the opening angle of a beam, rad.
    pub half_beam_rad: f64,
    /// Range from which on nothing is heard (r_max), m.
    pub range_limit_m: f64,
    /// How long after a reading its verdict is given, s: the map's commit horizon.
    pub horizon_s: f64,
    /// What decides about a reading.
    pub rule: Rule,
    /// How a blob's place is read off the picture.
    pub cue: Cue,
    /// What becomes of a place where something moves.
    pub action: Action,
    /// Farthest distance of a blob and a moving class that are one object (σ_correspond), m.
    pub correspond_m: f64,
    /// How ready the verdict is to withhold (w_0): 0 is careful.
    pub prior_log_odds: f64,
    /// The camera; `None`: sonar alone.
    pub camera: Option<Camera>,
    /// How long the streams wait for each other.
    pub patience: Patience,
    /// Tables 3 to 5.
    pub tables: Tables,
}

impl Default for Camera {
    fn default() -> Self {
        Self { mount: Pose::default(), height_m: 0.3, field_of_view_rad: 70.0_f64.to_radians(), horizon_share: 0.5 }
    }
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            cell_m: 0.05,
            half_beam_rad: 12.5_f64.to_radians(),
            range_limit_m: 3.0,
            horizon_s: 3.0,
            rule: Rule::Likelihood,
            cue: Cue::Ground,
            action: Action::Withhold,
            correspond_m: 0.5,
            prior_log_odds: 0.5,
            camera: Some(Camera::default()),
            patience: Patience::Endless,
            tables: Tables::default(),
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
        within("cell_m", self.cell_m, 0.005, 1.0, "0.005 to 1 m")?;
        within("half_beam_rad", self.half_beam_rad, 0.01, 1.5, "0.01 to 1.5 rad")?;
        within("range_limit_m", self.range_limit_m, 0.2, 10.0, "0.2 to 10 m")?;
        within("horizon_s", self.horizon_s, 0.0, 10.0, "0 to 10 s")?;
        within("correspond_m", self.correspond_m, 0.0, 10.0, "0 to 10 m")?;
        within("prior_log_odds", self.prior_log_odds, -20.0, 20.0, "-20 to 20")?;
        if let Some(camera) = &self.camera {
            within("camera.height_m", camera.height_m, 0.05, 3.0, "0.05 to 3 m")?;
            within("camera.field_of_view_rad", camera.field_of_view_rad, 0.2, 2.8, "0.2 to 2.8 rad")?;
            within("camera.horizon_share", camera.horizon_share, -1.0, 2.0, "-1 to 2")?;
            within("camera.mount.x_m", camera.mount.x_m, -10.0, 10.0, "within 10 m of the robot")?;
            within("camera.mount.y_m", camera.mount.y_m, -10.0, 10.0, "within 10 m of the robot")?;
            within("camera.mount.yaw_rad", camera.mount.yaw_rad, -4.0 * FRAC_PI_2, 4.0 * FRAC_PI_2, "an angle")?;
        }
        if let Patience::Seconds(seconds) = self.patience {
            within("patience", seconds, 0.0, 1000.0, "0 to 1000 s")?;
        }
        Ok(CellSize::new(self.cell_m)?)
    }

    /// The ranges of the variables of Tables 3 to 5.
    pub(crate) fn ranges(&self) -> Ranges {
        Ranges { forward_m: self.range_limit_m, width_m: self.cone_width_m(), cells: MOST_CELLS, pixels: MOST_PIXELS_SHARE * PAPER_PIXELS }
    }

    /// CW: the width that the local sensor cone has in front of the camera at r_max.
    pub(crate) fn cone_width_m(&self) -> f64 {
        let field_of_view_rad = self.camera.map_or(Camera::default().field_of_view_rad, |camera| camera.field_of_view_rad);
        2.0 * self.range_limit_m * (field_of_view_rad / 2.0).tan()
    }
}

fn within(name: &'static str, found: f64, low: f64, high: f64, expected: &'static str) -> Result<(), ParametersError> {
    if (low..=high).contains(&found) { Ok(()) } else { Err(ParametersError::OutOfRange { name, found, expected }) }
}
