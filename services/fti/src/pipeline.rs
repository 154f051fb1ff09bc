//! The algorithm of section 6, scan by scan: [`Fti::integrate`] is the way of one.

use geometry::{Beam, CellSize};
use messages::{FilterVerdict, MAX_OUTLOOK_SCANS, OutlookScan, Payload, Pose, SonarScan, StreamCursor, VerdictOutlook, Walkers};

use crate::answer::{self, Verdict};
use crate::evidence::Evidence;
use crate::gating::{blobs, is_at_work, looks_at, robot_at};
use crate::observe::SonarEcho;
use crate::parameters::{Parameters, ParametersError, Patience};
use crate::pending::{PendingReading, PendingScan};
use crate::region::update_regions;
use crate::streams::{Frame, Input, Streams, Waiting};
use crate::tables::Integration;
use crate::tracks::Tracks;

/// Half the depth of an arc, cells.
/// Half: 85.1 % / 1.54 %, twice: 83.5 % / 1.21 %.
const ARC_CELLS: f64 = 1.0;

/// Fuzzy-tuned integration over the streams of scans, sonar motion and camera motion.
#[derive(Debug, Clone)]
pub struct Fti {
    pub(crate) parameters: Parameters,
    pub(crate) cell: CellSize,
    pub(crate) integration: Integration,
    pub(crate) streams: Streams,
    pub(crate) tracks: Tracks,
    pub(crate) evidence: Evidence,
    /// Time and place of the robot at the last scan.
    pub(crate) last: Option<(u64, Pose)>,
    /// No scan is overdue.
    is_patient: bool,
}

impl Fti {
    /// Before the first input.
    ///
    /// # Errors
    /// Parameters out of range.
    pub fn new(parameters: Parameters) -> Result<Self, ParametersError> {
        let cell = parameters.check()?;
        let ranges = parameters.ranges();
        let found = ranges.width_m;
        let no_cone = ParametersError::OutOfRange { name: "the width of the sonar cone", found, expected: "a positive number" };
        Ok(Self {
            integration: Integration::new(&parameters.tables, &ranges).ok_or(no_cone)?,
            cell,
            streams: Streams::default(),
            tracks: Tracks::default(),
            evidence: Evidence::new(cell),
            last: None,
            is_patient: false,
            parameters,
        })
    }

    /// Takes one input; the verdicts that have become due, in the order of the scans.
    pub fn step(&mut self, input: Input<'_>) -> Vec<Verdict> {
        self.take(input);
        let mut verdicts = Vec::new();
        while self.advance(&mut verdicts) {}
        verdicts
    }

    /// Takes one input in; what can be done with it is left to [`Self::advance`].
    pub fn take(&mut self, input: Input<'_>) {
        self.streams.take_in(input);
    }

    /// Integrates the next scan if all that belongs to it is there or waited for no longer, and adds the verdicts that have
    /// become due; false when there is none. After the last scan everything that is pending is decided.
    pub fn advance(&mut self, verdicts: &mut Vec<Verdict>) -> bool {
        if let Some((scan, frames)) = self.streams.next(self.patience(), self.parameters.camera.is_some()) {
            self.integrate(&scan, &frames, verdicts);
            return true;
        }
        if self.streams.ended() {
            self.decide_until(u64::MAX, verdicts);
        }
        false
    }

    fn patience(&self) -> Patience {
        if self.is_patient { Patience::Endless } else { self.parameters.patience }
    }

    /// One scan and the frames since the last one, in the order of the paper: motion by both senses, correspondence, update
    /// regions; then the verdicts that are due.
    fn integrate(&mut self, scan: &Waiting, frames: &[Frame], verdicts: &mut Vec<Verdict>) {
        let (stamp_ns, pose) = (scan.stamp_ns, scan.scan.pose);
        if scan.scan.is_doubtful() {
            self.forget_places(verdicts);
        }
        self.follow_by_camera(scan, frames);
        let readings = self.readings(&scan.scan, stamp_ns);
        self.follow_by_sonar(scan, &readings);
        if self.tracks.alive().any(|track| track.confirmed() && track.walked) {
            self.evidence.last_confirmed_track_ns = Some(stamp_ns);
        }
        let blobs = blobs(&self.parameters, frames, stamp_ns);
        let regions = update_regions(&self.integration, &pose, scan.motion.movers(), &blobs, self.parameters.correspond_m);
        let (robot_m, inputs) = ([pose.x_m, pose.y_m], self.inputs(scan));
        self.evidence.push(PendingScan { seq: scan.seq, stamp_ns, robot_m, readings, regions, inputs });
        self.last = Some((stamp_ns, pose));

        let horizon_ns = (self.parameters.horizon_s * 1e9) as u64;
        self.decide_until(stamp_ns.saturating_sub(horizon_ns), verdicts);
        self.evidence.runs.forget(stamp_ns.saturating_sub(2 * horizon_ns));
        self.tracks.forget(stamp_ns.saturating_sub(2 * horizon_ns));
    }

