//! The robot's driver over a USB serial adapter that is pulled out in mid-drive and put back.

use drivelog::{Entry, Log};
use messages::SonarScan;
use rustix::process::Signal;

use crate::PATIENT;
use crate::adapter::{self, End, PORT};
use crate::harness::{Bench, Run, signal, text};

/// The simulated robot's speed, m/s.
const SPEED_M_S: f64 = 0.25;

/// How long a robot's counters are followed over a gap, s.
const FOLLOWED_S: f64 = 4.0;

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn pulled_out_in_mid_drive_and_put_back() {
    let bench = Bench::new();
    let settings = bench.write(
        "serial.toml",
        &format!(
            "name = \"serial\"\nout = \"out\"\n[[process]]\nname = \"recorder\"\nrun = \"recorder\"\n\
             [[process]]\nname = \"mapping\"\nrun = \"mapping\"\n[[process]]\nname = \"pioneer\"\nrun = \"pioneer\"\n\
             {PATIENT}[pioneer]\nport = \"{PORT}\"\n"
        ),
    );
    adapter::connect(End::Robot);
    let run = Run::start(bench.stillmap(["run", settings.to_str().unwrap()]));
    bench.wait_for("pioneer", "it waits for its port", |it| it["note"].as_str().is_some_and(|note| note.contains("no such device")));
    adapter::plug();
    bench.wait_for("mapping", "60 scans", |it| it["received"].as_u64() > Some(60));
    adapter::pull();
    bench.wait_for("pioneer", "the port is gone", |it| it["note"].as_str().is_some_and(|note| note.starts_with("/dev/ttyUSB0: no such")));
    let at_gap = bench.wait_for("mapping", "it lives", |it| it["received"].is_u64())["received"].as_u64().unwrap();
    adapter::plug();
    let pioneer = bench.wait_for("pioneer", "80 more scans", |it| it["sent"].as_u64() > Some(at_gap + 80));
    assert_eq!((&pioneer["restarts"], &pioneer["counters"]["reconnects"]), (&0.into(), &1.into()));
    signal(run.pid().into(), Signal::INT);
    let output = run.end();
    adapter::pull();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    check_scans(&scans(&bench));
}

fn scans(bench: &Bench) -> Vec<(u64, SonarScan)> {
    let mut log = Log::open(&bench.path("out").join("drive.mcap")).unwrap();
    let mut scans = Vec::new();
    while let Some(entry) = log.next_of::<SonarScan>().unwrap() {
        if let Entry::Message { seq, stamp_ns, payload } = entry {
            scans.push((stamp_ns, payload));
            assert_eq!(seq, scans.len() as u64, "no number is missing");
        }
    }
    scans
}

/// The gap is marked; over it the pose goes on from where it was, or to where the robot has driven meanwhile. It never jumps.
fn check_scans(scans: &[(u64, SonarScan)]) {
    let time_ns = |at: usize| scans[at].0 - scans[at - 1].0;
    let gap = (1..scans.len()).max_by_key(|&at| time_ns(at)).unwrap();
    assert_eq!(scans[gap].1.after_gap, 1, "after {} ns", time_ns(gap));
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
