//! kill -9 of the camera's driver: it opens the camera again, its pictures are numbered on, and they come to their end.

use std::path::PathBuf;

use drivelog::{Entry, Log};
use messages::CameraFrame;
use rustix::process::Signal;

use crate::PATIENT;
use crate::harness::replays::{Watched, kill_in_the_middle_of_one_of_its_checkpoints, pid_of};
use crate::harness::{Bench, kill, signal};
use crate::vivid::{self, DEVICE, WEBCAM};

/// Pictures that each incarnation gives at the least.
const ENOUGH: u64 = 10;

/// Takes pictures, kills the driver as told, has it take pictures again if it is not to be `over`, and looks at what was recorded.
#[track_caller]
fn goes_on_after(kill: impl FnOnce(&Bench, &mut Watched), over: bool) {
    vivid::renew();
    let bench = Bench::new();
    let processes: String =
        ["recorder", "pioneer", "camera"].iter().map(|name| format!("[[process]]\nname = \"{name}\"\nrun = \"{name}\"\n")).collect();
    let settings = bench.write(
        "shooting.toml",
        &format!(
            "name = \"shooting\"\nout = \"out\"\n{processes}{PATIENT}[pioneer]\nport = \"/dev/no-robot\"\n\
             [camera]\ndevice = \"{DEVICE}\"\n{WEBCAM}"
        ),
    );
    let mut run = Watched::start(bench.stillmap(["run", settings.to_str().unwrap()]));
    drop(run.wait_for_line("recorder   is up"));
    bench.remember_domain();
    kill(&bench, &mut run);
    if !over {
        bench.wait_for("camera", "it is back", |it| it["restarts"] == 1 && it["counters"]["pictures"].as_u64() >= Some(ENOUGH));
        signal(run.pid().into(), Signal::INT);
    }
    let (code, told, said) = run.end();
    assert_eq!(code, Some(0), "{told}{said}");
    assert!(told.lines().any(|line| line == "restarted  camera once"), "{told}{said}");
    assert_eq!(bench.left_behind(), Vec::<PathBuf>::new());

    let mut log = Log::open(&bench.path("out").join("drive.mcap")).unwrap();
    let (mut last, mut end) = ((0, 0), None);
    while let Some(entry) = log.next_picture::<CameraFrame>().unwrap() {
        match entry {
            Entry::Message { seq, stamp_ns, .. } => {
                assert!(seq > last.0 && stamp_ns > last.1, "picture {seq} at {stamp_ns} ns after {last:?}");
                last = (seq, stamp_ns);
            }
            Entry::End { seq, .. } => end = Some(seq),
        }
    }
    assert!(last.0 >= ENOUGH, "{last:?}");
    assert_eq!(end, Some(last.0), "{said}");
}

fn takes_pictures(bench: &Bench) {
    bench.wait_for("camera", "it takes pictures", |it| it["counters"]["pictures"].as_u64() >= Some(ENOUGH));
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn when_it_starts() {
    goes_on_after(|_, run| kill(pid_of(run, "camera")), false);
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn while_it_takes_pictures() {
    let steady = |bench: &Bench, run: &mut Watched| {
        takes_pictures(bench);
        kill(pid_of(run, "camera"));
    };
    goes_on_after(steady, false);
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn while_it_writes_a_checkpoint() {
    let writing = |bench: &Bench, run: &mut Watched| {
        takes_pictures(bench);
        kill_in_the_middle_of_one_of_its_checkpoints(run, "camera", &bench.path("out").join("state/camera.fresh"));
    };
    goes_on_after(writing, false);
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn when_it_is_asked_to_stop() {
    let asked = |bench: &Bench, run: &mut Watched| {
        takes_pictures(bench);
        let camera = pid_of(run, "camera");
        signal(camera, Signal::STOP);
        signal(run.pid().into(), Signal::INT);
        drop(run.wait_for_line("stopping in order"));
        kill(camera);
    };
    goes_on_after(asked, true);
}
