//! Everything at once: a robot on the adapter, the virtual camera, all services, and what goes wrong on the way.

use rustix::process::Signal;

use crate::PATIENT;
use crate::adapter::{self, End, PORT};
use crate::harness::{Bench, FREE, PgmMap, Run, kill, map_sha256, signal, text};
use crate::vivid::{self, DEVICE, WEBCAM};

const SERVICES: [&str; 5] = ["recorder", "mapping", "std", "sbs", "fti"];

#[test]
#[ignore = "runs in a virtual machine: tests/device/run"]
fn a_drive_with_all_services_gives_its_map() {
    vivid::renew();
    let bench = Bench::new();
    let processes: String =
        SERVICES.iter().chain(&["pioneer", "camera"]).map(|name| format!("[[process]]\nname = \"{name}\"\nrun = \"{name}\"\n")).collect();
    let settings = bench.write(
        "drive.toml",
        &format!(
            "name = \"drive\"\nout = \"out\"\n{processes}{PATIENT}[pioneer]\nport = \"{PORT}\"\n[mapping]\nexpect_verdicts = true\n\
             [fti]\nexpect_camera = true\n[camera]\ndevice = \"{DEVICE}\"\n{WEBCAM}"
        ),
    );
    adapter::connect(End::Robot);
    adapter::plug();
    let run = Run::start(bench.stillmap(["run", settings.to_str().unwrap()]));
    let fti_says = |words: &str| bench.wait_for("fti", words, |it| it["note"].as_str().is_some_and(|note| note.starts_with(words)));
    fti_says("sonar and camera");
    let before = bench.wait_for("mapping", "40 scans", |it| it["received"].as_u64() > Some(40));
    kill(before["pid"].as_u64().unwrap());
    bench.wait_for("mapping", "it is back", |it| it["restarts"] == 1 && it["state"] == "running");
    vivid::pull();
    bench.wait_for("camera", "the camera is gone", |it| it["note"].as_str().is_some_and(|note| note.contains("no such device")));
    fti_says("sonar only since");
    vivid::plug();
    fti_says("sonar and camera");
    bench.wait_for("pioneer", "200 scans", |it| it["sent"].as_u64() > Some(200));
    signal(run.pid().into(), Signal::INT);
    let output = run.end();
    adapter::pull();
    map_sha256(&output);
    let map = PgmMap::read(&bench.path("out"));
    // The robot has come 4.5 m far: the right wall on the way, and what it drove through.
    assert!(map.wall_share([2.3, -1.0], [3.9, -1.0], 0.1) > 0.8, "the right wall");
    let free = (10..40).filter(|step| map.at(f64::from(*step) * 0.1, 0.0) == FREE).count();
    assert!(free > 27, "{free} of 30 places along the robot's way are free: {}", text(&output.stderr));
}
