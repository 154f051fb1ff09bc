//! The machine's wall clock is set while the robot drives.

use std::path::Path;

use drivelog::{Entry, Log, Logged};
use messages::{CameraFrame, FilterVerdict, Heartbeat, ProcessStatus, SonarScan};
use rustix::process::Signal;
use rustix::time::{ClockId, Timespec, clock_gettime, clock_settime};

use crate::adapter::{self, End, PORT};
use crate::harness::processes::signal;
use crate::harness::{FREE, PgmMap, Run, Sandbox, counter, is_running};
use crate::vivid::{self, webcam};

const PROCESSES: [&str; 7] = ["recorder", "mapping", "std", "sbs", "fti", "pioneer", "camera"];

const HOUR_S: i64 = 3600;

/// Between two stamps of a stream lies less than this, however slow the machine is, and no step of the clock fits in.
const STEADY_NS: u64 = HOUR_S as u64 * 1_000_000_000 / 2;

fn set_the_clock(by_s: i64) {
    let Timespec { tv_sec, tv_nsec } = clock_gettime(ClockId::Realtime);
    clock_settime(ClockId::Realtime, Timespec { tv_sec: tv_sec + by_s, tv_nsec }).unwrap();
}

/// Waits until all processes have worked on: scans reach the map, and pictures the filter.
fn wait_for_work(run: &mut Run) {
    for process in ["mapping", "sbs", "fti", "recorder"] {
        let count = |it: &ProcessStatus| if process == "fti" { it.sent } else { it.received };
        let now = count(&run.wait_for(process, "any status", |_| true));
        run.wait_for(process, "40 more messages", |it| count(it) > now + 40);
    }
    run.wait_for("fti", "it has both", |it| it.note.as_str() == "sonar and camera");
}

#[track_caller]
fn assert_undisturbed(processes: &[ProcessStatus]) {
    assert_eq!(processes.len(), PROCESSES.len());
    for it in processes {
        assert!(is_running(it) && it.restarts == 0 && it.refused == 0, "{it:?}");
        // An emulated machine skips pictures that come faster than it processes them, and readers of their results miss those, too.
        assert!(!["mapping", "std"].contains(&it.process.as_str()) || it.lost == 0, "{it:?}");
        for name in ["inputs refused", "reconnects", "reopenings", "stream restarts", "refused odometry", "readings undecided"] {
            assert_eq!(counter(it, name).unwrap_or(0), 0, "{name}: {it:?}");
        }
    }
}

#[track_caller]
fn check_stamps(what: &str, stamps_ns: &[u64]) {
    assert!(stamps_ns.len() > 40, "{} of {what}", stamps_ns.len());
    for pair in stamps_ns.windows(2) {
        assert!(pair[0].abs_diff(pair[1]) < STEADY_NS, "{what}: {} ns after {} ns", pair[1], pair[0]);
    }
}

fn stamps_ns<T: Logged>(log: &Path) -> Vec<u64> {
    let mut log = Log::open(log).unwrap();
    std::iter::from_fn(|| stamp_of(log.next_of::<T>().unwrap()?)).collect()
}

fn picture_stamps_ns(log: &Path) -> Vec<u64> {
    let mut log = Log::open(log).unwrap();
    std::iter::from_fn(|| stamp_of(log.next_picture::<CameraFrame>().unwrap()?)).collect()
}

fn stamp_of<T>(entry: Entry<T>) -> Option<u64> {
    if let Entry::Message { stamp_ns, .. } = entry { Some(stamp_ns) } else { None }
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn setting_the_clock_by_hours_disturbs_no_process() {
    vivid::renew();
    let sandbox = Sandbox::new();
    let drive = webcam(crate::deployment("drive", &PROCESSES)).set("pioneer.port", PORT);
    let drive = drive.set("fti.patience_s", 10);
    adapter::connect(End::Robot);
    adapter::plug();
    let mut run = sandbox.run(&drive, &[]);
    wait_for_work(&mut run);
    for by_s in [HOUR_S, -2 * HOUR_S] {
        set_the_clock(by_s);
        wait_for_work(&mut run);
    }
    run.wait_for_status("any status", |status| {
        assert_undisturbed(status.processes());
        true
    });
    signal(run.pid(), Signal::INT);
    let ended = run.end();
    set_the_clock(HOUR_S);
    adapter::pull();
    ended.map();
    let said = &ended.stderr;
    assert_eq!(ended.restarted(), None, "{said}");
    assert!(!["refused", "killed", "starts again", "no sonar motion"].iter().any(|it| said.contains(it)), "{said}");

    let log = sandbox.path("drive-out").join("drive.mcap");
    check_stamps("scans", &stamps_ns::<SonarScan>(&log));
    check_stamps("verdicts", &stamps_ns::<FilterVerdict>(&log));
    check_stamps("heartbeats", &stamps_ns::<Heartbeat>(&log));
    check_stamps("pictures", &picture_stamps_ns(&log));
    let map = PgmMap::read(&sandbox.path("drive-out"));
    let free = (5..20).filter(|step| map.at(f64::from(*step) * 0.1, 0.0) == FREE).count();
    assert!(free > 12, "{free} of 15 cells along the robot's path are free: {said}");
}
