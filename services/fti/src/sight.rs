//! Where a blob is ("Where a blob is": the cues *ground* and *paper*).

use messages::{Blob, CameraMotion};

use crate::parameters::{Camera, Cue, Parameters};
use crate::tables::Seen;

/// From the front of a body, where its feet are seen, to its middle, m.
/// Half: 84.9 % / 1.19 %, twice: 86.6 % / 1.16 %.
const FEET_TO_MIDDLE_M: f64 = 0.12;
/// Pixels are counted in pictures this wide.
/// Half: 82.8 % / 1.22 %, twice: 86.3 % / 1.36 %.
const WIDTH_PX: f64 = 160.0;
/// Feet this close to the horizon tell no distance, px.
/// Half: 85.0 % / 1.32 %, twice: 81.5 % / 1.34 %.
const NEAR_HORIZON_PX: f64 = 4.5;
/// Width of one walker or of two beside each other, m.
const BODY_M: std::ops::RangeInclusive<f64> = 0.2..=1.2;
/// Depth of a body whose feet are below the picture, and its spread, as shares of the depth at which feet leave it.
const BELOW_SHARE: [f64; 2] = [0.75, 0.28];

/// One number with its variance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Estimate {
    pub(crate) value: f64,
    pub(crate) variance: f64,
}

/// What a blob tells of a walker, in the camera's frame (x along its axis, y to the left).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sight {
    /// rad, to the left.
    pub(crate) bearing: Estimate,
    /// Width of the blob as an angle, rad.
    pub(crate) width_rad: f64,
    /// From its left edge to its right one as bearings, rad.
    pub(crate) extent_rad: [f64; 2],
    /// Along the camera's axis, m, when the feet tell.
    pub(crate) depth: Option<Estimate>,
    /// The feet are below the picture.
    pub(crate) feet_below: bool,
    /// It stands on the floor, reaches above the horizon and is as wide as a body: a walker, not a reflection on the
    /// floor or a flicker on a wall.
    pub(crate) upright: bool,
}

/// The camera behind one picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct View {
    width_px: f64,
    height_px: f64,
    /// Focal length, px.
    focal_px: f64,
    horizon_px: f64,
    camera_height_m: f64,
}

impl View {
    /// `None` for a picture without size.
    pub(crate) fn new(camera: &Camera, frame: &CameraMotion) -> Option<Self> {
        if frame.width == 0 || frame.height == 0 {
            return None;
        }
        let (width_px, height_px) = (f64::from(frame.width), f64::from(frame.height));
        Some(Self {
            width_px,
            height_px,
            focal_px: width_px / 2.0 / (camera.field_of_view_rad / 2.0).tan(),
            horizon_px: camera.horizon_share * height_px,
            camera_height_m: camera.height_m,
        })
    }

    /// Bearing of a column, rad to the left.
    fn bearing_rad(&self, u_px: f64) -> f64 {
        (self.width_px / 2.0 - u_px).atan2(self.focal_px)
    }

    /// What a blob tells.
    pub(crate) fn sight(&self, blob: &Blob) -> Sight {
        let scale = self.width_px / WIDTH_PX;
        let blob_px = f64::from(blob.right_px) - f64::from(blob.left_px);
        let cut = blob.left_px == 0 || f64::from(blob.right_px) >= self.width_px;
        let bearing_rad = self.bearing_rad(f64::from(blob.u_px));
        let spread_px = 4.0 * scale + 0.08 * blob_px + if cut { 0.25 * blob_px } else { 0.0 };
        // A pixel aside of the axis spans a smaller angle.
        let per_px = bearing_rad.cos().powi(2) / self.focal_px;
        let feet_below = f64::from(blob.bottom_px) >= self.height_px - 1.0;
        let depth = self.depth(f64::from(blob.bottom_px), feet_below, scale);
        let body_m = depth.map(|depth| blob_px * depth.value / self.focal_px);
        let as_wide = feet_below || cut || body_m.is_some_and(|body_m| BODY_M.contains(&body_m));
        let upright = as_wide && depth.is_some() && f64::from(blob.top_px) < self.horizon_px - NEAR_HORIZON_PX * scale;
        Sight {
            upright,
            bearing: Estimate { value: bearing_rad, variance: (spread_px * per_px).powi(2) },
            width_rad: blob_px * per_px,
            extent_rad: [self.bearing_rad(f64::from(blob.left_px)), self.bearing_rad(f64::from(blob.right_px))],
            depth,
            feet_below,
        }
    }

