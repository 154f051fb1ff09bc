//! What FTI gives: verdicts, those to come, and the walkers that are followed.

use geometry::CellSize;
use messages::{FilterAction, FilterVerdict, MAX_REGIONS, TrackedWalker, Walkers};

use crate::evidence::LogLikelihoods;
use crate::parameters::{Action, Parameters, Rule};
use crate::pending::{PendingReading, PendingScan};
use crate::tracks::Tracks;

/// The verdict on one scan.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// The scan's number.
    pub seq: u64,
    /// The scan's time.
    pub stamp_ns: u64,
    /// What is to be done with its readings.
    pub verdict: FilterVerdict,
    /// Why, for each reading in order.
    pub likelihoods: Vec<LogLikelihoods>,
}

impl Verdict {
    /// On a scan, on these grounds.
    pub(crate) fn new(parameters: &Parameters, cell: CellSize, scan: &PendingScan, likelihoods: Vec<LogLikelihoods>) -> Self {
        let mut verdict = FilterVerdict { inputs: scan.inputs, ..FilterVerdict::default() };
        match parameters.action {
            Action::Withhold => verdict.withheld = withheld(parameters, cell, scan, &likelihoods),
            Action::Free => verdict.action = FilterAction::Free as u32,
        }
        for (slot, region) in verdict.regions.iter_mut().zip(&scan.regions).take(MAX_REGIONS) {
            *slot = region.message();
            verdict.count += 1;
        }
        Self { seq: scan.seq, stamp_ns: scan.stamp_ns, verdict, likelihoods }
    }
}

/// Bit i set: reading i of a scan is taken out of the map.
pub(crate) fn withheld(parameters: &Parameters, cell: CellSize, scan: &PendingScan, likelihoods: &[LogLikelihoods]) -> u32 {
    let readings = scan.readings.iter().zip(likelihoods).enumerate();
    readings.map(|(index, (reading, likelihoods))| u32::from(withholds(parameters, cell, scan, reading, likelihoods)) << index).sum()
}

/// Whether a reading is taken out of the map.
fn withholds(parameters: &Parameters, cell: CellSize, scan: &PendingScan, reading: &PendingReading, likelihoods: &LogLikelihoods) -> bool {
    reading.beam.echo()
        && match parameters.rule {
            Rule::Likelihood => parameters.prior_log_odds + likelihoods.balance() > 0.0,
            Rule::Paper => scan.regions.iter().any(|region| region.entered_by(&reading.beam, &reading.arc, cell)),
        }
}

/// The walkers who are certain.
pub(crate) fn walkers(tracks: &Tracks) -> Walkers {
    let mut message = Walkers::default();
    let is_confirmed = tracks.tracks.iter().filter(|track| track.ended_ns.is_none() && track.confirmed());
    for (slot, track) in message.walkers.iter_mut().zip(is_confirmed) {
        let ([x_m, y_m], [velocity_x_m_s, velocity_y_m_s]) = (track.motion.place_m().into(), track.motion.velocity_m_s().into());
        *slot = TrackedWalker { x_m, y_m, velocity_x_m_s, velocity_y_m_s, track: track.id };
        message.count += 1;
    }
    message
}
