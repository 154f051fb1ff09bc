//! The part of a mapper that follows localisation: poses of scans, and the map rendered again when they are revised.

use geometry::{Lattice, MapFromOdom};
use messages::{EstimateStatus, MovedStretch, RobotEstimate, TrajectoryRevision};

use crate::committed::{Committed, revised};
use crate::integrate::Integrator;
use crate::layer::{Layer, draw};
use crate::pending::PendingScan;
use crate::robot_path::RobotPath;

/// Scans that are rendered again with each estimate: 300 readings in two layers take 4 ms or less, a twentieth of the time between
/// two scans.
pub(crate) const SCANS_PER_SLICE: usize = 128;
/// Most stretches of revisions that wait: more than a drive of 10 km has, with a node every 15 cm.
pub(crate) const MAX_STRETCHES: usize = 1 << 17;

/// What localisation has estimated, and every committed scan.
#[derive(Debug, Clone)]
pub(crate) struct Localised {
    /// Age at which a scan is integrated without its smoothed pose, ns; `None` in lockstep.
    pub(crate) deadline_ns: Option<u64>,
    pub(crate) map_from_odom: MapFromOdom,
    /// Something moved the robot, and its place is not known.
    pub(crate) is_lost: bool,
    /// Number of the last estimate taken.
    pub(crate) last: u64,
    /// Number of the last piece of a revision taken.
    pub(crate) pieces: u64,
    /// Number of the last piece that an estimate has announced.
    pub(crate) announced: u64,
    /// Smoothed poses received.
    pub(crate) smoothed: u64,
    /// Stretches of the revision whose last piece is missing.
    pub(crate) incoming: Vec<MovedStretch>,
    /// Stretches of revisions that came while the map is rendered again, in their order.
    pub(crate) waiting: Vec<MovedStretch>,
    pub(crate) committed: Committed,
    pub(crate) rendering: Option<Rendering>,
    /// The trajectory in the map.
    pub(crate) path: RobotPath,
}

/// The map that is rendered again, beside the one that is shown.
#[derive(Debug, Clone)]
pub(crate) struct Rendering {
    /// It takes the place of the other one with the estimate of this number: the same in every replay.
    pub(crate) swap_at: u64,
    /// Index of the next committed scan.
    next: usize,
    /// The filtered layer, and the unfiltered one where it is kept.
    lattices: Vec<Lattice<f32>>,
}

impl Rendering {
    /// Before the first scan.
    pub(crate) fn until(swap_at: u64) -> Self {
        Self { swap_at, next: 0, lattices: Vec::new() }
    }

    /// Renders up to `most` further scans.
    fn advance(&mut self, committed: &Committed, integrator: &Integrator, layers: &[&Layer], most: usize) {
        self.lattices.resize_with(layers.len(), || Lattice::new(integrator.cell));
        let end = committed.len().min(self.next.saturating_add(most));
        for index in self.next..end {
            committed.draw(index, |scan| {
                for (lattice, layer) in self.lattices.iter_mut().zip(layers) {
                    draw(lattice, integrator, scan, layer.heeds_verdicts());
                }
            });
        }
        self.next = end;
    }
}

impl Localised {
    pub(crate) fn new(deadline_ns: Option<u64>) -> Self {
        Self {
            deadline_ns,
            map_from_odom: MapFromOdom::IDENTITY,
            is_lost: false,
            last: 0,
            pieces: 0,
            announced: 0,
            smoothed: 0,
            incoming: Vec::new(),
            waiting: Vec::new(),
            committed: Committed::default(),
            rendering: None,
            path: RobotPath::default(),
        }
    }
}

impl Localised {
    /// Whether a scan need not be held for its pose at sensor time `now_ns`.
    pub(crate) fn has_pose(&self, scan: &PendingScan, now_ns: u64) -> bool {
        let is_over = |deadline_ns: u64| now_ns >= scan.stamp_ns.saturating_add(deadline_ns);
        scan.is_smoothed || self.deadline_ns.is_some_and(is_over)
    }

    /// Takes the answer of localisation to a scan: poses of pending scans.
    pub(crate) fn take_estimate<'a>(&mut self, seq: u64, estimate: &RobotEstimate, pending: impl Iterator<Item = &'a mut PendingScan>) {
        self.last = seq;
        self.announced = estimate.pieces;
        self.map_from_odom = MapFromOdom::from_wire(&estimate.map_from_odom);
        self.is_lost = estimate.status == EstimateStatus::Lost as u32;
        self.smoothed += estimate.smoothed().len() as u64;
        let mut smoothed = estimate.smoothed().iter().peekable();
        for scan in pending {
            while smoothed.next_if(|it| it.seq < scan.seq).is_some() {}
            match smoothed.next_if(|it| it.seq == scan.seq) {
                Some(it) => scan.smooth(it),
                None => scan.locate(&self.map_from_odom, self.is_lost),
            }
            if scan.seq == seq && scan.is_placed {
                self.path.visit(&scan.map_from_robot.to_wire());
            }
        }
    }

    /// Takes a piece of a revision; true when it was the last piece and the map is to be rendered again at once.
    pub(crate) fn take_piece(&mut self, number: u64, piece: &TrajectoryRevision) -> bool {
        self.pieces = number;
        self.incoming.extend(piece.moved());
        if piece.is_last == 0 {
            return false;
        }
        self.waiting.append(&mut self.incoming);
        self.rendering.is_none()
    }

    /// Whether complete revisions wait.
    pub(crate) fn is_revised(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// Stretches that are held.
    pub(crate) fn stretches(&self) -> usize {
        self.incoming.len() + self.waiting.len()
    }

    /// Applies the complete revisions and begins to render the map again. The smoothed poses received so far, unlike the scans
    /// committed so far, are the same in every replay: they say when the new map is shown.
    pub(crate) fn begin_rendering(&mut self, pending: &mut [PendingScan]) {
        for moved in std::mem::take(&mut self.waiting) {
            self.committed.revise(&moved);
            let scans = pending.iter_mut().filter(|scan| (moved.first..=moved.last).contains(&scan.seq) && scan.is_smoothed);
            scans.for_each(|scan| {
                scan.map_from_robot = revised(&moved, &scan.map_from_robot);
                scan.is_placed = true;
            });
        }
        self.rendering = Some(Rendering::until(self.last + 1 + self.smoothed / SCANS_PER_SLICE as u64));
    }

    /// Renders a slice; the new lattices once they are due. `now` is the number of an estimate, or greater than all at the end.
    pub(crate) fn render(&mut self, now: u64, integrator: &Integrator, layers: &[&Layer]) -> Option<Vec<Lattice<f32>>> {
        let rendering = self.rendering.as_mut()?;
        let is_due = now >= rendering.swap_at;
        rendering.advance(&self.committed, integrator, layers, if is_due { usize::MAX } else { SCANS_PER_SLICE });
        if is_due { self.rendering.take().map(|rendering| rendering.lattices) } else { None }
    }

    /// Makes the trajectory anew from the poses as they are now.
    pub(crate) fn trace<'a>(&mut self, pending: impl Iterator<Item = &'a PendingScan>) {
        let last = self.last;
        let ahead = pending.filter(|scan| scan.is_placed && scan.seq <= last).map(|scan| &scan.map_from_robot);
        let mut path = RobotPath::default();
        self.committed.poses().chain(ahead).for_each(|pose| path.visit(&pose.to_wire()));
        self.path = path;
    }
}
