//! For how long one sonar hears the same thing.
//!
//! What stands stays in a beam for as long as the robot takes to pass it; who walks by leaves it sooner. So how long an echo
//! keeps its range in its own sonar tells the two apart where no camera looks.

use geometry::{Beam, wrapped};
use messages::seconds;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};
use state::Queue;

/// An echo of the same thing differs from the last one by less than this, m: the way of the robot between two pings and the
/// slant of a wall make that much.
/// Half: 81.7 % / 1.64 %, twice: 82.5 % / 1.01 %.
const STEP_M: f64 = 0.12;
/// A sonar that was silent for longer begins anew, ns.
/// Ten firing cycles of a ring: a sonar that was silent for longer was switched off or its messages were lost. Half or twice of it gives
/// the same verdicts.
const BREAK_NS: u64 = 1_000_000_000;
/// A robot that is faster than this passes things sooner: its way counts as the time that it takes at this speed, m/s.
/// Half: 79.6 % / 1.09 %, twice: 84.8 % / 1.40 %.
const PACE_M_S: f64 = 0.25;
/// A beam that turns sweeps its echo's place aside; half of that counts as way.
/// Half: 85.0 % / 1.35 %, twice: 85.0 % / 1.31 %.
const TURN: f64 = 0.5;

/// A reading of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
struct Moment {
    stamp_ns: u64,
    origin_m: [f64; 2],
    axis_rad: f64,
    range_m: f64,
}

/// Echoes of one sonar, one after the other, of the same thing.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
struct Run {
    id: u64,
    sonar: u32,
    first: Moment,
    last: Moment,
    /// The sonar heard something else, or nothing, right before its first echo.
    begun: bool,
    /// The same after its last one.
    ended: bool,
}

/// The last thing that a sonar said.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
struct Said {
    sonar: u32,
    stamp_ns: u64,
    /// Its run; 0: silence.
    run: u64,
}

/// The runs of every sonar that pending readings belong to.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, Schema)]
pub(crate) struct Runs {
    runs: Queue<Run>,
    said: Vec<Said>,
    given: u64,
}

impl Runs {
    /// Takes the next reading of a sonar; the number of the run that it belongs to, 0 for silence.
    pub(crate) fn add(&mut self, sonar: u32, stamp_ns: u64, beam: &Beam) -> u64 {
        let before = self.said.iter().find(|said| said.sonar == sonar).filter(|said| stamp_ns.saturating_sub(said.stamp_ns) < BREAK_NS);
        let (begun, open) = (before.is_some(), before.map_or(0, |said| said.run));
        let [cos, sin] = beam.axis();
        let now = Moment { stamp_ns, origin_m: beam.origin_m(), axis_rad: sin.atan2(cos), range_m: beam.range_m() };
        let mut run = 0;
        if let Some(open) = self.runs.iter_mut().find(|run| run.id == open && open != 0) {
            if beam.echo() && (now.range_m - open.last.range_m).abs() < STEP_M {
                open.last = now;
                run = open.id;
            } else {
                open.ended = true;
            }
        }
        if beam.echo() && run == 0 {
            self.given += 1;
            run = self.given;
            self.runs.push_back(Run { id: run, sonar, first: now, last: now, begun, ended: false });
        }
        self.said.retain(|said| said.sonar != sonar);
        self.said.push(Said { sonar, stamp_ns, run });
        run
    }

    /// How long the thing of a run stayed in the beam, s; infinite while its beginning or end is not known.
    pub(crate) fn dwell_s(&self, run: u64) -> f64 {
        match self.runs.binary_search_by_key(&run, |run| run.id).ok().and_then(|at| self.runs.get(at)) {
            Some(run) if run.begun && run.ended => run.dwell_s(),
            _ => f64::INFINITY,
        }
    }

    /// Whether a run begins with the echo of this time.
    pub(crate) fn is_first(&self, run: u64, stamp_ns: u64) -> bool {
        let found = self.runs.binary_search_by_key(&run, |run| run.id).ok().and_then(|at| self.runs.get(at));
        found.is_some_and(|run| run.begun && run.first.stamp_ns == stamp_ns)
    }

    /// Forgets the runs that ended before a time.
    pub(crate) fn forget(&mut self, before_ns: u64) {
        self.runs.retain(|run| run.last.stamp_ns >= before_ns);
    }
}

