//! What a machine does to a deployment: stops it, replaces its program, lacks a system call, limits its stack.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::time::Duration;

use rustix::process::Signal;
use seccompiler::{BpfProgram, SeccompAction, SeccompFilter};

use super::harness::replays::{DRIVE, Watched, children, pid_of, replay_settings, sha256_of};
use super::harness::{Bench, Run, kill, map_sha256, signal, text};

/// A process of a foreign program; `words` are its command.
fn foreign(name: &str, words: &[&str]) -> String {
    format!("[[process]]\nname = {name:?}\ncommand = {words:?}\n")
}

/// How long a process of this deployment may be silent.
const SILENCE_S: f64 = 0.5;

#[test]
fn a_deployment_that_was_frozen_blames_no_process() {
    let bench = Bench::new();
    let settings = replay_settings("frozen", &DRIVE.1, "").replace("\"lockstep\"", "\"live\"");
    let settings = settings.replace("heartbeat_timeout_s = 60.0", &format!("heartbeat_timeout_s = {SILENCE_S}"));
    let settings = bench.write("frozen.toml", &settings);
    let mut run = Watched::start(bench.stillmap(["run", settings.to_str().unwrap(), "--speed", "2"]));
    drop(run.wait_for_line("playback   is up"));
    let family: Vec<u64> = std::iter::once(run.pid().into()).chain(children(run.pid()).into_iter().map(|(_, pid)| pid)).collect();
    family.iter().for_each(|pid| signal(*pid, Signal::STOP));
    // That time passes is what is tested.
    std::thread::sleep(Duration::from_secs_f64(4.0 * SILENCE_S));
    family.iter().for_each(|pid| signal(*pid, Signal::CONT));
    drop(run.wait_for_line("no process is blamed for that time"));
    let (code, stdout, stderr) = run.end();
    assert_eq!(code, Some(0), "{stdout}{stderr}");
    assert!(!stderr.contains("gave no sign of life") && !stdout.contains("restarted"), "{stdout}{stderr}");
}

#[test]
fn processes_restart_as_they_were_when_the_program_is_replaced() {
    let bench = Bench::with_a_copy();
    let settings = bench.write("replaced.toml", &replay_settings("replaced", &DRIVE.1, ""));
    let mut run = Watched::start(bench.stillmap(["run", settings.to_str().unwrap()]));
    drop(run.wait_for_line("std        is up"));
    let program = bench.path("stillmap");
    fs::remove_file(&program).unwrap();
    fs::write(&program, "#!/bin/sh\nexit 2\n").unwrap();
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    kill(pid_of(&run, "std"));
    drop(run.wait_for_line("std        is up again"));
    assert_eq!(sha256_of(&run.end()), DRIVE.2);
}

/// Runs a command whose system calls of these numbers fail with this error.
fn without(calls: &[i64], errno: i32, bench: &Bench, arguments: &[&str]) -> Output {
    let rules: BTreeMap<i64, Vec<seccompiler::SeccompRule>> = calls.iter().map(|call| (*call, Vec::new())).collect();
    let refuse = SeccompAction::Errno(errno.unsigned_abs());
    let filter = SeccompFilter::new(rules, SeccompAction::Allow, refuse, std::env::consts::ARCH.try_into().unwrap()).unwrap();
    let program: BpfProgram = filter.try_into().unwrap();
    // A filter holds for a thread and its children.
    std::thread::scope(|scope| {
        let output = scope.spawn(|| {
            seccompiler::apply_filter(&program).unwrap();
            // Without the harness, which uses what is missing.
            bench.stillmap(arguments).output().unwrap()
        });
        output.join().unwrap()
    })
}

/// `pidfd_open` has this number on every architecture.
const PIDFD_OPEN: i64 = 434;

#[test]
fn a_kernel_without_process_descriptors_is_named() {
    let bench = Bench::new();
    for errno in [rustix::io::Errno::NOSYS, rustix::io::Errno::PERM] {
        let output = without(&[PIDFD_OPEN], errno.raw_os_error(), &bench, &["replay", DRIVE.1.to_str().unwrap()]);
        let said = refusal_after_notice(&output);
        assert!(said.contains("pidfd_open") && said.contains("Linux 5.4 or newer"), "{said}");
    }
    assert_eq!(bench.left_behind(), Vec::<PathBuf>::new());
}

/// The last line of a command that first says what it is going to do.
#[track_caller]
fn refusal_after_notice(output: &Output) -> String {
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    said.lines().last().unwrap_or_default().to_owned()
}

#[test]
fn a_small_stack_is_enough() {
    let bench = Bench::new();
    let settings = bench.write("small.toml", &replay_settings("small", &DRIVE.1, ""));
    let mut command = bench.stillmap_by("sh");
    let run = bench.stillmap(["run", settings.to_str().unwrap()]);
    command.args(["-c", "ulimit -s 256; exec \"$0\" \"$@\""]).arg(run.get_program()).args(run.get_args());
    assert_eq!(map_sha256(&Run::start(command).end()), DRIVE.2);
}

#[test]
fn a_second_deployment_leaves_the_first_ones_state() {
    let bench = Bench::new();
    let deployment = |name: &str| {
        let kinds = ["recorder", "mapping"].map(|kind| format!("[[process]]\nname = {kind:?}\nrun = {kind:?}\n")).concat();
        bench.write(&format!("{name}.toml"), &format!("name = {name:?}\nout = \"out\"\n{kinds}{}", foreign("robot", &["sleep", "1000"])))
    };
    let first = Run::start(bench.stillmap(["run", deployment("first").to_str().unwrap()]));
    bench.wait_for("mapping", "it runs", |it| it["state"] == "running");
    let kept = || names_in(&bench.path("out"));
    let before = kept();
    assert!(before.contains(&"state".to_owned()), "{before:?}");
    for arguments in [&["run"][..], &["run", "--fresh"]] {
        let second = bench.output(arguments.iter().copied().chain([deployment("second").to_str().unwrap()]));
        let said = text(&second.stderr);
        assert_eq!(second.status.code(), Some(1), "{said}");
        assert!(said.contains("another deployment writes its log and its map there"), "{said}");
        assert_eq!(kept(), before);
    }
    let again = bench.output(["run", deployment("first").to_str().unwrap()]);
    assert!(text(&again.stderr).contains("deployment first is already running (process "), "{}", text(&again.stderr));
    signal(first.pid().into(), Signal::TERM);
    map_sha256(&first.end());
}

fn names_in(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}
