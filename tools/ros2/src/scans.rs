//! From readings and odometry to scans.

use messages::{AFTER_DOUBT, AFTER_LOSS, MAX_READINGS, Payload, Pose, SonarReading, SonarScan};

use crate::tally::Tally;
use crate::trajectory::{Before, Trajectory};

/// Least time between two scans, ns. The streams of a deployment hold 512 scans, and a verdict comes 3 s behind its scan: 50 scans a second
/// leave room for a restart. What falls between is part of the scan before, with the mount of each reading moved by the drive since; what has
/// no place in it begins the next scan, up to so much later than it was measured.
pub(crate) const SPACING_NS: u64 = 20_000_000;

/// A reading of a bag.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Reading {
    pub(crate) stamp_ns: u64,
    /// Its place among the sonars of the bag.
    pub(crate) sonar: usize,
    pub(crate) range_m: f64,
    pub(crate) has_echo: bool,
}

/// A scan that readings are added to.
struct OpenScan {
    stamp_ns: u64,
    pose: Pose,
    after_gap: u32,
    readings: Vec<SonarReading>,
}

/// Makes scans of events in the order of their stamps.
struct Builder<'a> {
    /// Topic and mount of each sonar.
    sonars: &'a [(String, Pose)],
    scans: Vec<(u64, SonarScan)>,
    open: Option<OpenScan>,
    /// What the next scan comes after.
    after_gap: u32,
    tally: &'a mut Tally,
}

/// The scans with their stamps: one for each message of odometry and for each time at which sonars measured. Readings without a pose are
/// counted in `tally`.
pub(crate) fn scans(readings: &[Reading], trajectory: &Trajectory, sonars: &[(String, Pose)], tally: &mut Tally) -> Vec<(u64, SonarScan)> {
    let mut readings: Vec<&Reading> = readings.iter().collect();
    readings.sort_by_key(|reading| reading.stamp_ns);
    let mut readings = readings.into_iter().peekable();
    let mut builder = Builder { sonars, scans: Vec::new(), open: None, after_gap: 0, tally };
    for (number, sample) in trajectory.samples().iter().enumerate() {
        while let Some(reading) = readings.next_if(|reading| reading.stamp_ns < sample.stamp_ns) {
            builder.read(reading, trajectory.at(reading.stamp_ns));
        }
        match trajectory.before(number) {
            Before::Drive => {}
            Before::Gap => builder.interrupt(AFTER_LOSS),
            Before::Jump => builder.interrupt(AFTER_DOUBT),
        }
        builder.pass(sample.stamp_ns, sample.pose);
    }
    readings.for_each(|reading| builder.read(reading, trajectory.at(reading.stamp_ns)));
    builder.close();
    builder.scans
}

