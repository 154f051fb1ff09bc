//! The machine's wall clock is set while the robot drives.

use std::path::Path;

use drivelog::{Entry, Log, Logged};
use messages::{CameraFrame, FilterVerdict, Heartbeat, SonarScan};
use rustix::process::Signal;
use rustix::time::{ClockId, Timespec, clock_gettime, clock_settime};
use serde_json::Value;

use crate::PATIENT;
use crate::adapter::{self, End, PORT};
use crate::harness::{Bench, FREE, PgmMap, Run, map_sha256, signal, text};
use crate::vivid::{self, DEVICE, WEBCAM};

const PROCESSES: [&str; 7] = ["recorder", "mapping", "std", "sbs", "fti", "pioneer", "camera"];

const HOUR_S: i64 = 3600;

/// Between two stamps of a stream lies less than this, however slow the machine is, and no step of the clock fits in.
const STEADY_NS: u64 = HOUR_S as u64 * 1_000_000_000 / 2;

fn set_the_clock(by_s: i64) {
    let Timespec { tv_sec, tv_nsec } = clock_gettime(ClockId::Realtime);
    clock_settime(ClockId::Realtime, Timespec { tv_sec: tv_sec + by_s, tv_nsec }).unwrap();
}

/// Everybody works on: scans reach the map, and pictures the filter.
fn goes_on(bench: &Bench) {
    for (process, count) in [("mapping", "received"), ("sbs", "received"), ("fti", "sent"), ("recorder", "received")] {
        let now = bench.wait_for(process, "it works", |it| it[count].is_u64())[count].as_u64();
        bench.wait_for(process, "it goes on", |it| it[count].as_u64() > now.map(|now| now + 40));
    }
    bench.wait_for("fti", "it has both", |it| it["note"] == "sonar and camera");
}

#[track_caller]
fn nobody_minds(processes: &[Value]) {
    assert_eq!(processes.len(), PROCESSES.len());
    for it in processes {
        let counter = |name: &str| it["counters"][name].as_u64().unwrap_or(0);
        assert_eq!((&it["state"], &it["restarts"], &it["refused"]), (&"running".into(), &0.into(), &0.into()), "{it}");
        // Pictures that come faster than an emulated machine looks at them are left out, for whoever waits for what they show, too.
        assert!(!["mapping", "std"].contains(&it["process"].as_str().unwrap()) || it["lost"] == 0, "{it}");
        for name in ["inputs refused", "reconnects", "reopenings", "stream restarts", "refused odometry", "readings undecided"] {
            assert_eq!(counter(name), 0, "{name}: {it}");
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
fn an_hour_forward_and_two_back() {
    vivid::renew();
    let bench = Bench::new();
    let processes: String = PROCESSES.iter().map(|name| format!("[[process]]\nname = \"{name}\"\nrun = \"{name}\"\n")).collect();
    let settings = bench.write(
        "drive.toml",
        &format!(
            "name = \"drive\"\nout = \"out\"\n{processes}{PATIENT}[pioneer]\nport = \"{PORT}\"\n[mapping]\nexpect_verdicts = true\n\
             [fti]\nexpect_camera = true\npatience_s = 10\n[camera]\ndevice = \"{DEVICE}\"\n{WEBCAM}"
        ),
    );
    adapter::connect(End::Robot);
    adapter::plug();
    let run = Run::start(bench.stillmap(["run", settings.to_str().unwrap()]));
    goes_on(&bench);
    for by_s in [HOUR_S, -2 * HOUR_S] {
        set_the_clock(by_s);
        goes_on(&bench);
    }
    nobody_minds(&bench.processes());
    signal(run.pid().into(), Signal::INT);
    let output = run.end();
    set_the_clock(HOUR_S);
    adapter::pull();
    map_sha256(&output);
    let (said, told) = (text(&output.stderr), text(&output.stdout));
    assert!(
        !told.contains("restarted") && !["refused", "killed", "starts again", "no sonar motion"].iter().any(|it| said.contains(it)),
        "{said}"
    );

    let log = bench.path("out").join("drive.mcap");
    check_stamps("scans", &stamps_ns::<SonarScan>(&log));
    check_stamps("verdicts", &stamps_ns::<FilterVerdict>(&log));
    check_stamps("heartbeats", &stamps_ns::<Heartbeat>(&log));
    check_stamps("pictures", &picture_stamps_ns(&log));
    let map = PgmMap::read(&bench.path("out"));
    let free = (5..20).filter(|step| map.at(f64::from(*step) * 0.1, 0.0) == FREE).count();
    assert!(free > 12, "{free} of 15 places along the robot's way are free: {said}");
}