    fn depth(&self, bottom_px: f64, feet_below: bool, scale: f64) -> Option<Estimate> {
        let fh = self.focal_px * self.camera_height_m;
        let below_px = bottom_px - self.horizon_px;
        if feet_below {
            let leaves_m = fh / (self.height_px - self.horizon_px).max(1.0);
            let [value, spread] = BELOW_SHARE.map(|share| share * leaves_m);
            return Some(Estimate { value, variance: spread * spread });
        }
        if below_px < NEAR_HORIZON_PX * scale {
            return None;
        }
        let depth_m = fh / below_px;
        // Body and step, calibration, pixels; doubled because the errors of one frame are those of the next.
        let spread = [0.12, 0.1 * depth_m, 2.5 * scale * depth_m * depth_m / fh];
        let variance: f64 = spread.iter().map(|s| s * s).sum();
        Some(Estimate { value: depth_m + FEET_TO_MIDDLE_M, variance: 4.0 * variance })
    }

    /// `B_Centroid` and `B_Size`, in m and px of the camera's frame. `None` where the cue tells no place.
    pub(crate) fn b(&self, cue: Cue, blob: &Blob, parameters: &Parameters) -> Option<Seen> {
        let size = f64::from(blob.size_px);
        match cue {
            Cue::Paper => {
                let x = (self.height_px - f64::from(blob.v_px)) * parameters.range_limit_m / self.height_px;
                let y = (self.width_px / 2.0 - f64::from(blob.u_px)) * parameters.cone_width_m() / self.width_px;
                Some(Seen { x, y, size })
            }
            Cue::Ground => {
                let sight = self.sight(blob);
                let depth = sight.depth?;
                Some(Seen { x: depth.value, y: depth.value * sight.bearing.value.tan(), size })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view() -> View {
        View::new(&Camera::default(), &CameraMotion { width: 160, height: 120, ..CameraMotion::default() }).unwrap()
    }

    fn blob(u_px: f32, bottom_px: u32) -> Blob {
        Blob { u_px, v_px: 60.0, size_px: 500, left_px: u_px as u32 - 10, right_px: u_px as u32 + 10, top_px: 0, bottom_px, reserved: 0 }
    }

    #[test]
    fn feet_tell_the_distance() {
        // 70° over 160 px: f = 114.25 px; the foot 20 px under the horizon: X = 114.25 · 0.3 / 20.
        let b = view().b(Cue::Ground, &blob(40.0, 80), &Parameters::default()).unwrap();
        assert!((b.x - (1.714 + FEET_TO_MIDDLE_M)).abs() < 0.002, "{b:?}");
        assert!((b.y - b.x * 40.0 / 114.25).abs() < 0.002 && b.size == 500.0, "{b:?}");
    }

    #[test]
    fn feet_at_the_horizon_give_no_distance() {
        assert_eq!(view().sight(&blob(80.0, 64)).depth, None);
        let below = view().sight(&blob(80.0, 120));
        assert!(below.feet_below && (0.3..0.55).contains(&below.depth.unwrap().value));
    }

    #[test]
    fn by_the_paper_rows_are_distances() {
        let b = view().b(Cue::Paper, &blob(40.0, 80), &Parameters::default()).unwrap();
        assert_eq!(b.x, 1.5);
        assert!((b.y - 0.25 * Parameters::default().cone_width_m()).abs() < 1e-9);
    }
}
