//! An output folder that another deployment uses: a second one changes nothing in it.

use std::fs::{self, File};

use rustix::fs::{FlockOperation, flock};

use crate::harness::Sandbox;

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
    assert!(ended.stderr.contains("another deployment writes its log and its map there"), "{}", ended.stderr);
    let names: Vec<_> = fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(names, ["world.toml"]);
    assert_eq!(fs::read_to_string(out.join("world.toml")).unwrap(), "the world of the other run");
}