impl Run {
    fn dwell_s(&self) -> f64 {
        let (first, last) = (&self.first, &self.last);
        let moved_m = (last.origin_m[0] - first.origin_m[0]).hypot(last.origin_m[1] - first.origin_m[1]);
        let turned = last.axis_rad - first.axis_rad;
        let way_m = moved_m + TURN * first.range_m * wrapped(turned).abs();
        seconds(last.stamp_ns.saturating_sub(first.stamp_ns)).max(way_m / PACE_M_S)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{Pose, SonarReading};
    use proptest::prelude::*;

    const PING_NS: u64 = 280_000_000;

    fn beam(pose: Pose, range_m: f64) -> Beam {
        Beam::new(&pose, &SonarReading { range_m, echo: u32::from(range_m < 3.0), ..SonarReading::default() }, 0.218)
    }

    /// The run of each of a sonar's readings at even times, and all runs; a range of 3 m is silence.
    fn after(ranges_m: &[f64]) -> (Vec<u64>, Runs) {
        let mut runs = Runs::default();
        let of = (0..).zip(ranges_m).map(|(ping, range_m)| runs.add(1, ping * PING_NS, &beam(Pose::default(), *range_m))).collect();
        (of, runs)
    }

    #[test]
    fn who_passes_before_a_wall_is_a_run_of_his_own() {
        let (of, runs) = after(&[2.0, 2.05, 1.1, 1.15, 1.2, 2.0, 2.0]);
        assert_eq!(of, [1, 1, 2, 2, 2, 3, 3]);
        assert!((runs.dwell_s(2) - 0.56).abs() < 1e-9, "{}", runs.dwell_s(2));
        assert_eq!(runs.dwell_s(1), f64::INFINITY, "it may have been there for long before");
        assert_eq!(runs.dwell_s(3), f64::INFINITY, "nor how long it will be");
    }

    #[test]
    fn silence_ends_a_run_and_belongs_to_none() {
        let (of, runs) = after(&[3.0, 1.0, 3.0, 1.0, 3.0]);
        assert_eq!(of, [0, 1, 0, 2, 0]);
        assert_eq!([runs.dwell_s(1), runs.dwell_s(2), runs.dwell_s(0)], [0.0, 0.0, f64::INFINITY]);
    }

    #[test]
    fn a_way_or_a_turn_counts_as_the_time_that_a_slower_robot_takes() {
        let drive = |to: Pose| {
            let mut runs = Runs::default();
            let said = [(Pose::default(), 3.0), (Pose::default(), 1.0), (to, 1.0), (to, 3.0)];
            for (ping, (pose, range_m)) in (0..).zip(said) {
                runs.add(1, ping * PING_NS, &beam(pose, range_m));
            }
            runs.dwell_s(1)
        };
        assert!((drive(Pose::default()) - 0.28).abs() < 1e-9);
        assert!((drive(Pose { x_m: 0.5, ..Pose::default() }) - 2.0).abs() < 1e-9);
        assert!((drive(Pose { yaw_rad: 0.5, ..Pose::default() }) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn each_sonar_has_its_own_runs_and_a_long_silence_begins_anew() {
        let mut runs = Runs::default();
        let mut add = |sonar, stamp_ns| runs.add(sonar, stamp_ns, &beam(Pose::default(), 1.0));
        assert_eq!([add(1, 0), add(2, 0), add(1, PING_NS), add(2, PING_NS), add(1, PING_NS + BREAK_NS)], [1, 2, 1, 2, 3]);
        runs.forget(PING_NS + 1);
        assert_eq!(runs.runs.iter().map(|run| run.id).collect::<Vec<_>>(), [3]);
    }

    proptest! {
        #[test]
        fn readings_of_a_run_follow_one_another_closely(ranges_m in proptest::collection::vec(0.2..3.5f64, 1..60)) {
            let (of, runs) = after(&ranges_m);
            for (pair, ranges) in of.windows(2).zip(ranges_m.windows(2)) {
                prop_assert_eq!(pair[0] == pair[1] && pair[0] != 0, ranges.iter().all(|r| *r < 3.0) && (ranges[0] - ranges[1]).abs() < STEP_M);
            }
            prop_assert!(of.iter().all(|run| runs.dwell_s(*run) >= 0.0));
        }
    }
}
