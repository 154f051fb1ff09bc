//! The map as a fold over scans and verdicts.

use std::collections::{BTreeMap, VecDeque};

use messages::{
    FilterVerdict, Invalid, Layer as LayerName, MapSummary, MapTile, Payload, RobotEstimate, SonarScan, StreamCursor, Trajectory,
    TrajectoryRevision, VerdictOutlook, WayChunk,
};

use geometry::{CellSize, TileKey};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::committed::NewScan;
use crate::despeckle::published;
use crate::digest::digest;
use crate::integrate::Integrator;
use crate::layer::Layer;
use crate::localised::{Localised, MAX_STRETCHES};
use crate::parameters::{CommitRule, Parameters, ParametersError, PoseRule};
use crate::pending::{Decision, PendingScan};
use crate::placed::PlacedScan;
use crate::robot_path::RobotPath;

/// Faster than any indoor robot, m/s: the robots of the Pioneer family drive up to 1.8 m/s, and their odometry turns slip into metres
/// only over seconds.
const FASTEST_M_S: f64 = 10.0;
/// A pose may jump by so much at once, m: a driver corrects its odometry, and stamps of packets are off by some milliseconds.
const LARGEST_JUMP_M: f64 = 0.5;
/// After so long without a scan any pose is believed, ns: the robot was carried, or its odometry began anew.
const POSE_LOST_NS: u64 = 1_000_000_000;
/// Time from one status packet of a Pioneer to the next, ns.
const PACKET_NS: u64 = 100_000_000;
/// Most verdicts that are kept for scans still to come.
pub(crate) const MAX_EARLY: usize = 1024;

/// What a mapper is fed.
#[derive(Debug, Clone, Copy)]
pub enum Input<'a> {
    /// A scan.
    Scan {
        /// Its place in the stream of scans; greater than that of the scan before.
        seq: u64,
        /// Its sensor time, ns; not before that of the scan before.
        stamp_ns: u64,
        /// Its readings.
        scan: &'a SonarScan,
    },
    /// The verdict on a scan, before or after the scan itself.
    Verdict {
        /// The place of the scan it is on.
        seq: u64,
        /// Which readings are withheld.
        verdict: &'a FilterVerdict,
    },
    /// Where localisation estimates the robot. Where estimates are taken, those of scans that the mapper has are to come in their order,
    /// each before the pieces that it announces.
    Estimate {
        /// The number of the scan it answers.
        seq: u64,
        /// The estimate.
        estimate: &'a RobotEstimate,
    },
    /// A piece of a revision of poses estimated before.
    Revision {
        /// Its number in the stream of pieces.
        number: u64,
        /// The piece.
        piece: &'a TrajectoryRevision,
    },
    /// The verdicts to come as they stand: they count in what is shown until the final ones are there.
    Outlook(&'a VerdictOutlook),
    /// Neither scans nor verdicts are to come: what is pending is integrated as it stands.
    End,
}

