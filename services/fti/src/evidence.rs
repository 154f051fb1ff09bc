//! What the readings say: those that wait for their verdict, those that got it lately, and the past of every cell.

use geometry::{Beam, Cell, CellSize, Lattice};
use messages::FilterVerdict;
use state::Queue;

use crate::arc::Arc;
use crate::dwell::Runs;
use crate::pending::{PendingReading, PendingScan};
use crate::smoothed::Smoothed;
use crate::still::Still;
use crate::tracks::Tracks;
use crate::verdict::{presences, untracked_walker, walker, weight};

/// Radius of the floor that the robot itself takes, m.
/// A Pioneer is 0.33 m wide. Half: 85.0 % / 1.35 %, twice: 85.0 % / 1.35 %.
const ROBOT_RADIUS_M: f64 = 0.2;
/// A scan with its verdict is known reading by reading for this time, ns: as long as the robot takes to pass a place.
/// Half: 84.8 % / 1.28 %, twice: 84.9 % / 1.27 %.
const RECENT_NS: u64 = 6_000_000_000;
/// Where a walker was confirmed, others may be for this time, ns.
/// Half: 85.0 % / 1.34 %, twice: 85.0 % / 1.35 %.
const RECENT_TRACK_NS: u64 = 20_000_000_000;
/// What stayed in a beam for longer is no passer-by, s.
/// Half: 85.0 % / 1.30 %, twice: 85.0 % / 1.36 %.
const MOST_DWELL_S: f64 = 3.0;

/// The two sides of the likelihood ratio.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogLikelihoods {
    /// T: a walker was there.
    pub walker: f64,
    /// S: something stands there.
    pub still: f64,
}

impl LogLikelihoods {
    /// Above 0: a walker is likelier.
    pub(crate) fn balance(self) -> f64 {
        self.walker - self.still
    }
}

/// What the pending readings say, scan by scan.
pub(crate) struct Weighed {
    /// T of each reading.
    odds: Vec<Vec<f64>>,
    /// How much each counts as a hit.
    weights: Vec<Vec<f64>>,
}

/// All readings that verdicts rest on.
#[derive(Debug, Clone)]
pub(crate) struct Evidence {
    pub(crate) still: Still,
    pub(crate) runs: Runs,
    /// Time of the last scan with a confirmed track that has walked.
    pub(crate) last_confirmed_track_ns: Option<u64>,
    /// Scans that wait for their verdict, the oldest first.
    pub(crate) pending: Queue<PendingScan>,
    /// Those decided lately, the oldest first: what they say is still known reading by reading.
    pub(crate) recent: Queue<PendingScan>,
}

impl Evidence {
    pub(crate) fn new(cell: CellSize) -> Self {
        Self {
            still: Still::new(Lattice::new(cell)),
            runs: Runs::default(),
            last_confirmed_track_ns: None,
            pending: Queue::default(),
            recent: Queue::default(),
        }
    }

    /// Forgets everything that has a place.
    pub(crate) fn forget_places(&mut self) {
        self.still.forget();
        self.runs = Runs::default();
        self.recent = Queue::default();
    }

    /// A scan that waits for its verdict from now on. Nothing stands where the robot does.
    pub(crate) fn push(&mut self, scan: PendingScan) {
        let [x_m, y_m] = scan.robot_m;
        self.still.stand(x_m, y_m, ROBOT_RADIUS_M, scan.stamp_ns);
        self.pending.push_back(scan);
    }

    /// S from the past alone.
    pub(crate) fn past(&self, beam: &Beam, cells: &[Cell]) -> f64 {
        let mut arc = Arc::new(&self.still, beam, cells);
        for scan in &self.recent {
            scan.readings.iter().for_each(|reading| arc.add(scan.stamp_ns, &reading.beam, reading.weight));
        }
        arc.balance()
    }

    /// What each pending reading says as evidence.
    pub(crate) fn weigh(&self, tracks: &Tracks, range_limit_m: f64) -> Weighed {
        let walkers: Vec<Smoothed> = tracks.tracks.iter().filter_map(Smoothed::of).collect();
        let of_scan = |scan: &PendingScan| {
            let present = presences(&walkers, scan.stamp_ns);
            scan.readings.iter().map(|reading| walker(reading, &present, range_limit_m)).collect()
        };
        let odds: Vec<Vec<f64>> = self.pending.iter().map(of_scan).collect();
        let of_scan = |(scan, odds): (&PendingScan, &Vec<f64>)| {
            let no_recent_track = self.no_recent_track(scan);
            let weight_of = |(reading, walker): (&PendingReading, &f64)| {
                weight(walker.max(untracked_walker(reading, self.runs.dwell_s(reading.run), no_recent_track)), reading.past)
            };
            scan.readings.iter().zip(odds).map(weight_of).collect()
        };
        let weights = self.pending.iter().zip(&odds).map(of_scan).collect();
        Weighed { odds, weights }
    }