    /// The poses from here on may be off against those before: what is pending is decided by what was known there, and new readings are
    /// not judged by the old places.
    fn forget_places(&mut self, verdicts: &mut Vec<Verdict>) {
        self.decide_until(u64::MAX, verdicts);
        self.evidence.forget_places();
        self.tracks.tracks.clear();
        self.last = None;
    }

    fn follow_by_camera(&mut self, scan: &Waiting, frames: &[Frame]) {
        let Some(camera) = self.parameters.camera else { return };
        let now = (scan.stamp_ns, scan.scan.pose);
        for frame in frames.iter().filter(|frame| frame.motion.validate().is_ok()) {
            let pose = self.last.map_or(now.1, |last| robot_at(frame.stamp_ns, last, now));
            self.tracks.see(&camera, &pose, frame.stamp_ns, &frame.motion);
        }
    }

    /// The readings of a scan; none where its numbers are not valid.
    fn readings(&mut self, scan: &SonarScan, stamp_ns: u64) -> Vec<PendingReading> {
        if scan.validate().is_err() {
            return Vec::new();
        }
        let camera = self.parameters.camera.filter(|_| is_at_work(self.tracks.frame_ns, stamp_ns));
        let readings = scan.readings().iter().map(|reading| {
            let beam = Beam::new(&scan.pose, reading, self.parameters.half_beam_rad);
            let arc = beam.arc(self.cell, ARC_CELLS * self.cell.metres());
            let watched = camera.is_some_and(|camera| looks_at(&camera, &scan.pose, &beam));
            let run = self.evidence.runs.add(reading.sonar, stamp_ns, &beam);
            PendingReading { past: self.evidence.past(&beam, &arc), watched, weight: 0.0, beam, run, arc }
        });
        readings.collect()
    }

    fn follow_by_sonar(&mut self, scan: &Waiting, readings: &[PendingReading]) {
        let runs = &self.evidence.runs;
        let of_readings = readings.iter().map(|PendingReading { beam, past, run, .. }| SonarEcho {
            beam,
            past: *past,
            run: *run,
            first: runs.is_first(*run, scan.stamp_ns),
        });
        let echoes: Vec<SonarEcho<'_>> = of_readings.collect();
        let motion = if scan.motion.validate().is_ok() { scan.motion.movers() } else { &[] };
        self.tracks.update_by_sonar(&self.parameters, &scan.scan.pose, scan.stamp_ns, &echoes, motion);
    }

    /// The inputs that came for a scan, as in `FilterVerdict`.
    fn inputs(&self, scan: &Waiting) -> u32 {
        let camera = is_at_work(self.tracks.frame_ns, scan.stamp_ns);
        (if scan.answered { FilterVerdict::FROM_SONAR } else { 0 }) | (if camera { FilterVerdict::FROM_CAMERA } else { 0 })
    }

    /// Gives the verdicts on the scans up to a time, with everything known now.
    fn decide_until(&mut self, until_ns: u64, verdicts: &mut Vec<Verdict>) {
        while self.evidence.pending.front().is_some_and(|scan| scan.stamp_ns <= until_ns) {
            let weighed = self.evidence.weigh(&self.tracks, self.parameters.range_limit_m);
            let likelihoods = self.evidence.likelihoods(&weighed, 0);
            let Some(scan) = self.evidence.decide(&likelihoods) else { return };
            verdicts.push(Verdict::new(&self.parameters, self.cell, scan, likelihoods));
        }
    }

    /// While true, a scan waits for all that belongs to it, whatever the patience: after a restart, what was sent before can come in any
    /// order.
    pub fn be_patient(&mut self, patient: bool) {
        self.is_patient = patient;
    }

    /// Takes streams that had ended to continue: the deployment was stopped and started again.
    pub fn reopen(&mut self) {
        self.streams.reopen();
    }

    /// Whether no more scans will come and every verdict has been given.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.streams.ended() && self.evidence.pending.is_empty()
    }

    /// The walkers that are followed at the last scan that was integrated: those who are certain.
    #[must_use]
    pub fn walkers(&self) -> Walkers {
        answer::walkers(&self.tracks)
    }

    /// The last scan that was integrated: its number and time; the verdict on it comes a horizon later, at once when there is no
    /// horizon.
    #[must_use]
    pub fn last_scan(&self) -> Option<StreamCursor> {
        self.evidence.pending.back().or(self.evidence.recent.back()).map(|scan| StreamCursor { seq: scan.seq, stamp_ns: scan.stamp_ns })
    }

    /// The verdicts to come as they stand now, on the newest pending scans.
    #[must_use]
    pub fn outlook(&self) -> VerdictOutlook {
        let mut outlook = VerdictOutlook::default();
        let (pending, weighed) = (&self.evidence.pending, self.evidence.weigh(&self.tracks, self.parameters.range_limit_m));
        let first = pending.len().saturating_sub(MAX_OUTLOOK_SCANS);
        for (slot, (at, scan)) in outlook.scans.iter_mut().zip(pending.iter().enumerate().skip(first)) {
            let withheld = answer::withheld(&self.parameters, self.cell, scan, &self.evidence.likelihoods(&weighed, at));
            *slot = OutlookScan { seq: scan.seq, withheld, reserved: 0 };
            outlook.count += 1;
        }
        outlook
    }
}
