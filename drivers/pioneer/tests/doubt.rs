//! A pose that may be wrong is never passed off as right: silence, a port that was gone, a process that was down while the robot drove.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

mod support;

use messages::{AFTER_DOUBT, AFTER_LOSS};
use proptest::prelude::*;
use stillmap_pioneer::{Doubt, Event};
use support::{Drive, MS, Robot, S};

/// How a robot is out of hearing for a while.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Absence {
    /// The line carries nothing.
    Silent,
    /// The adapter is pulled out.
    Unplugged,
    /// The driver is killed, and started again with its checkpoint.
    Down,
}

/// What became of the pose.
#[derive(Debug)]
struct Found {
    /// Between the pose and the robot's own way, m.
    error_m: f64,
    doubts: Vec<Doubt>,
    /// `after_gap` of the first scan after the absence.
    after_gap: u32,
    note: String,
}

/// A robot drives 5 s at 0.3 m/s, is out of hearing for so long at another speed (m a cycle), and drives 5 s more.
fn drive(robot: Robot, absence: Absence, away_ns: u64, m_per_cycle: f64) -> Found {
    let mut drive = Drive::new(robot);
    drive.run(5 * S);
    drive.robot.m_per_cycle = m_per_cycle;
    let saved = *drive.scans.last().unwrap();
    match absence {
        Absence::Silent => drive.quiet = true,
        Absence::Unplugged => drive.plugged = false,
        Absence::Down => {}
    }
    let mut after = if absence == Absence::Down {
        let later_ns = drive.now_ns + away_ns;
        drive.robot.speak(later_ns);
        Drive::going_on(drive.robot, Some(saved), later_ns)
    } else {
        drive.run(away_ns);
        drive.scans.clear();
        (drive.quiet, drive.plugged) = (false, true);
        drive
    };
    // A line that was lost is looked for at every baud rate.
    while after.scans.is_empty() {
        after.run(S);
    }
    after.run(5 * S);
    after.check_stream();
    let first_m = saved.scan.pose.x_m - 0.03 * (saved.seq - 1) as f64;
    let way_m = after.robot.x_m - after.robot.opened_at_m - 0.03;
    Found {
        error_m: (after.pose_x_m() - first_m - way_m).abs(),
        doubts: after
            .events
            .iter()
            .filter_map(|event| if let Event::PoseDoubtful { doubt } = event { Some(*doubt) } else { None })
            .collect(),
        after_gap: after.scans[0].scan.after_gap,
        note: after.session.note("x"),
    }
}

const ABSENCES: [Absence; 3] = [Absence::Silent, Absence::Unplugged, Absence::Down];

#[test]
fn counters_that_bridge_an_absence_are_used_without_a_doubt() {
    for absence in ABSENCES {
        let found = drive(Robot::p3_dx(), absence, 7 * S, 0.05);
        assert!(found.error_m < 0.06 && found.doubts.is_empty(), "{absence:?} {found:?}");
        assert_eq!(found.after_gap, AFTER_LOSS, "{absence:?}");
    }
    let found = drive(Robot::pioneer_1(), Absence::Silent, 800 * MS, 0.03);
    assert!(found.error_m < 0.04 && found.doubts.is_empty(), "{found:?}");
}

#[test]
fn an_absence_longer_than_the_counters_bridge_is_said() {
    for (absence, away_ns) in [(Absence::Silent, 7 * S), (Absence::Unplugged, 20 * S), (Absence::Down, 10 * S)] {
        let found = drive(Robot::pioneer_1(), absence, away_ns, 0.045);
        assert!(found.error_m > 1.6, "the case at hand: {absence:?} {found:?}");
        assert_eq!((found.doubts.len(), found.after_gap), (1, AFTER_DOUBT), "{absence:?} {found:?}");
        assert!(matches!(found.doubts[0], Doubt::Wraps { wrap_m, .. } if (wrap_m - 1.66).abs() < 0.01), "{found:?}");
        assert!(found.note.starts_with("POSE DOUBTFUL since 1 gap; pioneer-1"), "{}", found.note);
    }
}

/// What a robot does within a few seconds is followed as well as can be: one that drove on, and one that stopped at once.
#[test]
fn the_best_guess_of_a_short_absence_is_the_way_it_went() {
    for absence in ABSENCES {
        for m_per_cycle in [0.0, 0.03] {
            let found = drive(Robot::pioneer_1(), absence, 3 * S, m_per_cycle);
            assert!(found.error_m < 0.07 && found.doubts.len() == 1, "{absence:?} {m_per_cycle} {found:?}");
        }
    }
}

#[test]
fn a_clock_that_stood_still_is_time_all_the_same() {
    let mut drive = Drive::new(Robot::pioneer_1());
    drive.run(5 * S);
    drive.session.add_unseen(60 * S);
    drive.run(S);
    let doubts: Vec<_> = drive.events.iter().filter(|event| matches!(event, Event::PoseDoubtful { .. })).collect();
    assert_eq!(doubts.len(), 1, "{doubts:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 128, ..ProptestConfig::default() })]

    /// At up to the speed that the settings believe, whatever happens: a wrong pose is never passed off as right.
    #[test]
    fn a_wrong_pose_is_never_passed_off_as_right(
        absence in prop::sample::select(&ABSENCES[..]),
        p3_dx: bool,
        away_ms in 100_u64..20_000,
        m_per_cycle in 0.0..0.095_f64,
    ) {
        let robot = if p3_dx { Robot::p3_dx() } else { Robot::pioneer_1() };
        let found = drive(robot, absence, away_ms * MS, m_per_cycle);
        prop_assert!(found.error_m < 0.12 || found.after_gap == AFTER_DOUBT, "{found:?}");
        prop_assert_eq!(found.after_gap == AFTER_DOUBT, !found.doubts.is_empty());
    }
}
