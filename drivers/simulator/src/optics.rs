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

/// How far the camera as built is from the camera as it is taken to be. The seed decides each direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CalibrationError {
    /// Share of the focal length.
    pub focal_share: f64,
    /// Row of the horizon, px.
    pub horizon_px: f64,
    /// Height above the floor, m.
    pub height_m: f64,
}

impl CalibrationError {
    /// The camera is as it is taken to be.
    pub const NONE: Self = Self { focal_share: 0.0, horizon_px: 0.0, height_m: 0.0 };
}

impl Default for CalibrationError {
    /// A camera that was mounted with a tape measure and a data sheet.
    fn default() -> Self {
        Self { focal_share: 0.03, horizon_px: 2.0, height_m: 0.03 }
    }
}

impl Optics {
    /// The camera as built, for a camera that is taken to be this one.
    #[must_use]
    pub fn as_built(&self, error: &CalibrationError, seed: u64) -> Self {
        let towards = |bit: u64| if seed >> bit & 1 == 0 { 1.0 } else { -1.0 };
        let focal_px = self.focal_px() * (1.0 + towards(0) * error.focal_share);
        let horizon_px = self.horizon_px() + towards(1) * error.horizon_px;
        Self {
            height_m: (self.height_m + towards(2) * error.height_m).max(0.01),
            field_of_view_rad: 2.0 * (f64::from(self.size_px[0]) / 2.0 / focal_px).atan(),
            horizon_share: horizon_px / f64::from(self.size_px[1]),
            ..*self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calibration_errors_have_the_directions_of_the_seed() {
        let nominal = Optics::default();
        assert_eq!(nominal.as_built(&CalibrationError::NONE, 5).height_m, nominal.height_m);
        for (seed, signs) in [(0, [1.0, 1.0, 1.0]), (1, [-1.0, 1.0, 1.0]), (2, [1.0, -1.0, 1.0]), (4, [1.0, 1.0, -1.0])] {
            let built = nominal.as_built(&CalibrationError::default(), seed);
            let off =
                [built.focal_px() / nominal.focal_px() - 1.0, built.horizon_px() - nominal.horizon_px(), built.height_m - nominal.height_m];
            for ((off, sign), size) in off.iter().zip(signs).zip([0.03, 2.0, 0.03]) {
                assert!((off - sign * size).abs() < 1e-9, "seed {seed}: {off}, expected {}", sign * size);
            }
        }
    }
}
