//! Runs in a hostile environment: closed standard error, folders in use or closed, long paths, repeated requests to stop.

use std::fs::OpenOptions;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use rustix::process::Signal;

use crate::harness::processes::signal;
use crate::harness::replay::DRIVE;
use crate::harness::{Ended, Sandbox, text};

#[test]
fn a_full_disk_behind_standard_error_changes_no_map() {
    let sandbox = Sandbox::new();
    let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
    let output = sandbox.command(&DRIVE.replay(&sandbox, "replay"), &[]).stderr(full).output().unwrap();
    let ended = Ended { code: output.status.code(), stdout: text(&output.stdout), stderr: String::new() };
    assert_eq!(ended.map(), DRIVE.map);
}

#[test]
fn a_reader_that_closes_standard_error_changes_no_map() {
    let sandbox = Sandbox::new();
    let mut run = sandbox.command(&DRIVE.replay(&sandbox, "replay"), &[]).spawn().unwrap();
    let mut lines = BufReader::new(run.stderr.take().unwrap()).lines();
    assert!(lines.any(|line| line.unwrap().contains("playback   is up")));
    drop(lines);
    let mut stdout = String::new();
    run.stdout.take().unwrap().read_to_string(&mut stdout).unwrap();
    let ended = Ended { code: run.wait().unwrap().code(), stdout, stderr: String::new() };
    assert_eq!(ended.map(), DRIVE.map);
}

#[test]
fn a_second_deployment_with_the_same_output_folder_is_refused() {
    let sandbox = Sandbox::new();
    let mut first = sandbox.run(&DRIVE.replay(&sandbox, "first"), &[]);
    first.wait_for_line("mapping    is up");
    let out = sandbox.path("first-out");
    let second = sandbox.run(&DRIVE.replay(&sandbox, "second").set("out", &out), &[]).end();
    second.assert_code(1);
    let expected = format!("{}: another run of stillmap writes into this folder", out.display());
    assert!(second.stderr.contains(&expected), "{}", second.stderr);
    assert!(!sandbox.runtime().join("second").exists(), "nothing is left of it");
    assert_eq!(first.end().map(), DRIVE.map);
}

#[test]
fn an_output_folder_that_takes_no_file_is_refused() {
    let sandbox = Sandbox::new();
    // Not even root may make a file there.
    let closed = Path::new("/proc/self/fdinfo");
    let log = DRIVE.log(&sandbox);
    let ended = sandbox.output(["replay", log.to_str().unwrap(), "--out", closed.to_str().unwrap()]);
    ended.assert_code(2);
    let said = ended.stderr;
    assert!(said.contains("/fdinfo: cannot write into this folder: ") && said.lines().count() == 1, "{said}");
}

#[test]
fn a_runtime_folder_longer_than_the_bus_allows_is_refused() {
    let sandbox = Sandbox::new();
    let run = |name: &str, length: usize| {
        // The limit is for the folder of the domain, which ends with the deployment's name.
        let folder = sandbox.path("");
        let folder = folder.join("r".repeat(length - name.len() - folder.as_os_str().len() - 1));
        let mut command = sandbox.command(&DRIVE.replay(&sandbox, name), &[]);
        command.env("STILLMAP_RUNTIME_DIR", folder);
        sandbox.start(command).end()
    };
    assert_eq!(run("longest", 44).map(), DRIVE.map);
    let refused = run("longest", 45);
    refused.assert_code(1);
    let said = refused.stderr;
    assert!(said.contains("is 45 bytes long, expected at most 44: set STILLMAP_RUNTIME_DIR to a shorter one"), "{said}");
}

#[test]
fn a_run_interrupted_twice_ends_in_order_with_its_map() {
    let sandbox = Sandbox::new();
    let live = DRIVE.replay(&sandbox, "live").set("pace", "live");
    let mut run = sandbox.run(&live, &["--speed", "2"]);
    run.wait_for("mapping", "it has received 20 scans", |it| it.received > 20);
    signal(run.pid(), Signal::INT);
    signal(run.pid(), Signal::INT);
    let ended = run.end();
    ended.map();
    assert!(!ended.stderr.contains("cannot wait"), "{}", ended.stderr);
    sandbox.assert_nothing_left();
}
