//! A drive through STD, FTI and the mapper, in this process.

use mapping::{CommitRule, Mapper, PoseRule};
use messages::{EchoLabel, FilterVerdict, Layer, Pose, RobotEstimate, SmoothedPose, SonarMotion};
use stillmap_std::Std;

use crate::drive::Drive;
use crate::occupancy::Occupancy;
use crate::scan::Scan;

/// The algorithms as they are to be run.
#[derive(Debug, Clone, Default)]
pub struct Chain {
    /// STD.
    pub std: stillmap_std::Parameters,
    /// FTI.
    pub fti: fti::Parameters,
    /// The mapper; its commit rule and layers are those that judging needs.
    pub mapping: mapping::Parameters,
    /// Localisation; `None` where odometry is taken as exact.
    pub localisation: Option<localisation::Parameters>,
}

/// What STD and FTI said of a drive.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// STD's answer to each scan.
    pub motions: Vec<SonarMotion>,
    /// FTI's verdict on each scan, in their order.
    pub verdicts: Vec<FilterVerdict>,
    /// Why, for each reading of each scan.
    pub grounds: Vec<Vec<fti::LogLikelihoods>>,
    /// Places of FTI's certain tracks after each scan, map frame, m.
    pub tracks_m: Vec<Vec<[f64; 2]>>,
}

/// Parameters that STD, FTI, localisation or the mapper refuse.
#[derive(Debug, thiserror::Error)]
pub enum FilterError {
    /// STD's.
    #[error(transparent)]
    Std(#[from] stillmap_std::ParametersError),
    /// FTI's.
    #[error(transparent)]
    Fti(#[from] fti::ParametersError),
    /// Localisation's.
    #[error(transparent)]
    Localisation(#[from] localisation::ParametersError),
    /// The mapper's.
    #[error(transparent)]
    Mapping(#[from] mapping::ParametersError),
    /// The mapper refuses an input.
    #[error(transparent)]
    Refused(#[from] mapping::Refused),
}

/// Runs STD and FTI over a drive.
///
/// # Errors
/// Invalid parameters.
pub fn filter(drive: &Drive, chain: &Chain) -> Result<Outcome, FilterError> {
    let mut std = Std::new(chain.std)?;
    let mut fti = fti::Fti::new(chain.fti.clone())?;
    let mut outcome = Outcome { motions: Vec::new(), verdicts: Vec::new(), grounds: Vec::new(), tracks_m: Vec::new() };
    let mut frames = drive.frames.iter().peekable();
    for Scan { seq, stamp_ns, scan, .. } in &drive.scans {
        while let Some(frame) = frames.next_if(|frame| frame.stamp_ns <= *stamp_ns) {
            collect(&mut outcome, fti.step(fti::Input::Camera { stamp_ns: frame.stamp_ns, motion: &frame.motion }));
        }
        let motion = std.step(*stamp_ns, scan);
        collect(&mut outcome, fti.step(fti::Input::Scan { seq: *seq, stamp_ns: *stamp_ns, scan }));
        collect(&mut outcome, fti.step(fti::Input::Sonar { seq: *seq, motion: &motion }));
        outcome.motions.push(motion);
        outcome.tracks_m.push(fti.walkers().walkers().iter().map(|walker| [walker.x_m, walker.y_m]).collect());
    }
    collect(&mut outcome, fti.step(fti::Input::CameraEnded));
    collect(&mut outcome, fti.step(fti::Input::ScansEnded));
    Ok(outcome)
}

fn collect(outcome: &mut Outcome, verdicts: Vec<fti::Verdict>) {
    for verdict in verdicts {
        outcome.verdicts.push(verdict.verdict);
        outcome.grounds.push(verdict.likelihoods);
    }
}

/// The map of a drive under these verdicts.
///
/// # Errors
/// Parameters or verdicts that the mapper refuses.
pub fn judge(drive: &Drive, parameters: &mapping::Parameters, verdicts: &[FilterVerdict]) -> Result<Occupancy, FilterError> {
    Ok(Occupancy::of(&mapped(drive, parameters, verdicts)?, Layer::Filtered))
}

/// The mapper of a drive under these verdicts, with everything decided; its unfiltered layer is the map without verdicts.
///
/// # Errors
/// Parameters or verdicts that the mapper refuses.
pub fn mapped(drive: &Drive, parameters: &mapping::Parameters, verdicts: &[FilterVerdict]) -> Result<Mapper, FilterError> {
    let poses = if drive.scans.iter().any(|scan| scan.placed.is_some()) { PoseRule::Estimate } else { PoseRule::Odometry };
    let parameters = mapping::Parameters { commit: CommitRule::Verdict, poses, keep_unfiltered: true, ..parameters.clone() };
    let mut mapper = Mapper::new(&parameters)?;
    for (Scan { seq, stamp_ns, scan, placed, .. }, verdict) in drive.scans.iter().zip(verdicts) {
        mapper.step(mapping::Input::Scan { seq: *seq, stamp_ns: *stamp_ns, scan })?;
        if let Some(pose) = placed {
            mapper.step(mapping::Input::Estimate { seq: *seq, estimate: &estimate(*seq, *pose) })?;
        }
        mapper.step(mapping::Input::Verdict { seq: *seq, verdict })?;
    }
    mapper.step(mapping::Input::End)?;
    mapper.refresh();
    Ok(mapper)
}

/// That a scan is where this pose says.
fn estimate(seq: u64, pose: Pose) -> RobotEstimate {
    let mut estimate = RobotEstimate { count: 1, ..RobotEstimate::default() };
    estimate.smoothed[0] = SmoothedPose { seq, map_from_robot: pose, is_placed: 1, reserved: 0 };
    estimate
}

/// The verdicts of who knows where each echo came from: all that came from a walker, straight or by a mirror, are withheld.
#[must_use]
pub fn oracle(drive: &Drive) -> Vec<FilterVerdict> {
    let of_scan = |scan: &Scan| {
        let readings = &scan.truth.readings[..scan.truth.count as usize];
        let withheld = readings.iter().enumerate().map(|(index, reading)| u32::from(of_walker(reading)) << index).sum();
        FilterVerdict { withheld, ..FilterVerdict::default() }
    };
    drive.scans.iter().map(of_scan).collect()
}

/// Verdicts that keep everything.
#[must_use]
pub fn unfiltered(drive: &Drive) -> Vec<FilterVerdict> {
    vec![FilterVerdict::default(); drive.scans.len()]
}

pub(crate) fn of_walker(reading: &messages::TrueReading) -> bool {
    reading.label == EchoLabel::Walker as u32 || reading.label == EchoLabel::Ghost as u32 && reading.walker != 0
}