    /// Both sides of the ratio for each reading of a pending scan: of a walker who is followed, or of a passer-by, whichever
    /// says more. How long an echo lasts is evidence of the untracked walker already, so its own run is no evidence against.
    pub(crate) fn likelihoods(&self, weighed: &Weighed, at: usize) -> Vec<LogLikelihoods> {
        let Some((scan, odds)) = self.pending.get(at).zip(weighed.odds.get(at)) else { return Vec::new() };
        let no_recent_track = self.no_recent_track(scan);
        let of_reading = |(index, (reading, walker)): (usize, (&PendingReading, &f64))| {
            let followed = LogLikelihoods { walker: *walker, still: self.stands(&weighed.weights, at, index, None) };
            let dwell_s = self.runs.dwell_s(reading.run);
            if dwell_s > MOST_DWELL_S {
                return followed;
            }
            let still = self.stands(&weighed.weights, at, index, Some(reading.run));
            let untracked_walker = LogLikelihoods { walker: untracked_walker(reading, dwell_s, no_recent_track), still };
            if followed.balance() > untracked_walker.balance() { followed } else { untracked_walker }
        };
        scan.readings.iter().zip(odds).enumerate().map(of_reading).collect()
    }

    /// Whether the camera was at work at a scan, and no track was confirmed for long before or since.
    fn no_recent_track(&self, scan: &PendingScan) -> bool {
        scan.inputs & FilterVerdict::FROM_CAMERA != 0
            && self.last_confirmed_track_ns.is_none_or(|last_ns| scan.stamp_ns > last_ns.saturating_add(RECENT_TRACK_NS))
    }

    /// S of a reading of a pending scan: by the past and by all other readings near in time, before and after, but for the hits
    /// of a run.
    fn stands(&self, weights: &[Vec<f64>], at: usize, index: usize, without_run: Option<u64>) -> f64 {
        let Some(asked) = self.pending.get(at).and_then(|scan| scan.readings.get(index)) else { return 0.0 };
        let mut arc = Arc::new(&self.still, &asked.beam, &asked.arc);
        let mut add = |stamp_ns: u64, reading: &PendingReading, weight: f64| {
            arc.add(stamp_ns, &reading.beam, if without_run == Some(reading.run) { 0.0 } else { weight });
        };
        for scan in &self.recent {
            scan.readings.iter().for_each(|reading| add(scan.stamp_ns, reading, reading.weight));
        }
        for (scan_at, (scan, weights)) in self.pending.iter().zip(weights).enumerate() {
            let readings = scan.readings.iter().zip(weights).enumerate();
            for (_, (reading, weight)) in readings.filter(|(other, _)| (scan_at, *other) != (at, index)) {
                add(scan.stamp_ns, reading, *weight);
            }
        }
        arc.balance()
    }

    /// The oldest pending scan gets its verdict on these grounds, which say how far its readings count as hits.
    pub(crate) fn decide(&mut self, likelihoods: &[LogLikelihoods]) -> Option<&PendingScan> {
        let mut scan = self.pending.pop_front()?;
        for (reading, likelihoods) in scan.readings.iter_mut().zip(likelihoods) {
            reading.weight = weight(likelihoods.walker, reading.past);
        }
        self.learn(scan);
        self.recent.back()
    }

    /// A scan has got its verdict; what those say that got theirs long ago becomes the past. Hits that a walker explains do not
    /// count; whether they were withheld plays no part: that would lock walls out for good.
    fn learn(&mut self, scan: PendingScan) {
        let oldest_ns = scan.stamp_ns.saturating_sub(RECENT_NS);
        self.recent.push_back(scan);
        while self.recent.front().is_some_and(|scan| scan.stamp_ns < oldest_ns) {
            let Some(scan) = self.recent.pop_front() else { return };
            for reading in &scan.readings {
                if reading.weight > 0.5 {
                    self.still.hit(&reading.arc, scan.stamp_ns);
                }
                self.still.free(&reading.beam, scan.stamp_ns);
            }
        }
    }
}
