//! The commands that look at one device before the first drive, with everything that can be wrong.

use std::os::unix::process::CommandExt;

use crate::adapter::{self, End, PORT};
use crate::harness::{Ended, Sandbox};
use crate::vivid::{self, DEVICE};

/// The output of a command that succeeds.
#[track_caller]
fn output(sandbox: &Sandbox, arguments: &[&str]) -> String {
    let ended = sandbox.output(arguments);
    ended.assert_code(0);
    ended.stdout
}

/// The one line of a command that is refused.
#[track_caller]
fn refused_line(ended: &Ended) -> String {
    ended.assert_code(2);
    assert_eq!(ended.stderr.lines().count(), 1, "{}", ended.stderr);
    ended.stderr.trim_end().trim_start_matches("error: ").to_owned()
}

/// Runs a command as a user without groups.
fn as_other_user(sandbox: &Sandbox, arguments: &[&str]) -> Ended {
    let mut command = sandbox.stillmap(arguments);
    command.uid(65534).gid(65534).current_dir("/");
    sandbox.start(command).end()
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn the_list_shows_formats_sizes_and_controls() {
    vivid::renew();
    let sandbox = Sandbox::new();
    let list = output(&sandbox, &["camera", "list"]);
    assert!(list.starts_with("/dev/video0: vivid (vivid, platform:vivid-000)\n"), "{list}");
    assert!(list.contains("inputs: 0 Webcam 0, 1 TV 0,"), "{list}");
    assert!(list.contains("\n  GREY: 320 × 180 to "), "{list}");
    assert!(list.contains("\n  YUYV: 320 × 180 to "), "{list}");
    assert!(list.contains("gain 0 to 255 (100)"), "{list}");
    assert_eq!(
        refused_line(&as_other_user(&sandbox, &["camera", "list", DEVICE])),
        "/dev/video0: permission denied: is this user in the group that may use it (video)?"
    );
    vivid::pull();
    assert_eq!(refused_line(&sandbox.output(["camera", "list"])), "no camera: there is no /dev/video*. Is it plugged in?");
    vivid::plug();
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_snapshot_has_the_size_asked_for_or_is_refused() {
    vivid::renew();
    let sandbox = Sandbox::new();
    let take =
        |size: &str, input: &str| sandbox.output(["camera", "snapshot", DEVICE, "--out", "shot.png", "--size", size, "--input", input]);
    for (size, input) in [("320x180", "0"), ("640x360", "0"), ("160x120", "3")] {
        take(size, input).assert_code(0);
        let picture = image::open(sandbox.path("shot.png")).unwrap().into_luma8();
        assert_eq!(format!("{}x{}", picture.width(), picture.height()), size);
        // The test picture has bars and moving text.
        let mut seen = [false; 256];
        picture.pixels().for_each(|pixel| seen[usize::from(pixel.0[0])] = true);
        let levels = seen.iter().filter(|seen| **seen).count();
        assert!(levels > 3, "{size}: a picture of {levels} grey levels");
    }
    assert_eq!(
        refused_line(&take("160x120", "0")),
        "/dev/video0: gives 320 × 180, not the 160 × 120 asked for: `stillmap camera list` shows what it offers"
    );
    assert_eq!(refused_line(&take("320x180", "9")), "/dev/video0: no input 9: it has 4, numbered from 0");
    assert_eq!(
        refused_line(&sandbox.output(["camera", "snapshot", "/dev/video7", "--out", "shot.png"])),
        "/dev/video7: no such device: is the camera plugged in? `stillmap camera list` shows what there is"
    );
    assert_eq!(
        refused_line(&sandbox.output(["camera", "snapshot", "/dev/ttyS0", "--out", "shot.png"])),
        "/dev/ttyS0: not a camera that streams pictures"
    );
}

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn the_probe_names_what_is_at_the_end_of_the_cable() {
    let sandbox = Sandbox::new();
    let probe = || sandbox.output(["pioneer", "probe", PORT]);
    assert_eq!(
        refused_line(&probe()),
        "/dev/ttyUSB0: no such device: is the adapter plugged in? `ls /dev/serial/by-id` shows what there is"
    );
    adapter::connect(End::Robot);
    adapter::plug();
    let answer = output(&sandbox, &["pioneer", "probe", PORT]);
    assert!(answer.starts_with("/dev/ttyUSB0: \"stillmap-simulator\", a Pioneer pion1m, at 9600 baud\n"), "{answer}");
    assert!(answer.contains("robot.model = \"pioneer-1\"\n  all 7 sonars fire\n"), "{answer}");
    assert_eq!(
        refused_line(&as_other_user(&sandbox, &["pioneer", "probe", PORT])),
        "/dev/ttyUSB0: permission denied: is this user in the group that may use it (dialout)?"
    );
    {
        let _other = serial_in_use();
        assert_eq!(refused_line(&probe()), "/dev/ttyUSB0: in use by another program");
    }
    adapter::connect(End::Nothing);
    let silent = refused_line(&probe());
    assert!(silent.starts_with("/dev/ttyUSB0: silence at 9600, 38400, "), "{silent}");
    adapter::connect(End::Stranger);
    let stranger = refused_line(&probe());
    assert!(stranger.starts_with("/dev/ttyUSB0: what answers is not a Pioneer ("), "{stranger}");
    adapter::pull();
    assert_eq!(refused_line(&sandbox.output(["pioneer", "probe", "/dev/null"])), "/dev/null: not a serial port");
}

/// Another program on the port, which locks it as serial programs do.
fn serial_in_use() -> rustix::fd::OwnedFd {
    use rustix::fs::{FlockOperation, Mode, OFlags, flock};
    let port = rustix::fs::open(PORT, OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK, Mode::empty()).unwrap();
    flock(&port, FlockOperation::NonBlockingLockExclusive).unwrap();
    port
}