/// Input that was not taken; the map is as before.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Refused {
    /// Numbers out of range.
    #[error("message {seq}: {source}")]
    Invalid {
        /// Its place in the stream.
        seq: u64,
        /// The number.
        source: Invalid,
    },
    /// The scan, or one after it, has been taken.
    #[error("scan {seq} has been taken: the last one is {last}")]
    RepeatedScan {
        /// Its place.
        seq: u64,
        /// Place of the last scan taken.
        last: u64,
    },
    /// The scan is older than the one before it.
    #[error("scan {seq} is of {stamp_ns} ns, expected at least {last_ns} ns, the time of the one before")]
    BackInTime {
        /// Its place.
        seq: u64,
        /// Its time.
        stamp_ns: u64,
        /// The time of the scan before.
        last_ns: u64,
    },
    /// No robot moves so fast: its driver is wrong about this pose, or was about the one before.
    #[error("scan {seq} is {jump_m:.1} m away from the one before, expected at most {most_m:.1} m in {elapsed_s:.2} s")]
    ImplausiblePose {
        /// Its place.
        seq: u64,
        /// From the pose before, m.
        jump_m: f64,
        /// As far as a robot can be, m.
        most_m: f64,
        /// Since the scan before, s.
        elapsed_s: f64,
    },
    /// The settings say that none is to come.
    #[error("a verdict on scan {seq}, expected none: the settings do not expect verdicts")]
    UnexpectedVerdict {
        /// Place of the scan.
        seq: u64,
    },
    /// The settings say that none is to come.
    #[error("an estimate of scan {seq}, expected none: the settings take odometry as exact")]
    UnexpectedEstimate {
        /// Number of the scan.
        seq: u64,
    },
    /// This estimate, or one after it, has been taken.
    #[error("the estimate of scan {seq} has been taken: the last one is {last}")]
    RepeatedEstimate {
        /// Number of the scan.
        seq: u64,
        /// Number of the last one taken.
        last: u64,
    },
    /// This piece, or one after it, has been taken.
    #[error("piece {number} of a revision has been taken: the last one is {last}")]
    RepeatedPiece {
        /// Number of the piece.
        number: u64,
        /// Number of the last one taken.
        last: u64,
    },
    /// Revisions are longer than the largest drive.
    #[error("piece {number} of a revision: {stretches} stretches wait, expected at most {MAX_STRETCHES}")]
    LongRevision {
        /// Number of the piece.
        number: u64,
        /// Stretches that wait.
        stretches: usize,
    },
    /// There is a verdict on this scan.
    #[error("a second verdict on scan {seq}")]
    RepeatedVerdict {
        /// Place of the scan.
        seq: u64,
    },
    /// The scan has been integrated for good, or never came.
    #[error("the verdict on scan {seq} is too late: scans up to {decided} are decided")]
    LateVerdict {
        /// Place of the scan.
        seq: u64,
        /// Last scan that is decided.
        decided: u64,
    },
    /// Too many verdicts wait for their scans.
    #[error("the verdict on scan {seq} is too early: {waiting} others wait for scans after {last}")]
    EarlyVerdict {
        /// Place of the scan.
        seq: u64,
        /// Verdicts that wait.
        waiting: usize,
        /// Place of the last scan taken.
        last: u64,
    },
}

/// What has been integrated for good.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Schema)]
pub struct Counts {
    /// Scans.
    pub scans: u64,
    /// Readings.
    pub readings: u64,
    /// Readings whose occupied part was left out.
    pub withheld: u64,
    /// Readings without a verdict, where verdicts were expected.
    pub undecided: u64,
    /// Scans whose smoothed pose did not come, where it was expected: they are placed by odometry from the last estimate.
    pub unsmoothed: u64,
}

/// The map's owner: scans and verdicts in, lattices out.
///
/// What is committed depends on the scans and their verdicts alone, not on when a verdict came, unless at sensor pace it
/// missed its deadline.
#[derive(Debug, Clone)]
pub struct Mapper {
    pub(crate) integrator: Integrator,
    commit: CommitRule,
    /// No deadline applies.
    is_patient: bool,
    /// Occupied cells of the filtered layer with fewer occupied neighbours are published as free.
    lonely_below: usize,
    pub(crate) filtered: Layer,
    pub(crate) unfiltered: Option<Layer>,
    /// Scans within the horizon, in their order.
    pub(crate) pending: VecDeque<PendingScan>,
    /// Verdicts on scans still to come.
    pub(crate) early: BTreeMap<u64, Decision>,
    /// `None` where odometry is exact.
    pub(crate) localised: Option<Localised>,
    /// The trajectory by odometry.
    pub(crate) path: RobotPath,
    /// The last scan taken; all zero before the first.
    pub(crate) last: StreamCursor,
    pub(crate) counts: Counts,
}

