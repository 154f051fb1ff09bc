//! `[camera]`: the camera on the robot, whoever brings its pictures.

use std::path::PathBuf;

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
    /// Number of one of a camera's inputs.
    CameraInput: u32 in 0..=31, "";
    /// Exposure time.
    Exposure: u32 in 1..=1000000, "µs";
    /// Gain, in a camera's own units.
    CameraGain: u32 in 0..=65535, "";
    /// White balance as a colour temperature.
    WhiteBalance: u32 in 1000..=20000, "K";
    /// Value of a control, in its own units.
    ControlValue: i32 in -2147483648..=2147483647, "";
}

/// How a camera codes its pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum CameraFormat {
    /// Whatever it has, the cheapest first.
    #[default]
    Any,
    /// Luminance.
    Grey,
    /// Luminance and colour in turn.
    Yuyv,
    /// JPEG pictures.
    Mjpg,
}

/// `[[camera.control]]`: a control of the camera that is held at a value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct CameraControl {
    /// Its name, as `stillmap camera list` shows it.
    pub name: String,
    /// Its value, in its own units.
    pub value: ControlValue,
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
    /// The device that the process `camera` takes pictures with.
    #[serde(deserialize_with = "crate::text::path")]
    #[schemars(extend("x-form" = "path of a device"))]
    pub device: PathBuf,
    /// How its pixels are coded.
    pub format: CameraFormat,
    /// Which of its inputs, counted from 0; the one that is selected when left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub input: Option<CameraInput>,
    /// Exposure time, held; automatic when left out. Background subtraction sees less when the exposure changes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exposure_us: Option<Exposure>,
    /// Gain, held, in the camera's own units; automatic when left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain: Option<CameraGain>,
    /// White balance, held; automatic when left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub white_balance_k: Option<WhiteBalance>,
    /// Other controls that are held.
    #[schemars(length(max = 32))]
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub control: Vec<CameraControl>,
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
            device: PathBuf::from("/dev/robot-camera"),
            format: CameraFormat::default(),
            input: None,
            exposure_us: None,
            gain: None,
            white_balance_k: None,
            control: Vec::new(),
        }
    }
}
