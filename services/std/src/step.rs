//! The algorithm of Table 1, scan by scan.

use geometry::{Beam, Cell, CellSize, Lattice, wrapped};
use messages::{MAX_MOVERS, Mover, Payload, Pose, SonarMotion, SonarScan};
use nalgebra::Vector2;

use crate::classes::{Class, classes};
use crate::parameters::{Parameters, ParametersError, Rule};
use crate::seen_free::SeenFree;
use crate::tracks::{Track, Tracked, Tracks};
use crate::tvm::{TimeVariantMap, tag};

/// Sonar temporal difference over a stream of scans.
#[derive(Debug, Clone)]
pub struct Std {
    pub(crate) parameters: Parameters,
    pub(crate) cell: CellSize,
    /// Scans seen (k).
    pub(crate) scan: u32,
    pub(crate) tvm: TimeVariantMap,
    pub(crate) seen_free: SeenFree,
    pub(crate) tracks: Tracks,
}

impl Std {
    /// Before the first scan.
    ///
    /// # Errors
    /// Parameters out of range.
    pub fn new(parameters: Parameters) -> Result<Self, ParametersError> {
        let cell = parameters.check()?;
        Ok(Self {
            parameters,
            cell,
            scan: 0,
            tvm: TimeVariantMap::default(),
            seen_free: SeenFree::new(Lattice::new(cell)),
            tracks: Tracks::default(),
        })
    }

    /// What moves in this scan; the answer has the scan's own number and stamp. A scan whose numbers are not valid is taken
    /// as one without readings.
    pub fn step(&mut self, stamp_ns: u64, scan: &SonarScan) -> SonarMotion {
        self.scan = self.scan.saturating_add(1);
        if scan.is_doubtful() {
            self.forget_places();
        }
        let beams = self.beams(scan);
        let tagged = tag(self.cell, beams.iter().map(|(reading, beam)| (*reading, beam)));
        let mut moving = classes(&tagged);
        moving.retain(|class| self.moves(class));
        let centroids_m: Vec<Vector2<f64>> = moving.iter().map(|class| self.centroid_m(class)).collect();
        let tracked = self.tracks.follow(self.scan, self.parameters.span_scans, stamp_ns, &centroids_m);
        self.remember(&tagged, &beams);
        answer(&scan.pose, &moving, &centroids_m, &tracked)
    }

    /// The poses from here on may be off against those before: against the old places every wall would move.
    fn forget_places(&mut self) {
        self.tvm = TimeVariantMap::default();
        self.seen_free = SeenFree::new(Lattice::new(self.cell));
        self.tracks.clear();
    }

    /// The tracks that are alive.
    #[must_use]
    pub fn tracks(&self) -> &[Track] {
        self.tracks.alive()
    }

    /// The readings of the sonars that take part.
    fn beams(&self, scan: &SonarScan) -> Vec<(usize, Beam)> {
        if scan.validate().is_err() {
            return Vec::new();
        }
        let ahead =
            scan.readings().iter().enumerate().filter(|(_, reading)| wrapped(reading.mount.yaw_rad).abs() <= self.parameters.aside_rad);
        ahead.map(|(index, reading)| (index, Beam::new(&scan.pose, reading, self.parameters.half_beam_rad))).collect()
    }

    /// Whether enough cells of a class move: CELL_mov, otherwise CELL_sat.
    fn moves(&self, class: &Class) -> bool {
        let moving = class.cells.iter().filter(|cell| self.cell_moves(**cell)).count();
        moving as f64 >= self.parameters.moving_share * class.cells.len() as f64 && moving > 0
    }

    fn cell_moves(&self, cell: Cell) -> bool {
        let stationary = self.tvm.tagged_lately(cell, self.parameters.tolerance_cells);
        !stationary
            && match self.parameters.rule {
                Rule::Paper => true,
                Rule::Visible => self.seen_free.lately(cell, self.scan, self.parameters.free_for_scans),
            }
    }

    fn centroid_m(&self, class: &Class) -> Vector2<f64> {
        let centres = class.cells.iter().map(|cell| Vector2::new(self.cell.centre_of(cell.column), self.cell.centre_of(cell.row)));
        centres.sum::<Vector2<f64>>() / class.cells.len() as f64
    }

    fn remember(&mut self, tagged: &crate::tvm::Tagged, beams: &[(usize, Beam)]) {
        self.tvm.remember(tagged, self.parameters.span_scans);
        if self.parameters.rule == Rule::Visible {
            for (_, beam) in beams {
                self.seen_free.see(beam, self.parameters.half_beam_rad, self.scan);
            }
            if self.scan.is_multiple_of(self.parameters.free_for_scans) {
                self.seen_free.forget(self.scan, self.parameters.free_for_scans);
            }
        }
    }
}

