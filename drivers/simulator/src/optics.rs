//! The camera as the robot takes it to be.

use messages::Pose;

/// A level camera: where it sits and looks, and what of the world comes into its picture.
///
/// A place on the floor X m ahead of the lens comes into row `horizon_px + focal_px · height_m / X`, one Y m to the left of the
/// optical axis into column `width / 2 − focal_px · Y / X`. Rows and columns are counted from the picture's upper left corner
/// in px, pixel k from k to k + 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Optics {
    /// Where it sits and looks, in the robot frame.
    pub mount: Pose,
    /// Above the floor, m.
    pub height_m: f64,
    /// Horizontal field of view, rad.
    pub field_of_view_rad: f64,
    /// Row of the horizon as a share of the picture's height.
    pub horizon_share: f64,
    /// Width and height of the picture, px.
    pub size_px: [u32; 2],
    /// Time from one frame to the next, ns.
    pub interval_ns: u64,
}

impl Default for Optics {
    /// A small camera at the robot's centre that looks ahead, 160 by 120 px 15 times a second.
    fn default() -> Self {
        Self {
            mount: Pose::default(),
            height_m: 0.3,
            field_of_view_rad: 70_f64.to_radians(),
            horizon_share: 0.5,
            size_px: [160, 120],
            interval_ns: 66_666_667,
        }
    }
}

impl Optics {
    /// Focal length, px.
    #[must_use]
    pub fn focal_px(&self) -> f64 {
        f64::from(self.size_px[0]) / 2.0 / (self.field_of_view_rad / 2.0).tan()
    }

    /// Row of the horizon, px.
    #[must_use]
    pub fn horizon_px(&self) -> f64 {
        self.horizon_share * f64::from(self.size_px[1])
    }
}
