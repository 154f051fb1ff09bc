//! The algorithm of section 6, scan by scan.

use std::collections::VecDeque;

use geometry::Beam;
use geometry::{Cell, CellSize, Lattice};
use messages::{
    FilterAction, FilterVerdict, MAX_OUTLOOK_SCANS, MAX_REGIONS, OutlookScan, Payload, Pose, SonarScan, TrackedWalker, VerdictOutlook,
    Walkers,
};
use nalgebra::{Matrix2, Vector2};
use tracking::Motion;

use crate::arc::Arc;
use crate::dwell::Runs;
use crate::hearing::Heard;
use crate::parameters::{Action, Camera, Parameters, ParametersError, Rule};
use crate::pending::{PendingReading, PendingScan};
use crate::region::update_regions;
use crate::sight::View;
use crate::smoothed::Smoothed;
use crate::still::Still;
use crate::streams::{Frame, Input, Streams, Waiting};
use crate::tables::{Integration, Ranges, Seen};
use crate::tracks::{Tracks, in_view};
use crate::verdict::{passer_by, presences, walker, weight};

/// Radius of the floor that the robot itself takes, m.
const ROBOT_RADIUS_M: f64 = 0.2;
/// Half the depth of an arc, cells.
const ARC_CELLS: f64 = 1.0;
/// A scan with its verdict is known reading by reading for this time, ns: as long as the robot takes to pass a place.
const RECENT_NS: u64 = 6_000_000_000;
/// Known to be free is all that matters, not for how long.
const LEAST_PAST: f64 = -3.0;
/// Blobs this far from a scan are of its time, ns.
const PAIRING_NS: u64 = 150_000_000;
/// Where somebody was about, others may be for this time, ns.
const COMPANY_NS: u64 = 20_000_000_000;
/// What stayed in a beam for longer is no passer-by, s.
const MOST_DWELL_S: f64 = 3.0;
/// `C_Size` and `O_Size` run up to this many cells.
const MOST_CELLS: f64 = 100.0;
/// `B_Size` runs up to this share of the picture: 4800 px of 160 × 120.
const MOST_PIXELS_SHARE: f64 = 0.25;
/// Size of the paper's picture, px.
const PAPER_PIXELS: f64 = 160.0 * 120.0;

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
    pub grounds: Vec<Grounds>,
}

/// What the pending readings say as evidence, scan by scan.
struct Weighed {
    /// T of each reading.
    odds: Vec<Vec<f64>>,
    /// How much each counts as a hit.
    weights: Vec<Vec<f64>>,
}

/// The two sides of the likelihood ratio.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grounds {
    /// T: a walker was there.
    pub walker: f64,
    /// S: something stands there.
    pub still: f64,
}

impl Grounds {
    /// Above 0: a walker is likelier.
    fn balance(self) -> f64 {
        self.walker - self.still
    }
}

/// Fuzzy-tuned integration over the streams of scans, sonar motion and camera motion.
#[derive(Debug, Clone)]
pub struct Fti {
    pub(crate) parameters: Parameters,
    pub(crate) cell: CellSize,
    pub(crate) integration: Integration,
    pub(crate) streams: Streams,
    pub(crate) tracks: Tracks,
    pub(crate) still: Still,
    pub(crate) runs: Runs,
    /// Last time at which somebody was followed.
    pub(crate) company_ns: Option<u64>,
    pub(crate) pending: VecDeque<PendingScan>,
    /// Those decided lately, the oldest first: what they say is still known reading by reading.
    pub(crate) recent: VecDeque<PendingScan>,
    /// Time and place of the robot at the last scan.
    pub(crate) last: Option<(u64, Pose)>,
}

/// The ranges of the variables of Tables 3 to 5.
pub(crate) fn ranges(parameters: &Parameters) -> Ranges {
    Ranges {
        forward_m: parameters.range_limit_m,
        width_m: parameters.cone_width_m(),
        cells: MOST_CELLS,
        pixels: MOST_PIXELS_SHARE * PAPER_PIXELS,
    }
}

