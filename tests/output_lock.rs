//! An output folder that another run uses: a second one changes nothing in it.

use std::fs::{self, File};

use rustix::fs::{FlockOperation, flock};
use rustix::process::Signal;

use crate::harness::processes::signal;
use crate::harness::{Deployment, Sandbox, is_running};

#[test]
fn a_demo_changes_nothing_in_the_output_folder_of_another_run() {
    let sandbox = Sandbox::new();
    let out = sandbox.path("taken");
    fs::create_dir(&out).unwrap();
    fs::write(out.join("world.toml"), "the world of the other run").unwrap();
    let folder = File::open(&out).unwrap();
    flock(&folder, FlockOperation::NonBlockingLockExclusive).unwrap();
    let ended = sandbox.output(["demo".as_ref(), "--out".as_ref(), out.as_os_str()]);
    ended.assert_code(1);
    assert!(ended.stderr.contains("another run of stillmap writes into this folder"), "{}", ended.stderr);
    let names: Vec<_> = fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(names, ["world.toml"]);
    assert_eq!(fs::read_to_string(out.join("world.toml")).unwrap(), "the world of the other run");
}

#[test]
fn commands_refuse_the_output_folder_of_another_run() {
    let sandbox = Sandbox::new();
    let deployment = Deployment::new("mapped", &["mapping"]).with_driver(["sleep", "1000"]).set("supervisor.startup_deadline_s", 600);
    let mut run = sandbox.run(&deployment, &[]);
    run.wait_for("mapping", "it runs", is_running);
    let world = sandbox.write("empty.toml", include_str!("../config/worlds/corridor.toml"));
    let out = sandbox.path("taken");
    fs::create_dir(&out).unwrap();
    let folder = File::open(&out).unwrap();
    flock(&folder, FlockOperation::NonBlockingLockExclusive).unwrap();
    for command in [&["map"][..], &["figures"], &["evaluate", "--world", world.to_str().unwrap()]] {
        let ended = sandbox.output(command.iter().copied().chain(["--out", out.to_str().unwrap()]));
        ended.assert_code(1);
        assert!(ended.stderr.contains("another run of stillmap writes into this folder"), "{command:?}: {}", ended.stderr);
    }
    assert_eq!(fs::read_dir(&out).unwrap().count(), 0);
    drop(folder);
    sandbox.output(["figures", "--out", out.to_str().unwrap()]).assert_code(0);
    signal(run.pid(), Signal::TERM);
    run.end();
}
