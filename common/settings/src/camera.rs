//! `[camera]`: the camera on the robot, real, simulated or recorded.

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
    /// Name of the control, as `stillmap camera list` prints it.
    pub name: String,
    /// Value of the control, in its own units.
    pub value: ControlValue,
}

/// `[camera]`: the camera on the robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Camera {
    /// Width of the pictures.
    pub width: PictureWidth,
    /// Height of the pictures.
    pub height: PictureHeight,
    /// Rate of the pictures.
    pub rate_hz: FrameRate,
    /// Position of the camera, forward of the centre of rotation.
    pub x_m: MountOffset,
    /// Position of the camera, to the left of the centre of rotation.
    pub y_m: MountOffset,
    /// Direction of the optical axis, counter-clockwise from straight ahead.
    pub heading_deg: MountHeading,
    /// Height of the lens above the floor.
    pub height_m: CameraHeight,
    /// Horizontal field of view.
    pub field_of_view_deg: FieldOfView,
    /// Row of the horizon as a share of the height of the picture, from the top. It is 0.5 for a camera that is level.
    pub horizon_share: HorizonShare,
    /// Device of the camera, relative to the settings file. The process "camera" reads it.
    #[serde(deserialize_with = "crate::text::path")]
    #[schemars(extend("x-form" = "path of a device"))]
    pub device: PathBuf,
    /// Pixel format that is requested from the camera.
    pub format: CameraFormat,
    /// Number of the video input, from 0. The default is the input that is selected.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub input: Option<CameraInput>,
    /// Fixed exposure time. The default is automatic exposure, whose changes disturb background subtraction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exposure_us: Option<Exposure>,
    /// Fixed gain, in units of the camera. The default is automatic gain.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain: Option<CameraGain>,
    /// Fixed white balance. The default is automatic white balance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub white_balance_k: Option<WhiteBalance>,
    /// `[[camera.control]]`: other controls of the camera that are set to a fixed value.
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