impl Mapper {
    /// An empty map.
    ///
    /// # Errors
    /// Parameters out of range, or a rule base that is none.
    pub fn new(parameters: &Parameters) -> Result<Self, ParametersError> {
        let integrator = Integrator::new(parameters)?;
        let (cell, lonely_below) = (integrator.cell, parameters.lonely_below as usize);
        Ok(Self {
            integrator,
            commit: parameters.commit,
            is_patient: false,
            lonely_below,
            filtered: Layer::new(cell, true, lonely_below),
            unfiltered: parameters.keep_unfiltered.then(|| Layer::new(cell, false, 0)),
            pending: VecDeque::new(),
            early: BTreeMap::new(),
            localised: match parameters.poses {
                PoseRule::Odometry => None,
                PoseRule::Estimate => Some(Localised::new(None)),
                PoseRule::EstimateOrDeadline { deadline_ns } => Some(Localised::new(Some(deadline_ns))),
            },
            path: RobotPath::default(),
            last: StreamCursor::default(),
            counts: Counts::default(),
        })
    }

    /// While true, verdicts and poses are waited for past their deadline: after a restart, what was sent before can come in any order.
    pub fn be_patient(&mut self, patient: bool) {
        self.is_patient = patient;
    }

    /// Takes one input. What it changes is shown after [`Self::refresh`].
    ///
    /// # Errors
    /// Input that is invalid, was taken before, or comes too late or too early; the map is then as before.
    pub fn step(&mut self, input: Input<'_>) -> Result<(), Refused> {
        match input {
            Input::Scan { seq, stamp_ns, scan } => {
                self.take_scan(StreamCursor { seq, stamp_ns }, scan)?;
                self.commit_due(false);
            }
            Input::Verdict { seq, verdict } => {
                self.take_verdict(seq, verdict)?;
                self.commit_due(false);
            }
            Input::Estimate { seq, estimate } => {
                self.take_estimate(seq, estimate)?;
                self.render_again(seq);
                self.commit_due(false);
            }
            Input::Revision { number, piece } => self.take_piece(number, piece)?,
            Input::Outlook(outlook) => self.take_outlook(outlook),
            Input::End => {
                self.commit_due(true);
                self.render_again(u64::MAX);
                self.trace();
            }
        }
        Ok(())
    }

    fn take_estimate(&mut self, seq: u64, estimate: &RobotEstimate) -> Result<(), Refused> {
        estimate.validate().map_err(|source| Refused::Invalid { seq, source })?;
        let Some(localised) = &mut self.localised else { return Err(Refused::UnexpectedEstimate { seq }) };
        if seq <= localised.last {
            return Err(Refused::RepeatedEstimate { seq, last: localised.last });
        }
        localised.take_estimate(seq, estimate, self.pending.iter_mut());
        Ok(())
    }

    fn take_piece(&mut self, number: u64, piece: &TrajectoryRevision) -> Result<(), Refused> {
        piece.validate().map_err(|source| Refused::Invalid { seq: number, source })?;
        let Some(localised) = &mut self.localised else { return Err(Refused::UnexpectedEstimate { seq: number }) };
        if number <= localised.pieces {
            return Err(Refused::RepeatedPiece { number, last: localised.pieces });
        }
        let stretches = localised.stretches();
        if stretches >= MAX_STRETCHES {
            return Err(Refused::LongRevision { number, stretches });
        }
        if localised.take_piece(number, piece) {
            localised.begin_rendering(self.pending.make_contiguous());
        }
        Ok(())
    }

    /// Renders a slice of the map whose poses were revised; once it is due, it takes the place of the one before. `now` is the
    /// number of an estimate, or greater than all at the end.
    fn render_again(&mut self, now: u64) {
        let Some(localised) = &mut self.localised else { return };
        loop {
            let layers: Vec<&Layer> = std::iter::once(&self.filtered).chain(&self.unfiltered).collect();
            let Some(lattices) = localised.render(now, &self.integrator, &layers) else { return };
            let layers = std::iter::once(&mut self.filtered).chain(&mut self.unfiltered);
            layers.zip(lattices).for_each(|(layer, lattice)| layer.replace(lattice));
            localised.trace(self.pending.iter());
            if localised.is_revised() {
                localised.begin_rendering(self.pending.make_contiguous());
            }
        }
    }

