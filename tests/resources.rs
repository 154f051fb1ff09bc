//! Open files: too few are refused by number, and a process that gets no more says so.

use std::process::Command;

use messages::{SonarMotion, SonarScan};

use crate::harness::replay::DRIVE;
use crate::harness::{Deployment, Run, Sandbox, recorded};

/// A shell that runs the command under a limit as ulimit takes it.
fn limited(sandbox: &Sandbox, limit: &str, command: &Command) -> Command {
    let mut shell = sandbox.program("sh");
    shell.args(["-c", &format!("ulimit {limit}; exec \"$0\" \"$@\"")]).arg(command.get_program()).args(command.get_args());
    shell
}

fn run_limited(sandbox: &Sandbox, deployment: &Deployment, limit: &str) -> Run {
    sandbox.run_by(limited(sandbox, limit, &sandbox.command(deployment, &[])), deployment)
}

#[test]
fn a_run_with_too_few_open_files_is_refused_with_both_numbers() {
    let sandbox = Sandbox::new();
    for limit in [64, 200] {
        let ended = run_limited(&sandbox, &DRIVE.replay(&sandbox, "few"), &format!("-n {limit}")).end();
        ended.assert_code(1);
        assert!(ended.stderr.contains(&format!("a process may open {limit} files (ulimit -n), expected at least ")), "{}", ended.stderr);
    }
}

#[test]
fn a_low_limit_of_open_files_is_raised() {
    let sandbox = Sandbox::new();
    let ended = run_limited(&sandbox, &DRIVE.replay(&sandbox, "raised"), "-Sn 64").end();
    assert_eq!(ended.map(), DRIVE.map);
}

/// How many answers of STD a live replay records in which STD may open so many files; `None` if STD failed.
fn answers_recorded(sandbox: &Sandbox, limit: u32) -> Option<usize> {
    let std = limited(sandbox, &format!("-n {limit}"), &sandbox.stillmap(["process", "std"]));
    let words = std::iter::once(std.get_program()).chain(std.get_args());
    let words: Vec<String> = words.map(|word| word.to_str().unwrap().to_owned()).collect();
    let live = Deployment::new("starved", &["recorder", "playback"]).set("pace", "live").set("playback.log", DRIVE.log(sandbox));
    let starved = live.with_driver(words).set("supervisor.restarts", 0);
    let ended = sandbox.run(&starved, &["--speed", "100"]).end();
    if ended.code == Some(0) {
        return Some(recorded::<SonarMotion>(&sandbox.path("starved-out/drive.mcap")).len());
    }
    ended.assert_code(3);
    assert!(ended.stdout.contains("failed     driver: ended with exit code 1: "), "{}", ended.stdout);
    None
}

#[test]
fn a_process_without_a_free_descriptor_fails_or_loses_nothing() {
    let sandbox = Sandbox::new();
    let scans = recorded::<SonarScan>(&DRIVE.log(&sandbox)).len();
    let answers: Vec<Option<usize>> = (36..=96).step_by(6).map(|limit| answers_recorded(&sandbox, limit)).collect();
    assert!(answers.iter().flatten().all(|found| *found == scans), "{answers:?} answers to {scans} scans");
    assert!(answers.contains(&None) && answers.contains(&Some(scans)), "{answers:?}");
}
