//! The whole robot: a robot on the adapter, the virtual camera, all services, and faults on the way.

use rustix::process::Signal;

use crate::adapter::{self, End, PORT};
use crate::harness::processes::{kill, signal};
use crate::harness::{FREE, PgmMap, Run, Sandbox, is_running};
use crate::vivid::{self, webcam};

const PROCESSES: [&str; 7] = ["recorder", "mapping", "std", "sbs", "fti", "pioneer", "camera"];

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_drive_with_all_services_maps_the_corridor() {
    vivid::renew();
    let sandbox = Sandbox::new();
    let drive = webcam(crate::deployment("drive", &PROCESSES)).set("pioneer.port", PORT);
    adapter::connect(End::Robot);
    adapter::plug();
    let mut run = sandbox.run(&drive, &[]);
    let wait_for_fti = |run: &mut Run, words: &str| run.wait_for("fti", words, |it| it.note.as_str().starts_with(words));
    wait_for_fti(&mut run, "sonar and camera");
    kill(run.wait_for("mapping", "40 scans", |it| it.received > 40).pid);
    run.wait_for("mapping", "it has restarted", |it| it.restarts == 1 && is_running(it));
    vivid::pull();
    run.wait_for("camera", "the camera is gone", |it| it.note.as_str().contains("no such device"));
    wait_for_fti(&mut run, "sonar only since");
    vivid::plug();
    wait_for_fti(&mut run, "sonar and camera");
    run.wait_for("pioneer", "200 scans", |it| it.sent > 200);
    signal(run.pid(), Signal::INT);
    let ended = run.end();
    adapter::pull();
    ended.map();
    let map = PgmMap::read(&sandbox.path("drive-out"));
    // The robot has driven 4.5 m: the right wall on the way, and its path.
    assert!(map.wall_share([2.3, -1.0], [3.9, -1.0], 0.1) > 0.8, "the right wall");
    let free = (10..40).filter(|step| map.at(f64::from(*step) * 0.1, 0.0) == FREE).count();
    assert!(free > 27, "{free} of 30 cells along the robot's path are free: {}", ended.stderr);
}