    /// Makes the trajectory anew from the poses as they are now.
    fn trace(&mut self) {
        if let Some(localised) = &mut self.localised {
            localised.trace(self.pending.iter());
        }
    }

    fn take_scan(&mut self, at: StreamCursor, scan: &SonarScan) -> Result<(), Refused> {
        let StreamCursor { seq, stamp_ns } = at;
        scan.validate().map_err(|source| Refused::Invalid { seq, source })?;
        if seq <= self.last.seq {
            return Err(Refused::RepeatedScan { seq, last: self.last.seq });
        }
        if stamp_ns < self.last.stamp_ns {
            return Err(Refused::BackInTime { seq, stamp_ns, last_ns: self.last.stamp_ns });
        }
        self.check_jump(seq, stamp_ns, scan)?;
        self.last = at;
        self.path.visit(&scan.pose);
        // Verdicts on scans that were lost on the way wait for nothing.
        self.early = self.early.split_off(&seq);
        let decision = self.early.remove(&seq);
        let mut pending = PendingScan::new(seq, stamp_ns, *scan, decision);
        if let Some(localised) = &self.localised {
            pending.locate(&localised.map_from_odom, localised.is_lost);
        }
        self.pending.push_back(pending);
        Ok(())
    }

    /// A single pose far away would draw into the map where the robot never was.
    fn check_jump(&self, seq: u64, stamp_ns: u64, scan: &SonarScan) -> Result<(), Refused> {
        // Stamps do not tell the time over scans that are missing: they may have been refused because the clock was set.
        let elapsed_ns = (stamp_ns - self.last.stamp_ns).max((seq - self.last.seq - 1).saturating_mul(PACKET_NS));
        let Some(jump_m) = self.path.distance_m(&scan.pose).filter(|_| elapsed_ns < POSE_LOST_NS) else { return Ok(()) };
        let elapsed_s = elapsed_ns as f64 * 1e-9;
        let most_m = LARGEST_JUMP_M + self.path.step_m + FASTEST_M_S * elapsed_s;
        if jump_m > most_m { Err(Refused::ImplausiblePose { seq, jump_m, most_m, elapsed_s }) } else { Ok(()) }
    }

    fn take_verdict(&mut self, seq: u64, verdict: &FilterVerdict) -> Result<(), Refused> {
        verdict.validate().map_err(|source| Refused::Invalid { seq, source })?;
        if let CommitRule::Horizon { .. } = self.commit {
            return Err(Refused::UnexpectedVerdict { seq });
        }
        if seq > self.last.seq {
            let waiting = self.early.len();
            if self.early.contains_key(&seq) {
                return Err(Refused::RepeatedVerdict { seq });
            }
            if waiting >= MAX_EARLY {
                return Err(Refused::EarlyVerdict { seq, waiting, last: self.last.seq });
            }
            self.early.insert(seq, Decision::of(verdict));
            return Ok(());
        }
        match self.pending.binary_search_by_key(&seq, |scan| scan.seq).map(|at| &mut self.pending[at].decision) {
            Ok(Some(_)) => Err(Refused::RepeatedVerdict { seq }),
            Ok(undecided) => {
                *undecided = Some(Decision::of(verdict));
                Ok(())
            }
            Err(_) => Err(Refused::LateVerdict { seq, decided: self.pending.front().map_or(self.last.seq, |scan| scan.seq - 1) }),
        }
    }

    /// What is integrated for good is not concerned, so that an outlook too early or too late is none.
    fn take_outlook(&mut self, outlook: &VerdictOutlook) {
        for expected in outlook.scans() {
            if let Ok(at) = self.pending.binary_search_by_key(&expected.seq, |scan| scan.seq) {
                self.pending[at].outlook = expected.withheld;
            }
        }
    }

