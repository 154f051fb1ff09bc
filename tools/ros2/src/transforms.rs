//! Frames of a robot and how they are mounted.

use std::collections::BTreeMap;

use messages::Pose;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use crate::interfaces;

/// More frames than a chain has: a circle is no chain.
const MAX_DEPTH: usize = 64;

/// The parts of a robot that are fixed to each other.
#[derive(Debug, Clone, Default)]
pub(crate) struct Mounts {
    /// Parent and place in the parent, by frame.
    parents: BTreeMap<String, (String, Isometry3<f64>)>,
}

impl Mounts {
    /// Adds that `child` is mounted on `parent`; the first that is said holds.
    pub(crate) fn add(&mut self, parent: &str, child: &str, parent_from_child: Isometry3<f64>) {
        self.parents.entry(frame(child)).or_insert_with(|| (frame(parent), parent_from_child));
    }

    /// The place of `part` in the frame `base`; `None` when they are not connected.
    pub(crate) fn base_from(&self, base: &str, part: &str) -> Option<Isometry3<f64>> {
        let above_base = self.chain(base);
        self.chain(part).into_iter().find_map(|(common, common_from_part)| {
            let (_, common_from_base) = above_base.iter().find(|(above, _)| *above == common)?;
            Some(common_from_base.inverse() * common_from_part)
        })
    }

    /// The frame itself and those above it, with its place in each.
    fn chain(&self, part: &str) -> Vec<(String, Isometry3<f64>)> {
        let mut chain = vec![(frame(part), Isometry3::identity())];
        while let Some((last, place)) = chain.last().filter(|_| chain.len() < MAX_DEPTH) {
            let Some((parent, parent_from_last)) = self.parents.get(last) else { break };
            let next = (parent.clone(), parent_from_last * place);
            chain.push(next);
        }
        chain
    }
}

/// The name of a frame: ROS 1 began it with a slash.
pub(crate) fn frame(name: &str) -> String {
    name.trim_start_matches('/').to_owned()
}

/// A pose in space; `None` when its numbers are none.
pub(crate) fn isometry(pose: &interfaces::Pose) -> Option<Isometry3<f64>> {
    let (at, turn) = (pose.position, pose.orientation);
    let numbers = [at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w];
    let quaternion = Quaternion::new(turn.w, turn.x, turn.y, turn.z);
    // A robot without orientation leaves all four at 0.
    let norm = quaternion.norm();
    if numbers.iter().any(|number| !number.is_finite()) || norm < 0.5 {
        return None;
    }
    // A unit quaternion stays as it is, bit for bit.
    let rotation =
        if (norm - 1.0).abs() < 1e-9 { UnitQuaternion::new_unchecked(quaternion) } else { UnitQuaternion::new_normalize(quaternion) };
    Some(Isometry3::from_parts(Translation3::new(at.x, at.y, at.z), rotation))
}

/// The pose in the plane: where the x axis points, seen from above.
pub(crate) fn planar(place: &Isometry3<f64>) -> Pose {
    let ahead = place.rotation * Vector3::x();
    Pose { x_m: place.translation.x, y_m: place.translation.y, yaw_rad: ahead.y.atan2(ahead.x) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    fn place(x: f64, yaw: f64) -> Isometry3<f64> {
        Isometry3::new(Vector3::new(x, 0.0, 0.2), Vector3::new(0.0, 0.0, yaw))
    }

    #[test]
    fn a_mount_is_found_along_the_chain_of_frames() {
        let mut mounts = Mounts::default();
        mounts.add("base_footprint", "/base_link", place(0.0, 0.0));
        mounts.add("base_link", "ring", place(0.1, FRAC_PI_2));
        mounts.add("ring", "sonar", place(0.2, 0.0));
        for base in ["base_footprint", "base_link"] {
            let mount = planar(&mounts.base_from(base, "sonar").unwrap());
            assert!((mount.x_m - 0.1).abs() < 1e-12 && (mount.y_m - 0.2).abs() < 1e-12 && (mount.yaw_rad - FRAC_PI_2).abs() < 1e-12);
        }
        assert!(mounts.base_from("base_link", "lidar").is_none());
    }

    #[test]
    fn a_circle_of_frames_ends() {
        let mut mounts = Mounts::default();
        mounts.add("a", "b", place(1.0, 0.0));
        mounts.add("b", "a", place(1.0, 0.0));
        assert!(mounts.base_from("c", "a").is_none());
    }

    #[test]
    fn a_pose_without_orientation_is_refused() {
        let mut pose = interfaces::Pose { position: interfaces::Vector3::default(), orientation: interfaces::Quaternion::default() };
        assert!(isometry(&pose).is_some());
        pose.orientation.w = 0.0;
        assert!(isometry(&pose).is_none());
        pose.orientation.w = f64::NAN;
        assert!(isometry(&pose).is_none());
    }
}
