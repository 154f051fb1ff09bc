//! The robot's driver over a USB serial adapter that is pulled out in mid-drive and put back.

use std::path::Path;

use drivelog::{Entry, Log};
use messages::{AFTER_DOUBT, SonarScan};
use rustix::process::Signal;

use crate::adapter::{self, End, PORT};
use crate::harness::processes::signal;
use crate::harness::{Sandbox, counter};

/// The simulated robot's speed, m/s.
const SPEED_M_S: f64 = 0.25;

/// How long a robot's counters are followed over a gap, s.
const FOLLOWED_S: f64 = 4.0;

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn an_adapter_pulled_out_and_put_back_leaves_one_marked_gap() {
    let sandbox = Sandbox::new();
    let serial = crate::deployment("serial", &["recorder", "mapping", "pioneer"]).set("pioneer.port", PORT);
    adapter::connect(End::Robot);
    let mut run = sandbox.run(&serial, &[]);
    run.wait_for("pioneer", "it waits for its port", |it| it.note.as_str().contains("no such device"));
    adapter::plug();
    run.wait_for("mapping", "60 scans", |it| it.received > 60);
    adapter::pull();
    run.wait_for("pioneer", "the port is gone", |it| it.note.as_str().starts_with("/dev/ttyUSB0: no such"));
    let at_gap = run.wait_for("mapping", "any status", |_| true).received;
    adapter::plug();
    let pioneer = run.wait_for("pioneer", "80 more scans", |it| it.sent > at_gap + 80);
    assert_eq!((pioneer.restarts, counter(&pioneer, "reconnects")), (0, Some(1)));
    signal(run.pid(), Signal::INT);
    let ended = run.end();
    adapter::pull();
    ended.assert_code(0);
    check_scans(&scans(&sandbox.path("serial-out").join("drive.mcap")));
}

fn scans(log: &Path) -> Vec<(u64, SonarScan)> {
    let mut log = Log::open(log).unwrap();
    let mut scans = Vec::new();
    while let Some(entry) = log.next_of::<SonarScan>().unwrap() {
        if let Entry::Message { seq, stamp_ns, payload } = entry {
            scans.push((stamp_ns, payload));
            assert_eq!(seq, scans.len() as u64, "no number is missing");
        }
    }
    scans
}

/// The gap is marked; the pose after it is that before it, or the one to which the robot has driven meanwhile. It never jumps.
fn check_scans(scans: &[(u64, SonarScan)]) {
    let time_ns = |at: usize| scans[at].0 - scans[at - 1].0;
    let gap = (1..scans.len()).max_by_key(|&at| time_ns(at)).unwrap();
    // In that time a Pioneer 1 can drive more than half a wrap of its counters.
    assert_eq!(scans[gap].1.after_gap, AFTER_DOUBT, "after {} ns", time_ns(gap));
    for at in 1..scans.len() {
        let (before, after, time_s) = (scans[at - 1].1.pose, scans[at].1.pose, time_ns(at) as f64 / 1e9);
        let moved_m = (after.x_m - before.x_m).hypot(after.y_m - before.y_m);
        assert!(moved_m < SPEED_M_S * time_s + 0.1, "{moved_m} m in {time_s} s before scan {}", at + 1);
        let expected_m = if time_s <= FOLLOWED_S { SPEED_M_S * time_s } else { 0.0 };
        assert!(at != gap || (moved_m - expected_m).abs() < 0.1, "{moved_m} m over the gap of {time_s} s, expected {expected_m}");
    }
    let driven_m = scans[scans.len() - 1].1.pose.x_m;
    assert!(driven_m > 2.0, "{driven_m}");
}