    /// Integrates pending scans for good, in their order, up to the first that is not decided or has no pose. At the end none is
    /// waited for.
    fn commit_due(&mut self, is_end: bool) {
        let (rule, now_ns) = (self.commit, self.last.stamp_ns);
        // At time 0 no scan has passed a deadline.
        let for_deadlines_ns = if self.is_patient { 0 } else { now_ns };
        let is_due = |localised: &Option<Localised>, scan: &PendingScan| {
            is_decided(rule, scan, now_ns, for_deadlines_ns) && localised.as_ref().is_none_or(|it| it.has_pose(scan, for_deadlines_ns))
        };
        while let Some(scan) = self.pending.pop_front_if(|scan| is_end || is_due(&self.localised, scan)) {
            self.integrate(&scan);
            let readings = scan.scan.readings().len() as u64;
            self.counts.scans += 1;
            self.counts.readings += readings;
            self.counts.withheld += scan.withheld_count();
            let expected = !matches!(self.commit, CommitRule::Horizon { .. });
            if expected && scan.decision.is_none() {
                self.counts.undecided += readings;
            }
            self.counts.unsmoothed += u64::from(self.localised.is_some() && !scan.is_smoothed);
        }
    }

    fn integrate(&mut self, scan: &PendingScan) {
        let layers = std::iter::once(&mut self.filtered).chain(&mut self.unfiltered);
        let (map_from_robot, is_placed, readings) = (scan.map_from_robot, scan.is_placed, scan.scan.readings());
        let Some(Localised { committed, .. }) = &mut self.localised else {
            let placed = PlacedScan { map_from_robot, readings, withheld: scan.withheld(), freed: scan.freed() };
            layers.for_each(|layer| layer.commit(&self.integrator, &placed));
            return;
        };
        let freed = scan.freed_in_robot();
        committed.push(NewScan { seq: scan.seq, map_from_robot, is_placed, readings, withheld: scan.withheld(), freed: &freed });
        let last = committed.len() - 1;
        layers.for_each(|layer| committed.draw(last, |placed| layer.commit(&self.integrator, placed)));
    }

    /// Makes what is shown anew: the committed lattice with the pending readings on top.
    ///
    /// Takes time in the number of pending readings and of tiles changed since the last time, not in the size of the map.
    pub fn refresh(&mut self) {
        self.filtered.refresh(&self.integrator, self.pending.iter());
        if let Some(unfiltered) = &mut self.unfiltered {
            unfiltered.refresh(&self.integrator, self.pending.iter());
        }
    }

    /// Up to `most` tiles of a layer that have changed since they were last taken here.
    pub fn take_unsent(&mut self, layer: LayerName, most: usize) -> Vec<TileKey> {
        self.layer_mut(layer).map_or_else(Vec::new, |layer| layer.take_unsent(most))
    }

    /// Writes a tile of a layer as it is shown into a message.
    pub fn write_tile(&self, layer: LayerName, key: TileKey, message: &mut MapTile) {
        let Some(shown) = self.layer(layer).map(Layer::shown) else { return };
        *message = MapTile {
            cell_m: self.integrator.cell.metres(),
            scan_seq: self.last.seq,
            column: key.column,
            row: key.row,
            layer: layer as u32,
            tiles_in_layer: shown.tile_count() as u32,
            log_odds: published(shown, key, self.lonely_below(layer)),
        };
    }

    /// The unfiltered layer shows every reading.
    fn lonely_below(&self, layer: LayerName) -> usize {
        if layer == LayerName::Filtered { self.lonely_below } else { 0 }
    }

    /// All tiles of a layer as they are shown, in the order of their place.
    pub fn shown_tiles(&self, layer: LayerName) -> impl Iterator<Item = MapTile> {
        self.layer(layer).into_iter().flat_map(|held| held.shown().tiles()).map(move |(key, _)| {
            let mut tile = MapTile::default();
            self.write_tile(layer, key, &mut tile);
            tile
        })
    }

