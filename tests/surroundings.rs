//! What surrounds a run is not as it should be: nobody reads what it says, folders are taken or closed, somebody is impatient.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod harness;

use std::fs::OpenOptions;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::Command;

use harness::replays::{DRIVE, Watched, replay_settings, sha256_of};
use harness::{Bench, Run, map_sha256, signal, text};
use rustix::process::Signal;

/// A replay in lockstep of the recorded drive.
fn replay(bench: &Bench, name: &str) -> Command {
    let settings = bench.write(&format!("{name}.toml"), &replay_settings(name, &DRIVE.1, ""));
    bench.stillmap(["run", settings.to_str().unwrap()])
}

#[test]
fn standard_error_on_a_full_disk_costs_words_and_nothing_else() {
    let bench = Bench::new();
    let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
    let mut command = replay(&bench, "unheard");
    command.stderr(full);
    let output = command.output().unwrap();
    assert_eq!(map_sha256(&output), DRIVE.2);
}

#[test]
fn whoever_reads_standard_error_may_leave() {
    let bench = Bench::new();
    let mut run = replay(&bench, "unheard").spawn().unwrap();
    let mut said = BufReader::new(run.stderr.take().unwrap()).lines();
    assert!(said.any(|line| line.unwrap().contains("playback   is up")));
    drop(said);
    let mut stdout = String::new();
    run.stdout.take().unwrap().read_to_string(&mut stdout).unwrap();
    let code = run.wait().unwrap().code();
    assert_eq!(sha256_of(&(code, stdout, String::new())), DRIVE.2);
}

#[test]
fn an_output_folder_has_one_deployment_at_a_time() {
    let bench = Bench::new();
    let mut first = Watched::start(replay(&bench, "first"));
    drop(first.wait_for_line("mapping    is up"));
    let out = bench.path("first-out");
    let settings = bench.write("second.toml", &replay_settings("second", &DRIVE.1, "").replace("second-out", "first-out"));
    let second = bench.output(["run", settings.to_str().unwrap()]);
    assert_eq!(second.status.code(), Some(1));
    let said = text(&second.stderr);
    assert!(said.contains(&format!("{}: another deployment writes its log and its map there", out.display())), "{said}");
    assert!(!bench.runtime().join("second").exists(), "nothing is left of it");
    assert_eq!(sha256_of(&first.end()), DRIVE.2);
}

#[test]
fn an_output_folder_that_takes_no_file_is_refused_before_anything_starts() {
    let bench = Bench::new();
    // Not even root may make a file there.
    let closed = Path::new("/proc/self/fdinfo");
    let log = DRIVE.1.to_str().unwrap();
    let output = bench.output(["replay", log, "--out", closed.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(2));
    let said = text(&output.stderr);
    assert!(said.contains("/fdinfo: cannot write into this folder: ") && said.lines().count() == 1, "{said}");
}

#[test]
fn a_runtime_folder_is_as_long_as_the_bus_can_bear_or_refused() {
    let bench = Bench::new();
    let run = |name: &str, length: usize| {
        // What is too long is the folder and the name together.
        let folder = bench.runtime().join("r".repeat(length - name.len() - bench.runtime().as_os_str().len() - 2));
        replay(&bench, name).env("STILLMAP_RUNTIME_DIR", folder).output().unwrap()
    };
    assert_eq!(map_sha256(&run("longest", 48)), DRIVE.2);
    let refused = run("longest", 49);
    assert_eq!(refused.status.code(), Some(1));
    let said = text(&refused.stderr);
    assert!(said.contains("is 49 bytes long, expected at most 48: set STILLMAP_RUNTIME_DIR to a shorter one"), "{said}");
}

#[test]
fn who_asks_twice_for_the_end_gets_it_in_order() {
    let bench = Bench::new();
    let settings = replay_settings("live", &DRIVE.1, "").replace("\"lockstep\"", "\"live\"");
    let settings = bench.write("live.toml", &settings);
    let run = Run::start(bench.stillmap(["run", settings.to_str().unwrap(), "--speed", "2"]));
    bench.wait_for("mapping", "it maps", |it| it["received"].as_u64() > Some(20));
    signal(run.pid().into(), Signal::INT);
    signal(run.pid().into(), Signal::INT);
    let output = run.end();
    map_sha256(&output);
    assert!(!text(&output.stderr).contains("cannot wait"), "{}", text(&output.stderr));
    assert_eq!(bench.left_behind(), Vec::<PathBuf>::new());
}
