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

impl Optics {
    /// The camera that a deployment has.
    #[must_use]
    pub fn of_settings(camera: &settings::Camera) -> Self {
        let yaw_rad = camera.heading_deg.get().to_radians();
        Self {
            mount: Pose { x_m: camera.x_m.get(), y_m: camera.y_m.get(), yaw_rad },
            height_m: camera.height_m.get(),
            field_of_view_rad: camera.field_of_view_deg.get().to_radians(),
            horizon_share: camera.horizon_share.get(),
            size_px: [camera.width.get(), camera.height.get()],
            interval_ns: (1e9 / camera.rate_hz.get()).round() as u64,
        }
    }

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
