//! `[camera]`: the camera on the robot, whoever brings its pictures.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::bounded::bounded;
use crate::robot::{MountHeading, MountOffset};

bounded! {
    /// Pixels in a row.
    PictureWidth: u32 in 80..=640, "px", default 160;
    /// Rows of a picture.
    PictureHeight: u32 in 60..=480, "px", default 120;
    /// Pictures a second.
    FrameRate: f64 in 1.0..=60.0, "Hz", default 15.0;
    /// Height of the lens above the floor.
    CameraHeight: f64 in 0.05..=3.0, "m", default 0.3;
    /// Horizontal field of view.
    FieldOfView: f64 in 15.0..=160.0, "deg", default 70.0;
    /// Row of the horizon as a share of the picture's height, from its top.
    HorizonShare: f64 in -1.0..=2.0, "", default 0.5;
}

/// `[camera]`: the camera on the robot. The last three numbers of its geometry need not be exact: within 3 %, 2 rows and 3 cm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Camera {
    /// Pixels in a row of its pictures.
    pub width: PictureWidth,
    /// Rows of its pictures.
    pub height: PictureHeight,
    /// Pictures a second.
    pub rate_hz: FrameRate,
    /// Where it sits, forward of the robot's centre.
    pub x_m: MountOffset,
    /// Where it sits, to the left of the robot's centre.
    pub y_m: MountOffset,
    /// Where it looks, counter-clockwise from straight ahead.
    pub heading_deg: MountHeading,
    /// Height of the lens above the floor.
    pub height_m: CameraHeight,
    /// Horizontal field of view.
    pub field_of_view_deg: FieldOfView,
    /// Row of the horizon as a share of the picture's height, from its top: 0.5 for a camera that looks level.
    pub horizon_share: HorizonShare,
}

impl Default for Camera {
    fn default() -> Self {
        Self {
            width: PictureWidth::default(),
            height: PictureHeight::default(),
            rate_hz: FrameRate::default(),
            x_m: MountOffset::literal(0.0),
            y_m: MountOffset::literal(0.0),
            heading_deg: MountHeading::literal(0.0),
            height_m: CameraHeight::default(),
            field_of_view_deg: FieldOfView::default(),
            horizon_share: HorizonShare::default(),
        }
    }
}
