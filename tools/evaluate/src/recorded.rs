//! A drive as a log has it: what every process said, and the truth beside it.

use messages::{FilterVerdict, SonarMotion, SonarScan, TrueReading, TruthScan, TruthSurfaces, Walkers};

use crate::drive::Drive;
use crate::judge::Outcome;
use crate::scan::Scan;
use crate::truth::Truth;

/// A scan is one of so many packets after the one of the scan before: more are never lost at once.
const MOST_PASSED: usize = 300;
/// What a range may differ by: it is sent in whole steps of about a millimetre.
const SAME_RANGE_M: f64 = 0.003;

/// A message with its number and stamp.
pub type Numbered<T> = (u64, u64, T);

/// The streams of a log, each in its order.
#[derive(Debug, Clone, Default)]
pub struct Recorded {
    /// Scans.
    pub scans: Vec<Numbered<SonarScan>>,
    /// STD's answers.
    pub motions: Vec<Numbered<SonarMotion>>,
    /// FTI's walkers.
    pub walkers: Vec<Numbered<Walkers>>,
    /// FTI's verdicts.
    pub verdicts: Vec<Numbered<FilterVerdict>>,
    /// The truth of each packet.
    pub truth: Vec<Numbered<TruthScan>>,
    /// The true surfaces, in pieces.
    pub surfaces: Vec<TruthSurfaces>,
}

/// A log that tells too little of the truth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NoTruth {
    /// There is no stream of truth.
    #[error("it carries no truth, expected that of a simulated drive")]
    Absent,
    /// The truth is of other packets.
    #[error("the truth of only {known} of {scans} scans is in it, expected that of nine in ten")]
    Scarce {
        /// Scans whose packet was found.
        known: usize,
        /// Scans of the log.
        scans: usize,
    },
}

impl Recorded {
    /// The drive with the truth beside each scan, and what the processes said of it. Scans without a truth are left out;
    /// where an answer is missing, nothing moved and nothing is withheld.
    ///
    /// # Errors
    /// When the truth is missing.
    pub fn assemble(&self) -> Result<(Drive, Outcome), NoTruth> {
        if self.truth.is_empty() || self.surfaces.is_empty() {
            return Err(NoTruth::Absent);
        }
        let scans = self.with_truth();
        if scans.len() * 10 < self.scans.len() * 9 {
            return Err(NoTruth::Scarce { known: scans.len(), scans: self.scans.len() });
        }
        let truth = Truth::new(&self.surfaces, &scans);
        let outcome = Outcome {
            motions: of_scans(&scans, &self.motions),
            verdicts: of_scans(&scans, &self.verdicts),
            grounds: Vec::new(),
            tracks_m: of_scans(&scans, &self.walkers).iter().map(places).collect(),
        };
        Ok((Drive { scans, frames: Vec::new(), truth }, outcome))
    }

    /// Each scan with the truth of its packet: the first of the next that says the same. Stamps do not help: a busy machine
    /// delays a packet by any time.
    fn with_truth(&self) -> Vec<Scan> {
        let mut scans = Vec::new();
        let mut from = 0;
        for (seq, stamp_ns, scan) in &self.scans {
            let mut next = self.truth.iter().enumerate().skip(from).take(MOST_PASSED);
            let found = next.find(|(_, (_, _, truth))| says_the_same(scan, truth));
            if let Some((at, (_, _, truth))) = found {
                from = at + 1;
                scans.push(Scan { seq: *seq, stamp_ns: *stamp_ns, scan: *scan, truth: *truth, placed: None });
            }
        }
        scans
    }
}

fn says_the_same(scan: &SonarScan, truth: &TruthScan) -> bool {
    let sent = &truth.readings[..(truth.count as usize).min(truth.readings.len())];
    let same = |reading: &messages::SonarReading, truth: &TrueReading| {
        reading.sonar == truth.sonar && (reading.echo == 0 || (reading.range_m - truth.range_m).abs() < SAME_RANGE_M)
    };
    sent.len() == scan.readings().len() && scan.readings().iter().zip(sent).all(|(reading, truth)| same(reading, truth))
}

/// The answer to each scan by its number.
fn of_scans<T: Copy + Default>(scans: &[Scan], answers: &[Numbered<T>]) -> Vec<T> {
    let of = |scan: &Scan| answers.binary_search_by_key(&scan.seq, |(seq, _, _)| *seq).ok().and_then(|at| answers.get(at));
    scans.iter().map(|scan| of(scan).map_or_else(T::default, |(_, _, answer)| *answer)).collect()
}

fn places(walkers: &Walkers) -> Vec<[f64; 2]> {
    walkers.walkers().iter().map(|walker| [walker.x_m, walker.y_m]).collect()
}