    /// The next piece of a trajectory that was not taken yet.
    pub fn next_way_chunk(&mut self) -> Option<WayChunk> {
        let Some(localised) = &mut self.localised else { return self.path.next_chunk(Trajectory::Robot) };
        localised.path.next_chunk(Trajectory::Robot).or_else(|| self.path.next_chunk(Trajectory::Odometry))
    }

    /// The robot's trajectory in the map frame, m.
    #[must_use]
    pub fn way_m(&self) -> &[[f32; 2]] {
        &self.trajectory().places_m
    }

    fn trajectory(&self) -> &RobotPath {
        self.localised.as_ref().map_or(&self.path, |localised| &localised.path)
    }

    /// The whole map and way are to be sent again: someone has joined who holds nothing.
    pub fn send_again(&mut self) {
        self.filtered.send_again();
        if let Some(unfiltered) = &mut self.unfiltered {
            unfiltered.send_again();
        }
        self.path.send_again();
        if let Some(localised) = &mut self.localised {
            localised.path.send_again();
        }
    }

    /// What is integrated for good, in numbers. Takes time in the size of the map.
    #[must_use]
    pub fn summary(&self) -> MapSummary {
        let (sha256, tiles) = digest(self.filtered.committed());
        let Counts { scans, readings, withheld, undecided, .. } = self.counts;
        MapSummary { sha256, scans, readings, withheld, undecided, tiles, way_m: self.trajectory().length_m }
    }

    /// What has been integrated for good.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Edge of a cell.
    #[must_use]
    pub fn cell_size(&self) -> CellSize {
        self.integrator.cell
    }

    /// Number of scans within the horizon.
    #[must_use]
    pub fn pending_scans(&self) -> usize {
        self.pending.len()
    }

    /// The last scan taken.
    #[must_use]
    pub fn last_scan(&self) -> StreamCursor {
        self.last
    }

    /// Number of the last estimate taken.
    #[must_use]
    pub fn estimated_up_to(&self) -> u64 {
        self.localised.as_ref().map_or(0, |localised| localised.last)
    }

    /// Whether a piece that an estimate has announced is missing.
    #[must_use]
    pub fn awaits_revision(&self) -> bool {
        self.localised.as_ref().is_some_and(|localised| localised.pieces < localised.announced)
    }

    /// Number of the last piece of a revision taken.
    #[must_use]
    pub fn revised_up_to(&self) -> u64 {
        self.localised.as_ref().map_or(0, |localised| localised.pieces)
    }

    /// Every verdict up to this place has been taken, or can no longer be.
    #[must_use]
    pub fn decided_up_to(&self) -> u64 {
        let first_undecided = self.pending.iter().find(|scan| scan.decision.is_none());
        first_undecided.map_or(self.last.seq, |scan| scan.seq - 1)
    }

    fn layer(&self, name: LayerName) -> Option<&Layer> {
        match name {
            LayerName::Filtered => Some(&self.filtered),
            LayerName::Unfiltered => self.unfiltered.as_ref(),
        }
    }

    fn layer_mut(&mut self, name: LayerName) -> Option<&mut Layer> {
        match name {
            LayerName::Filtered => Some(&mut self.filtered),
            LayerName::Unfiltered => self.unfiltered.as_mut(),
        }
    }
}

/// Whether a pending scan is decided at sensor time `now_ns`, which for deadlines is `for_deadlines_ns`.
fn is_decided(rule: CommitRule, scan: &PendingScan, now_ns: u64, for_deadlines_ns: u64) -> bool {
    let is_past = |now_ns: u64, after_ns: u64| now_ns >= scan.stamp_ns.saturating_add(after_ns);
    match rule {
        CommitRule::Horizon { horizon_ns } => is_past(now_ns, horizon_ns),
        CommitRule::Verdict => scan.decision.is_some(),
        CommitRule::VerdictOrDeadline { deadline_ns } => scan.decision.is_some() || is_past(for_deadlines_ns, deadline_ns),
    }
}