fn answer(map_from_robot: &Pose, moving: &[Class], centroids_m: &[Vector2<f64>], tracked: &[Tracked]) -> SonarMotion {
    let mut motion = SonarMotion { truncated: u32::from(moving.len() > MAX_MOVERS), ..SonarMotion::default() };
    let (sin, cos) = map_from_robot.yaw_rad.sin_cos();
    for (slot, ((class, centroid), track)) in motion.movers.iter_mut().zip(moving.iter().zip(centroids_m).zip(tracked)) {
        let (dx, dy) = (centroid.x - map_from_robot.x_m, centroid.y - map_from_robot.y_m);
        *slot = Mover {
            robot_x_m: dx * cos + dy * sin,
            robot_y_m: dy * cos - dx * sin,
            map_x_m: centroid.x,
            map_y_m: centroid.y,
            velocity_x_m_s: track.velocity_m_s.x.clamp(-100.0, 100.0),
            velocity_y_m_s: track.velocity_m_s.y.clamp(-100.0, 100.0),
            cells: class.cells.len() as u32,
            readings: class.readings,
            track: track.id,
        };
        motion.count += 1;
    }
    motion
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::SonarReading;
    use proptest::prelude::*;

    fn scan(ranges_m: &[f64]) -> SonarScan {
        let readings: Vec<SonarReading> =
            ranges_m.iter().map(|&range_m| SonarReading { range_m, echo: u32::from(range_m < 3.0), ..SonarReading::default() }).collect();
        SonarScan::new(Pose::default(), &readings, false)
    }

    fn run(rule: Rule, ranges_m: &[f64]) -> Vec<SonarMotion> {
        let mut std = Std::new(Parameters { rule, ..Parameters::default() }).unwrap();
        (1u64..).zip(ranges_m).map(|(k, range_m)| std.step(k * 100_000_000, &scan(&[*range_m]))).collect()
    }

    fn counts(motions: &[SonarMotion]) -> Vec<u32> {
        motions.iter().map(|motion| motion.count).collect()
    }

    #[test]
    fn by_the_paper_everything_new_moves_even_a_wall_at_first_sight() {
        assert_eq!(counts(&run(Rule::Paper, &[2.0, 2.0, 2.0, 1.0, 1.0, 2.0])), [1, 0, 0, 1, 0, 0]);
    }

    #[test]
    fn a_thing_where_it_was_free_moves_and_a_new_wall_does_not() {
        let motions = run(Rule::Visible, &[2.0, 2.0, 2.0, 1.0, 1.0, 2.0]);
        assert_eq!(counts(&motions), [0, 0, 0, 1, 0, 0]);
        let mover = &motions[3].movers()[0];
        assert_eq!((mover.readings, mover.track), (1, 1));
        assert!((mover.robot_x_m - 1.0).abs() < 0.05 && mover.robot_y_m.abs() < 0.03 && mover.cells > 12, "{mover:?}");
    }

    #[test]
    fn after_a_doubtful_pose_a_wall_does_not_move() {
        let motions = |after_gap| {
            let mut std = Std::new(Parameters { rule: Rule::Visible, ..Parameters::default() }).unwrap();
            let shifted = SonarScan { after_gap, ..scan(&[1.0]) };
            [scan(&[2.0]), scan(&[2.0]), shifted, scan(&[1.0])].map(|scan| std.step(1, &scan).count)
        };
        assert_eq!(motions(messages::AFTER_LOSS), [0, 0, 1, 0], "it stands where it was free");
        assert_eq!(motions(messages::AFTER_DOUBT), [0; 4]);
    }

    #[test]
    fn a_tag_older_than_the_span_is_forgotten() {
        // Five scans after it was last tagged the wall's cell is new again: a span of four does not reach back.
        let ranges = [1.0, 2.0, 2.0, 2.0, 2.0, 1.0];
        assert_eq!(run(Rule::Paper, &ranges)[5].count, 1);
        assert_eq!(run(Rule::Paper, &ranges[1..])[4].count, 1);
        assert_eq!(run(Rule::Paper, &[1.0, 2.0, 2.0, 2.0, 1.0])[4].count, 0);
    }

    #[test]
    fn sonars_that_look_aside_take_no_part() {
        let mut reading = SonarReading { range_m: 1.0, echo: 1, ..SonarReading::default() };
        reading.mount.yaw_rad = std::f64::consts::FRAC_PI_2;
        let aside = SonarScan::new(Pose::default(), &[reading], false);
        let count = |aside_rad| {
            let parameters = Parameters { rule: Rule::Paper, aside_rad, ..Parameters::default() };
            Std::new(parameters).unwrap().step(0, &aside).count
        };
        assert_eq!([count(0.7), count(1.6)], [0, 1]);
    }

    #[test]
    fn parameters_out_of_range_are_refused() {
        let error = Std::new(Parameters { span_scans: 0, ..Parameters::default() }).unwrap_err();
        assert_eq!(error.to_string(), "span_scans is 0, expected 1 to 100 scans");
    }

    proptest! {
        #[test]
        fn any_bytes_are_answered_with_a_valid_message(bytes in proptest::collection::vec(any::<u8>(), size_of::<SonarScan>()), stamps in any::<[u64; 2]>()) {
            let mut std = Std::new(Parameters::default()).unwrap();
            let mut garbage: SonarScan = bytemuck::pod_read_unaligned(&bytes);
            prop_assert_eq!(std.step(stamps[0], &garbage).validate(), Ok(()));
            garbage.count = 16;
            prop_assert_eq!(std.step(stamps[1], &garbage).validate(), Ok(()));
        }

        #[test]
        fn no_stream_of_ranges_breaks_it(ranges in proptest::collection::vec(0.0..4.0f64, 1..60)) {
            let mut std = Std::new(Parameters::default()).unwrap();
            for (k, pair) in ranges.chunks(2).enumerate() {
                prop_assert_eq!(std.step(k as u64 * 100_000_000, &scan(pair)).validate(), Ok(()));
            }
        }
    }
}
