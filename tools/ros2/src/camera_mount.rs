//! How a camera is mounted, from its frame and its calibration.

use nalgebra::{Isometry3, Vector3};

use crate::interfaces::CameraInfo;

/// A steeper axis is not that of a camera that looks ahead: the frame is then one whose x axis points ahead. It is the sine of 60°.
const STEEP: f64 = 0.87;

/// What the settings of a camera need.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraMount {
    /// Forward of the base, m.
    pub x_m: f64,
    /// To the left of the base, m.
    pub y_m: f64,
    /// Above the base, m.
    pub height_m: f64,
    /// Direction of the optical axis in the plane, rad counter-clockwise from straight ahead.
    pub heading_rad: f64,
    /// Upward tilt of the optical axis, rad.
    pub tilt_rad: f64,
}

impl CameraMount {
    /// The mount of the camera whose frame has this place on the base. By convention the z axis of the frame of a picture is the optical
    /// axis; some drivers give the frame of the body, whose x axis points ahead.
    pub(crate) fn of(base_from_camera: &Isometry3<f64>) -> Self {
        let optical = base_from_camera.rotation * Vector3::z();
        let axis = if optical.z.abs() < STEEP { optical } else { base_from_camera.rotation * Vector3::x() };
        let at = base_from_camera.translation;
        let level = (axis.x * axis.x + axis.y * axis.y).sqrt();
        Self { x_m: at.x, y_m: at.y, height_m: at.z, heading_rad: axis.y.atan2(axis.x), tilt_rad: axis.z.atan2(level) }
    }
}

/// What a calibration says of the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Optics {
    /// Horizontal field of view, rad.
    pub field_of_view_rad: f64,
    /// Row of the optical axis as a share of the height, from the top.
    pub axis_share: f64,
    /// Focal length in rows as a share of the height.
    pub focal_share: f64,
}

impl Optics {
    /// The optics of a calibration; `None` when it is empty, as of a camera that was never calibrated.
    pub(crate) fn of(info: &CameraInfo) -> Option<Self> {
        let [fx, .., fy, cy, _, _, _] = info.k;
        let (width, height) = (f64::from(info.width), f64::from(info.height));
        if !(fx > 0.0 && fy > 0.0 && width > 0.0 && height > 0.0 && fx.is_finite() && fy.is_finite() && cy.is_finite()) {
            return None;
        }
        Some(Self { field_of_view_rad: 2.0 * (width / 2.0).atan2(fx), axis_share: cy / height, focal_share: fy / height })
    }

    /// Row of the horizon as a share of the height, for a camera of this tilt.
    #[must_use]
    pub fn horizon_share(&self, tilt_rad: f64) -> f64 {
        let (sin, cos) = tilt_rad.sin_cos();
        self.axis_share + self.focal_share * sin / cos
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interfaces::{Header, RegionOfInterest};
    use nalgebra::{Rotation3, Translation3, UnitQuaternion};
    use std::f64::consts::FRAC_PI_2;

    fn mount(rotation: UnitQuaternion<f64>) -> CameraMount {
        CameraMount::of(&Isometry3::from_parts(Translation3::new(0.2, 0.0, 0.3), rotation))
    }

    #[test]
    fn both_kinds_of_frames_give_the_optical_axis() {
        let body = UnitQuaternion::from_euler_angles(0.0, -0.1, 0.5);
        // The frame of the picture: z ahead, x to the right, y down.
        let optical = body * UnitQuaternion::from_rotation_matrix(&Rotation3::from_euler_angles(-FRAC_PI_2, 0.0, -FRAC_PI_2));
        for found in [mount(body), mount(optical)] {
            assert!((found.heading_rad - 0.5).abs() < 1e-9 && (found.tilt_rad - 0.1).abs() < 1e-9, "{found:?}");
            assert_eq!((found.x_m, found.height_m), (0.2, 0.3));
        }
    }

    #[test]
    fn the_field_of_view_follows_from_the_focal_length() {
        let info = CameraInfo {
            header: Header::default(),
            height: 120,
            width: 160,
            distortion_model: String::new(),
            d: Vec::new(),
            k: [80.0, 0.0, 80.0, 0.0, 80.0, 60.0, 0.0, 0.0, 1.0],
            r: [0.0; 9],
            p: [0.0; 12],
            binning_x: 0,
            binning_y: 0,
            roi: RegionOfInterest::default(),
        };
        let optics = Optics::of(&info).unwrap();
        assert!((optics.field_of_view_rad - FRAC_PI_2).abs() < 1e-12);
        assert_eq!(optics.horizon_share(0.0), 0.5);
        assert!(optics.horizon_share(0.1) > 0.5, "a camera that looks up sees the horizon lower");
        assert_eq!(Optics::of(&CameraInfo { k: [0.0; 9], ..info }), None);
    }
}
