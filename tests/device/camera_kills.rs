//! kill -9 of the camera's driver: it opens the camera again, its pictures are numbered on, and their stream ends in order.

use drivelog::{Entry, Log};
use messages::CameraFrame;
use rustix::process::Signal;

use crate::harness::blocked_file::BlockedFile;
use crate::harness::processes::{kill, signal, stop};
use crate::harness::{Run, Sandbox, counter};
use crate::vivid::{self, webcam};

/// Pictures of each incarnation.
const ENOUGH: u64 = 10;

/// Takes pictures, kills the driver as told, has it take pictures again unless the run is `over` then, and checks the log.
#[track_caller]
fn kill_by(kill: impl FnOnce(&Sandbox, &mut Run), over: bool) {
    vivid::renew();
    let sandbox = Sandbox::new();
    let shooting = crate::deployment("shooting", &["recorder", "pioneer", "camera"]).set("pioneer.port", "/dev/no-robot");
    let mut run = sandbox.run(&webcam(shooting), &[]);
    kill(&sandbox, &mut run);
    if !over {
        run.wait_for("camera", "it has restarted", |it| it.restarts == 1 && counter(it, "pictures") >= Some(ENOUGH));
        signal(run.pid(), Signal::INT);
    }
    let ended = run.end();
    ended.assert_code(0);
    assert_eq!(ended.restarted(), Some("camera once"), "{}", ended.stderr);
    sandbox.assert_nothing_left();

    let mut log = Log::open(&sandbox.path("shooting-out").join("drive.mcap")).unwrap();
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
    assert_eq!(end, Some(last.0), "{}", ended.stderr);
}

fn wait_for_pictures(run: &mut Run) -> u32 {
    run.wait_for("camera", "it takes pictures", |it| counter(it, "pictures") >= Some(ENOUGH)).pid
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_camera_killed_when_it_starts_restarts() {
    kill_by(|_, run| kill(run.pid_of("camera")), false);
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_camera_killed_while_it_takes_pictures_numbers_on() {
    kill_by(|_, run| kill(wait_for_pictures(run)), false);
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_camera_killed_while_writing_a_checkpoint_numbers_on() {
    let writing = |sandbox: &Sandbox, run: &mut Run| {
        let camera = wait_for_pictures(run);
        let file = BlockedFile::at_checkpoint(&sandbox.path("shooting-out").join("state"), "camera");
        file.kill_writer(camera);
    };
    kill_by(writing, false);
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_camera_killed_when_asked_to_stop_ends_its_stream() {
    let asked = |_: &Sandbox, run: &mut Run| {
        let camera = wait_for_pictures(run);
        stop(camera);
        signal(run.pid(), Signal::INT);
        run.wait_for_line("stopping in order");
        kill(camera);
    };
    kill_by(asked, true);
}
