//! A drive through localisation, in this process, and what comes of it.

use std::collections::BTreeMap;

use localisation::{Localisation, Moved, Parameters, ParametersError};
use messages::{FilterVerdict, Layer, Pose};
use serde::Serialize;

use crate::drive::Drive;
use crate::judge::{FilterError, mapped};
use crate::occupancy::Occupancy;
use crate::score::Labels;
use crate::trajectory::TrajectoryError;

/// A closure counts as recognised from this weight on: below it, the robust estimate holds it for a mistake.
const RECOGNISED: f64 = 0.3;

/// The poses of a drive as a consumer receives them, one for each scan, map frame.
#[derive(Debug, Clone)]
pub struct Localised {
    /// As scans enter the map, at the horizon.
    pub commit: Vec<Pose>,
    /// After the last revision.
    pub last: Vec<Pose>,
    /// Places recognised.
    pub closures: usize,
    /// Revisions of poses that were answered before.
    pub revisions: usize,
}

impl Localised {
    /// Runs localisation over the scans of a drive.
    ///
    /// # Errors
    /// Parameters out of range.
    pub fn of(drive: &Drive, parameters: Parameters) -> Result<Self, ParametersError> {
        let mut localisation = Localisation::new(parameters)?;
        let mut answers: Vec<_> = drive.scans.iter().map(|scan| localisation.step(scan.seq, scan.stamp_ns, &scan.scan)).collect();
        answers.push(localisation.finish());
        let mut last: BTreeMap<u64, Pose> = BTreeMap::new();
        let (mut commit, mut revisions) = (Vec::new(), 0);
        for answer in &answers {
            if let Some(revision) = &answer.revision {
                revisions += 1;
                revision.moved.iter().for_each(|moved| revise(&mut last, moved));
            }
            for smoothed in &answer.smoothed {
                commit.push(smoothed.map_from_robot.to_wire());
                last.insert(smoothed.seq, smoothed.map_from_robot.to_wire());
            }
        }
        let closures = localisation.closures().filter(|closure| closure.weight > RECOGNISED).count();
        Ok(Self { commit, last: last.into_values().collect(), closures, revisions })
    }
}

fn revise(poses: &mut BTreeMap<u64, Pose>, moved: &Moved) {
    let motion = moved.now.then(&moved.before.inverse()).to_wire();
    poses.range_mut(moved.first..=moved.last).for_each(|(_, pose)| *pose = motion.then(pose));
}

/// The same drive by true poses, by odometry alone, and by the poses of localisation.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct ByPoses<T> {
    /// By the true poses.
    pub exact: T,
    /// By odometry.
    pub odometry: T,
    /// By the poses at which scans enter the map.
    pub commit: T,
    /// By the poses after the last revision.
    pub last: T,
}

/// How good localisation is in one drive.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct LocalisationScore {
    /// Length of the true path, m.
    pub path_m: f64,
    /// The trajectories; exact is 0.
    pub error: ByPoses<TrajectoryError>,
    /// F1 of the map's occupied cells against the surfaces, under the same verdicts.
    pub f1: ByPoses<f64>,
    /// Places recognised.
    pub closures: usize,
    /// Revisions of poses that were answered before.
    pub revisions: usize,
}

impl LocalisationScore {
    /// Scores what localisation made of a drive whose filter gave these verdicts.
    ///
    /// # Errors
    /// Parameters or verdicts that the mapper refuses.
    pub fn of(
        drive: &Drive,
        localised: &Localised,
        verdicts: &[FilterVerdict],
        parameters: &mapping::Parameters,
    ) -> Result<Self, FilterError> {
        let (truth, odometry) = (drive.true_poses(), drive.odometry());
        let map = |poses: &[Pose]| mapped(&drive.placed(poses), parameters, verdicts);
        let exact = map(&truth)?;
        let (labels, reference) = (Labels::new(&drive.truth, exact.cell_size()), Occupancy::of(&exact, Layer::Filtered));
        let f1 = |poses: &[Pose]| -> Result<f64, FilterError> {
            let map = Occupancy::of(&map(poses)?, Layer::Filtered);
            Ok(labels.tally(&map, &map, &map, &reference).score().f1)
        };
        let error = |poses: &[Pose]| TrajectoryError::of(poses, &truth);
        let Localised { commit, last, closures, revisions } = localised;
        Ok(Self {
            path_m: truth.windows(2).map(|pair| (pair[0].x_m - pair[1].x_m).hypot(pair[0].y_m - pair[1].y_m)).sum(),
            error: ByPoses { exact: TrajectoryError::default(), odometry: error(&odometry), commit: error(commit), last: error(last) },
            f1: ByPoses { exact: f1(&truth)?, odometry: f1(&odometry)?, commit: f1(commit)?, last: f1(last)? },
            closures: *closures,
            revisions: *revisions,
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests fail by panicking")]
    use super::*;
    use crate::judge::unfiltered;
    use crate::variation::{Variation, read_world};
    use simulator::Body;
    use simulator::quantity::{ErrorShare, HeadingWander};
    use simulator::world::OdometryError;

    #[test]
    fn a_map_is_made_by_poses_that_jump() {
        let corridor = include_str!("../../../config/worlds/corridor.toml");
        let world = read_world(corridor, Variation { walkers: Some(0), seed: 7, stand_s: None }).unwrap();
        let drive = Drive::through(&world, &Body::of(&psos::MODELS[0]), 3.0, None, 7);
        let mut poses = drive.true_poses();
        let half = poses.len() / 2;
        poses.iter_mut().skip(half).for_each(|pose| pose.y_m += 5.0);
        let mapper = mapped(&drive.placed(&poses), &mapping::Parameters::default(), &unfiltered(&drive)).unwrap();
        assert_eq!(
            mapper.counts().readings,
            mapped(&drive, &mapping::Parameters::default(), &unfiltered(&drive)).unwrap().counts().readings
        );
    }

    #[test]
    fn localisation_puts_a_map_right_that_odometry_bends() {
        let corridor = include_str!("../../../config/worlds/corridor.toml");
        let mut world = read_world(corridor, Variation { walkers: Some(0), seed: 7, stand_s: None }).unwrap();
        world.odometry = OdometryError {
            distance_share: ErrorShare::new(0.02).unwrap(),
            turn_share: ErrorShare::new(0.04).unwrap(),
            wander_deg: HeadingWander::new(3.0).unwrap(),
        };
        let drive = Drive::through(&world, &Body::of(&psos::MODELS[0]), 3.0, None, 7);
        let localised = Localised::of(&drive, Parameters { enabled: true, ..Parameters::default() }).unwrap();
        assert_eq!((localised.commit.len(), localised.last.len()), (drive.scans.len(), drive.scans.len()));
        let score = LocalisationScore::of(&drive, &localised, &unfiltered(&drive), &mapping::Parameters::default()).unwrap();
        let LocalisationScore { error, f1, .. } = score;
        assert!(error.odometry.distance_m > 3.0 * error.last.distance_m && error.last.distance_m < 0.06, "{score:?}");
        assert!(f1.exact - f1.last < 0.05 && f1.last - f1.odometry > 0.2, "{score:?}");
    }
}