impl Builder<'_> {
    /// The next scan comes after a loss.
    fn interrupt(&mut self, after_gap: u32) {
        self.close();
        self.after_gap = self.after_gap.max(after_gap);
    }

    /// The robot has this pose at this time.
    fn pass(&mut self, stamp_ns: u64, pose: Pose) {
        if self.open.as_ref().is_none_or(|open| stamp_ns >= open.stamp_ns.saturating_add(SPACING_NS)) {
            self.begin(stamp_ns, pose);
        }
    }

    fn read(&mut self, reading: &Reading, pose: Option<Pose>) {
        let Some((topic, mount)) = self.sonars.get(reading.sonar) else { return };
        let Some(pose) = pose else {
            self.tally.add(topic, "readings at times without odometry are left out");
            return;
        };
        self.pass(reading.stamp_ns, pose);
        let sonar = reading.sonar as u32;
        let has_room = |open: &OpenScan| open.readings.len() < MAX_READINGS && open.readings.iter().all(|other| other.sonar != sonar);
        if !self.open.as_ref().is_some_and(has_room) && !self.begin(reading.stamp_ns, pose) {
            self.tally.add(topic, "readings beyond 50 scans a second are left out");
            return;
        }
        let Some(open) = &mut self.open else { return };
        let mount = if open.pose == pose { *mount } else { inverse(&open.pose).then(&pose).then(mount) };
        open.readings.push(SonarReading::new(sonar, mount, reading.range_m, reading.has_echo));
    }

    /// Begins a scan; false if too many have been begun at this time.
    fn begin(&mut self, stamp_ns: u64, pose: Pose) -> bool {
        let open_ns = self.open.as_ref().map(|open| open.stamp_ns);
        let last_ns = open_ns.or(self.scans.last().map(|(last_ns, _)| *last_ns));
        let earliest_ns = last_ns.map_or(0, |last_ns| last_ns.saturating_add(SPACING_NS));
        if earliest_ns > stamp_ns.saturating_add(SPACING_NS) {
            return false;
        }
        self.close();
        let after_gap = std::mem::take(&mut self.after_gap);
        self.open = Some(OpenScan { stamp_ns: stamp_ns.max(earliest_ns), pose, after_gap, readings: Vec::new() });
        true
    }

    fn close(&mut self) {
        let Some(open) = self.open.take() else { return };
        let scan = SonarScan { after_gap: open.after_gap, ..SonarScan::new(open.pose, &open.readings, false) };
        match scan.validate() {
            Ok(()) => self.scans.push((open.stamp_ns, scan)),
            Err(invalid) => {
                let topic = open.readings.first().and_then(|reading| self.sonars.get(reading.sonar as usize));
                self.tally.add(topic.map_or("of the odometry", |(topic, _)| topic), &invalid.to_string());
                self.after_gap = self.after_gap.max(open.after_gap);
            }
        }
    }
}