impl Fti {
    /// Before the first input.
    ///
    /// # Errors
    /// Parameters that cannot be meant.
    pub fn new(parameters: Parameters) -> Result<Self, ParametersError> {
        let cell = parameters.check()?;
        let ranges = ranges(&parameters);
        let found = ranges.width_m;
        let no_cone = ParametersError::OutOfRange { name: "the width of the sonar cone", found, expected: "a positive number" };
        Ok(Self {
            integration: Integration::new(&parameters.tables, &ranges).ok_or(no_cone)?,
            cell,
            streams: Streams::default(),
            tracks: Tracks::default(),
            still: Still::new(Lattice::new(cell)),
            runs: Runs::default(),
            company_ns: None,
            pending: VecDeque::new(),
            recent: VecDeque::new(),
            last: None,
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
        if let Some((scan, frames)) = self.streams.next(self.parameters.patience, self.parameters.camera.is_some()) {
            self.integrate(&scan, &frames, verdicts);
            return true;
        }
        if self.streams.ended() {
            self.decide_until(u64::MAX, verdicts);
        }
        false
    }

    /// Takes streams that had ended to go on: the deployment was stopped and started again.
    pub fn reopen(&mut self) {
        self.streams.reopen();
    }

    /// Whether no more scans will come and every verdict has been given.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.streams.ended() && self.pending.is_empty()
    }

    /// The walkers that are followed at the last scan that was integrated: those who are certain.
    #[must_use]
    pub fn walkers(&self) -> Walkers {
        let mut message = Walkers::default();
        let certain = self.tracks.tracks.iter().filter(|track| track.ended_ns.is_none() && track.confirmed());
        for (slot, track) in message.walkers.iter_mut().zip(certain) {
            let ([x_m, y_m], [velocity_x_m_s, velocity_y_m_s]) = (track.motion.place_m().into(), track.motion.velocity_m_s().into());
            *slot = TrackedWalker { x_m, y_m, velocity_x_m_s, velocity_y_m_s, track: track.id };
            message.count += 1;
        }
        message
    }

    /// The last scan that was integrated: its number and time; the verdict on it comes a horizon later, at once when there is no
    /// horizon.
    #[must_use]
    pub fn last_scan(&self) -> Option<(u64, u64)> {
        self.pending.back().or(self.recent.back()).map(|scan| (scan.seq, scan.stamp_ns))
    }

    /// The verdicts to come as they stand now, on the newest pending scans.
    #[must_use]
    pub fn outlook(&self) -> VerdictOutlook {
        let mut outlook = VerdictOutlook::default();
        let weighed = self.weigh();
        let first = self.pending.len().saturating_sub(MAX_OUTLOOK_SCANS);
        for (slot, (at, scan)) in outlook.scans.iter_mut().zip(self.pending.iter().enumerate().skip(first)) {
            *slot = OutlookScan { seq: scan.seq, withheld: self.withheld(scan, &self.grounds(&weighed, at)), reserved: 0 };
            outlook.count += 1;
        }
        outlook
    }

    /// One scan and the frames since the last one, in the order of the paper: motion by both senses, correspondence, update
    /// regions; then the verdicts that are due.
    fn integrate(&mut self, scan: &Waiting, frames: &[Frame], verdicts: &mut Vec<Verdict>) {
        let pose = scan.scan.pose;
        self.follow_by_camera(scan, frames);
        let readings = self.readings(&scan.scan, scan.stamp_ns);
        self.follow_by_sonar(scan, &readings);
        if self.tracks.alive().any(|track| track.confirmed() && track.walked) {
            self.company_ns = Some(scan.stamp_ns);
        }
        let blobs = self.blobs(frames, scan.stamp_ns);
        let regions = update_regions(&self.integration, &pose, scan.motion.movers(), &blobs, self.parameters.correspond_m);
        self.still.stand(pose.x_m, pose.y_m, ROBOT_RADIUS_M, scan.stamp_ns);
        let inputs = self.inputs(scan);
        self.pending.push_back(PendingScan {
            seq: scan.seq,
            stamp_ns: scan.stamp_ns,
            robot_m: [pose.x_m, pose.y_m],
            readings,
            regions,
            inputs,
        });
        self.last = Some((scan.stamp_ns, pose));
        self.decide_until(scan.stamp_ns.saturating_sub(self.horizon_ns()), verdicts);
        self.runs.forget(scan.stamp_ns.saturating_sub(2 * self.horizon_ns()));
        self.tracks.forget(scan.stamp_ns.saturating_sub(2 * self.horizon_ns()));
    }

    fn horizon_ns(&self) -> u64 {
        (self.parameters.horizon_s * 1e9) as u64
    }

    fn follow_by_camera(&mut self, scan: &Waiting, frames: &[Frame]) {
        let Some(camera) = self.parameters.camera else { return };
        for frame in frames.iter().filter(|frame| frame.motion.validate().is_ok()) {
            let pose = self.robot_at(frame.stamp_ns, scan);
            self.tracks.see(&camera, &pose, frame.stamp_ns, &frame.motion);
        }
    }

    /// The robot between the last scan and this one.
    fn robot_at(&self, stamp_ns: u64, scan: &Waiting) -> Pose {
        let Some((last_ns, last)) = self.last else { return scan.scan.pose };
        let whole_ns = scan.stamp_ns.saturating_sub(last_ns).max(1);
        let share = (stamp_ns.saturating_sub(last_ns) as f64 / whole_ns as f64).clamp(0.0, 1.0);
        let between = |from: f64, to: f64| from + share * (to - from);
        let now = scan.scan.pose;
        let turned = now.yaw_rad - last.yaw_rad;
        let turned = turned.sin().atan2(turned.cos());
        Pose { x_m: between(last.x_m, now.x_m), y_m: between(last.y_m, now.y_m), yaw_rad: last.yaw_rad + share * turned }
    }

    /// The readings of a scan; none where its numbers cannot be meant.
    fn readings(&mut self, scan: &SonarScan, stamp_ns: u64) -> Vec<PendingReading> {
        if scan.validate().is_err() {
            return Vec::new();
        }
        let readings = scan.readings().iter().map(|reading| {
            let beam = Beam::new(&scan.pose, reading, self.parameters.half_beam_rad);
            let arc = beam.arc(self.cell, ARC_CELLS * self.cell.metres());
            let watched = self.watched(scan, &beam, stamp_ns);
            let run = self.runs.hear(reading.sonar, stamp_ns, &beam);
            PendingReading { past: self.past(&beam, &arc), watched, weight: 0.0, beam, run, arc }
        });
        readings.collect()
    }

    /// S from the past alone.
    fn past(&self, beam: &Beam, cells: &[Cell]) -> f64 {
        let mut arc = Arc::new(&self.still, beam, cells);
        for scan in &self.recent {
            scan.readings.iter().for_each(|reading| arc.hear(scan.stamp_ns, &reading.beam, reading.weight));
        }
        arc.balance().max(LEAST_PAST)
    }

    /// Whether the camera, if it is at work, looks at where an echo came from.
    fn watched(&self, scan: &SonarScan, beam: &Beam, stamp_ns: u64) -> bool {
        let at_work = self.tracks.frame_ns != 0 && stamp_ns.saturating_sub(self.tracks.frame_ns) < 500_000_000;
        let Some(camera) = self.parameters.camera.filter(|_| at_work) else { return false };
        let [x, y] = beam.origin_m();
        let [cos, sin] = beam.axis();
        let place = Vector2::new(x + cos * beam.range_m(), y + sin * beam.range_m());
        in_view(&camera, &scan.pose.then(&camera.mount), &Motion::at(place, Matrix2::identity(), 0.0))
    }

    fn follow_by_sonar(&mut self, scan: &Waiting, readings: &[PendingReading]) {
        let stamp_ns = scan.stamp_ns;
        let echoes: Vec<Heard<'_>> = readings
            .iter()
            .map(|reading| Heard {
                beam: &reading.beam,
                past: reading.past,
                run: reading.run,
                first: self.runs.is_first(reading.run, stamp_ns),
            })
            .collect();
        let motion = if scan.motion.validate().is_ok() { scan.motion.movers() } else { &[] };
        self.tracks.hear(&self.parameters, &scan.scan.pose, scan.stamp_ns, &echoes, motion);
    }

    /// B of the frame that belongs to a scan, in the robot frame.
    fn blobs(&self, frames: &[Frame], stamp_ns: u64) -> Vec<Seen> {
        let Some(camera) = self.parameters.camera else { return Vec::new() };
        let newest =
            frames.iter().rev().find(|frame| stamp_ns.saturating_sub(frame.stamp_ns) <= PAIRING_NS && frame.motion.validate().is_ok());
        let Some(frame) = newest else { return Vec::new() };
        let Some(view) = View::new(&camera, &frame.motion) else { return Vec::new() };
        let seen = frame.motion.blobs().iter().filter_map(|blob| view.b(self.parameters.cue, blob, &self.parameters));
        seen.map(|b| in_robot_frame(&camera, &b, &frame.motion)).collect()
    }

    fn inputs(&self, scan: &Waiting) -> u32 {
        let camera = self.tracks.frame_ns != 0 && scan.stamp_ns.saturating_sub(self.tracks.frame_ns) < 500_000_000;
        (if scan.answered { FilterVerdict::FROM_SONAR } else { 0 }) | (if camera { FilterVerdict::FROM_CAMERA } else { 0 })
    }

    /// Gives the verdicts on the scans up to a time, with everything known now.
    fn decide_until(&mut self, until_ns: u64, verdicts: &mut Vec<Verdict>) {
        if self.pending.front().is_none_or(|scan| scan.stamp_ns > until_ns) {
            return;
        }
        while self.pending.front().is_some_and(|scan| scan.stamp_ns <= until_ns) {
            let grounds = self.grounds(&self.weigh(), 0);
            let Some(mut scan) = self.pending.pop_front() else { return };
            for (reading, grounds) in scan.readings.iter_mut().zip(&grounds) {
                reading.weight = weight(grounds.walker, reading.past);
            }
            verdicts.push(self.answer(&scan, grounds));
            self.learn(scan);
        }
    }

    /// What each pending reading says as evidence.
    fn weigh(&self) -> Weighed {
        let walkers: Vec<Smoothed> = self.tracks.tracks.iter().filter_map(Smoothed::of).collect();
        let limit_m = self.parameters.range_limit_m;
        let of_scan = |scan: &PendingScan| {
            let present = presences(&walkers, scan.stamp_ns);
            scan.readings.iter().map(|reading| walker(reading, &present, limit_m)).collect()
        };
        let odds: Vec<Vec<f64>> = self.pending.iter().map(of_scan).collect();
        let of_scan = |(scan, odds): (&PendingScan, &Vec<f64>)| {
            let alone = self.alone(scan);
            let weight_of = |(reading, walker): (&PendingReading, &f64)| {
                weight(walker.max(passer_by(reading, self.runs.dwell_s(reading.run), alone)), reading.past)
            };
            scan.readings.iter().zip(odds).map(weight_of).collect()
        };
        let weights = self.pending.iter().zip(&odds).map(of_scan).collect();
        Weighed { odds, weights }
    }

    /// Both sides of the ratio for each reading of a pending scan: of a walker who is followed, or of a passer-by, whichever
    /// says more. How long an echo lasts speaks of the passer-by already, so that its own run is no evidence against him.
    fn grounds(&self, weighed: &Weighed, at: usize) -> Vec<Grounds> {
        let Some((scan, odds)) = self.pending.get(at).zip(weighed.odds.get(at)) else { return Vec::new() };
        let alone = self.alone(scan);
        let of_reading = |(index, (reading, walker)): (usize, (&PendingReading, &f64))| {
            let followed = Grounds { walker: *walker, still: self.stands(&weighed.weights, at, index, None) };
            let dwell_s = self.runs.dwell_s(reading.run);
            if dwell_s > MOST_DWELL_S {
                return followed;
            }
            let still = self.stands(&weighed.weights, at, index, Some(reading.run));
            let passer_by = Grounds { walker: passer_by(reading, dwell_s, alone), still };
            if followed.balance() > passer_by.balance() { followed } else { passer_by }
        };
        scan.readings.iter().zip(odds).enumerate().map(of_reading).collect()
    }

    /// Whether the camera was at work at a scan and nobody has been about for long, or is since.
    fn alone(&self, scan: &PendingScan) -> bool {
        scan.inputs & FilterVerdict::FROM_CAMERA != 0
            && self.company_ns.is_none_or(|last_ns| scan.stamp_ns > last_ns.saturating_add(COMPANY_NS))
    }

    /// S of a reading of a pending scan: by the past and by all other readings near in time, before and after, but for the hits
    /// of a run.
    fn stands(&self, weights: &[Vec<f64>], at: usize, index: usize, without_run: Option<u64>) -> f64 {
        let Some(asked) = self.pending.get(at).and_then(|scan| scan.readings.get(index)) else { return 0.0 };
        let mut arc = Arc::new(&self.still, &asked.beam, &asked.arc);
        let mut hear = |stamp_ns: u64, reading: &PendingReading, weight: f64| {
            arc.hear(stamp_ns, &reading.beam, if without_run == Some(reading.run) { 0.0 } else { weight });
        };
        for scan in &self.recent {
            scan.readings.iter().for_each(|reading| hear(scan.stamp_ns, reading, reading.weight));
        }
        for (scan_at, (scan, weights)) in self.pending.iter().zip(weights).enumerate() {
            let readings = scan.readings.iter().zip(weights).enumerate();
            for (_, (reading, weight)) in readings.filter(|(other, _)| (scan_at, *other) != (at, index)) {
                hear(scan.stamp_ns, reading, *weight);
            }
        }
        arc.balance()
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

    /// Whether a reading is taken out of the map.
    fn withholds(&self, scan: &PendingScan, reading: &PendingReading, grounds: &Grounds) -> bool {
        reading.beam.echo()
            && match self.parameters.rule {
                Rule::Likelihood => self.parameters.readiness + grounds.balance() > 0.0,
                Rule::Paper => scan.regions.iter().any(|region| region.entered_by(&reading.beam, &reading.arc, self.cell)),
            }
    }

    /// Bit i set: reading i of a scan is taken out of the map.
    fn withheld(&self, scan: &PendingScan, grounds: &[Grounds]) -> u32 {
        let readings = scan.readings.iter().zip(grounds).enumerate();
        readings.map(|(index, (reading, grounds))| u32::from(self.withholds(scan, reading, grounds)) << index).sum()
    }

    fn answer(&self, scan: &PendingScan, grounds: Vec<Grounds>) -> Verdict {
        let mut verdict = FilterVerdict { inputs: scan.inputs, ..FilterVerdict::default() };
        match self.parameters.action {
            Action::Withhold => verdict.withheld = self.withheld(scan, &grounds),
            Action::Free => verdict.action = FilterAction::Free as u32,
        }
        for (slot, region) in verdict.regions.iter_mut().zip(&scan.regions).take(MAX_REGIONS) {
            *slot = region.message();
            verdict.count += 1;
        }
        Verdict { seq: scan.seq, stamp_ns: scan.stamp_ns, verdict, grounds }
    }
}

fn in_robot_frame(camera: &Camera, b: &Seen, frame: &messages::CameraMotion) -> Seen {
    let place = camera.mount.then(&Pose { x_m: b.x, y_m: b.y, yaw_rad: 0.0 });
    let picture_px = f64::from(frame.width) * f64::from(frame.height);
    Seen { x: place.x_m, y: place.y_m, size: b.size * PAPER_PIXELS / picture_px.max(1.0) }
}
