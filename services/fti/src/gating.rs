//! What the camera has to do with a scan: whether it is at work, what it looks at, and which of its blobs are of the scan's time.

use geometry::{Beam, wrapped};
use messages::{CameraMotion, Payload, Pose};
use nalgebra::{Matrix2, Vector2};
use tracking::Motion;

use crate::parameters::{Camera, Parameters};
use crate::sight::View;
use crate::streams::Frame;
use crate::tables::{PAPER_PIXELS, Seen};

/// A camera whose last frame is this old is not at work, ns.
/// Seven frames at 15 Hz: a camera that has published none of them is taken to have failed. Half or twice of it gives the same verdicts.
const AT_WORK_NS: u64 = 500_000_000;
/// Blobs this far from a scan are of its time, ns.
/// Two frames at 15 Hz. It concerns the method of the paper only. Half or twice of it gives the same verdicts.
const PAIRING_NS: u64 = 150_000_000;
/// The camera sees no walker beyond this, m.
/// Half: 84.9 % / 1.66 %, twice: 85.0 % / 1.35 %.
const SIGHT_M: f64 = 6.0;
/// A track this close to the side of the picture may be out of it, rad.
/// Half: 85.0 % / 1.35 %, twice: 85.6 % / 2.84 %.
const SIDE_RAD: f64 = 0.05;

/// Whether the last frame, at `frame_ns` (0: none), is younger than `within_ns` at the time of a scan.
pub(crate) fn is_fresh(frame_ns: u64, stamp_ns: u64, within_ns: u64) -> bool {
    frame_ns != 0 && stamp_ns.saturating_sub(frame_ns) < within_ns
}

/// Whether the camera is at work at the time of a scan.
pub(crate) fn is_at_work(frame_ns: u64, stamp_ns: u64) -> bool {
    is_fresh(frame_ns, stamp_ns, AT_WORK_NS)
}

/// Whether the camera should see a walker.
pub(crate) fn in_view(camera: &Camera, map_from_camera: &Pose, motion: &Motion) -> bool {
    let place = motion.place_m();
    let towards = Vector2::new(place.x - map_from_camera.x_m, place.y - map_from_camera.y_m);
    let bearing_rad = wrapped(towards.y.atan2(towards.x) - map_from_camera.yaw_rad);
    bearing_rad.abs() < camera.field_of_view_rad / 2.0 - SIDE_RAD && towards.norm() < SIGHT_M
}

/// Whether the camera looks at where an echo came from.
pub(crate) fn looks_at(camera: &Camera, map_from_robot: &Pose, beam: &Beam) -> bool {
    let [x, y] = beam.origin_m();
    let [cos, sin] = beam.axis();
    let place = Vector2::new(x + cos * beam.range_m(), y + sin * beam.range_m());
    in_view(camera, &map_from_robot.then(&camera.mount), &Motion::at(place, Matrix2::identity(), 0.0))
}

/// The robot between two scans, at a time after the first; each scan has its time and its pose.
pub(crate) fn robot_at(stamp_ns: u64, (last_ns, last): (u64, Pose), (now_ns, now): (u64, Pose)) -> Pose {
    let whole_ns = now_ns.saturating_sub(last_ns).max(1);
    let share = (stamp_ns.saturating_sub(last_ns) as f64 / whole_ns as f64).clamp(0.0, 1.0);
    let between = |from: f64, to: f64| from + share * (to - from);
    let turned = wrapped(now.yaw_rad - last.yaw_rad);
    Pose { x_m: between(last.x_m, now.x_m), y_m: between(last.y_m, now.y_m), yaw_rad: last.yaw_rad + share * turned }
}

/// B of the frame that belongs to a scan, in the robot frame.
pub(crate) fn blobs(parameters: &Parameters, frames: &[Frame], stamp_ns: u64) -> Vec<Seen> {
    let Some(camera) = parameters.camera else { return Vec::new() };
    let is_of_the_scan = |frame: &&Frame| stamp_ns.saturating_sub(frame.stamp_ns) <= PAIRING_NS && frame.motion.validate().is_ok();
    let Some(frame) = frames.iter().rev().find(is_of_the_scan) else { return Vec::new() };
    let Some(view) = View::new(&camera, &frame.motion) else { return Vec::new() };
    let seen = frame.motion.blobs().iter().filter_map(|blob| view.b(parameters.cue, blob, parameters));
    seen.map(|b| in_robot_frame(&camera, &b, &frame.motion)).collect()
}

fn in_robot_frame(camera: &Camera, b: &Seen, frame: &CameraMotion) -> Seen {
    let place = camera.mount.then(&Pose { x_m: b.x, y_m: b.y, yaw_rad: 0.0 });
    let picture_px = f64::from(frame.width) * f64::from(frame.height);
    Seen { x: place.x_m, y: place.y_m, size: b.size * PAPER_PIXELS / picture_px.max(1.0) }
}