/// The frame that a pose is given in, seen from the pose.
fn inverse(pose: &Pose) -> Pose {
    let (sin, cos) = pose.yaw_rad.sin_cos();
    Pose { x_m: -(cos * pose.x_m + sin * pose.y_m), y_m: sin * pose.x_m - cos * pose.y_m, yaw_rad: -pose.yaw_rad }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::Sample;
    use proptest::prelude::*;

    const MS: u64 = 1_000_000;

    /// 0.1 m/s along x, a message every 100 ms.
    fn drive(messages: u64) -> Trajectory {
        let sample =
            |k: u64| Sample { stamp_ns: k * 100 * MS, pose: Pose { x_m: k as f64 * 0.01, y_m: 0.0, yaw_rad: 0.0 }, is_doubtful: false };
        Trajectory::new((0..messages).map(sample).collect())
    }

    fn ring(count: usize) -> Vec<(String, Pose)> {
        (0..count).map(|sonar| (format!("/sonar{sonar}"), Pose { x_m: 0.1, y_m: 0.0, yaw_rad: sonar as f64 * 0.1 })).collect()
    }

    fn reading(ms: u64, sonar: usize) -> Reading {
        Reading { stamp_ns: ms * MS, sonar, range_m: 1.0, has_echo: true }
    }

    fn check(readings: &[Reading], expect: &[(u64, usize)]) -> (Vec<(u64, SonarScan)>, Tally) {
        let mut tally = Tally::default();
        let scans = scans(readings, &drive(3), &ring(20), &mut tally);
        let found: Vec<_> = scans.iter().map(|(stamp_ns, scan)| (*stamp_ns, scan.readings().len())).collect();
        assert_eq!(found, expect);
        (scans, tally)
    }

    #[test]
    fn sonars_that_fire_at_once_are_one_scan_each_time() {
        let readings: Vec<Reading> = [0, 100, 200].into_iter().flat_map(|ms| (0..8).map(move |sonar| reading(ms, sonar))).collect();
        check(&readings, &[(0, 8), (100 * MS, 8), (200 * MS, 8)]);
    }

    #[test]
    fn more_sonars_than_a_scan_holds_are_two_scans() {
        let readings: Vec<Reading> = (0..20).map(|sonar| reading(100, sonar)).collect();
        check(&readings, &[(0, 0), (100 * MS, 16), (120 * MS, 4), (200 * MS, 0)]);
    }

    #[test]
    fn a_reading_between_messages_has_a_pose_between() {
        let (scans, _) = check(&[reading(150, 0)], &[(0, 0), (100 * MS, 0), (150 * MS, 1), (200 * MS, 0)]);
        assert!((scans[2].1.pose.x_m - 0.015).abs() < 1e-12);
    }

    #[test]
    fn a_reading_shortly_after_a_scan_has_its_mount_moved() {
        let (scans, _) = check(&[reading(110, 0)], &[(0, 0), (100 * MS, 1), (200 * MS, 0)]);
        let mount = scans[1].1.readings()[0].mount;
        assert!((mount.x_m - 0.101).abs() < 1e-12, "1 mm further: {mount:?}");
    }

    #[test]
    fn a_sonar_is_in_a_scan_once() {
        check(&[reading(100, 0), reading(105, 0)], &[(0, 0), (100 * MS, 1), (120 * MS, 1), (200 * MS, 0)]);
    }

    #[test]
    fn a_sonar_at_200_hz_gives_50_scans_a_second() {
        let readings: Vec<Reading> = (0..40).map(|number| reading(number * 5, 0)).collect();
        let (_, tally) = check(&readings, &(0..11).map(|number| (number * 20 * MS, 1)).collect::<Vec<_>>());
        assert_eq!(tally.lines(), ["topic /sonar0: readings beyond 50 scans a second are left out (29 messages)"]);
    }

    proptest! {
        #[test]
        fn scans_are_at_least_20_ms_apart(
            samples in prop::collection::vec((0..2_000_u64, 0..20_u8), 1..60),
            readings in prop::collection::vec((0..2_000_u64, 0..20_usize), 0..400),
        ) {
            let sample = |(ms, x_m): (u64, u8)| {
                let pose = Pose { x_m: f64::from(x_m / 10), y_m: 0.0, yaw_rad: 0.0 };
                Sample { stamp_ns: ms * MS, pose, is_doubtful: ms % 7 == 0 }
            };
            let readings: Vec<Reading> = readings.into_iter().map(|(ms, sonar)| reading(ms, sonar)).collect();
            let mut tally = Tally::default();
            let scans = scans(&readings, &Trajectory::new(samples.into_iter().map(sample).collect()), &ring(20), &mut tally);
            prop_assert!(scans.is_sorted_by(|(one_ns, _), (next_ns, _)| one_ns + SPACING_NS <= *next_ns));
            let used: usize = scans.iter().map(|(_, scan)| scan.readings().len()).sum();
            let left_out: u64 = tally.lines().iter().map(|line| line.rsplit_once('(').unwrap().1.split_once(' ').unwrap().0.parse::<u64>().unwrap()).sum();
            prop_assert_eq!(used as u64 + left_out, readings.len() as u64);
        }
    }

    #[test]
    fn readings_without_odometry_are_counted() {
        let (_, tally) = check(&[reading(250, 3)], &[(0, 0), (100 * MS, 0), (200 * MS, 0)]);
        assert_eq!(tally.lines(), ["topic /sonar3: readings at times without odometry are left out (1 message)"]);
    }

    #[test]
    fn a_jump_of_the_odometry_makes_the_next_scan_doubtful() {
        let mut samples = drive(4).samples().to_vec();
        samples[2].pose.x_m += 5.0;
        samples[3].pose.x_m += 5.0;
        let found = scans(&[reading(150, 0)], &Trajectory::new(samples), &ring(1), &mut Tally::default());
        let gaps: Vec<_> = found.iter().map(|(stamp_ns, scan)| (stamp_ns / MS, scan.after_gap)).collect();
        assert_eq!(gaps, [(0, 0), (100, 0), (200, AFTER_DOUBT), (300, 0)]);
    }
}
