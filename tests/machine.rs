//! What a machine does to a deployment: stops it, replaces its program, lacks a system call, limits its stack.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Output;

use rustix::event::{Timespec, poll};
use rustix::process::Signal;
use seccompiler::{BpfProgram, SeccompAction, SeccompFilter};

use crate::harness::observer::Observer;
use crate::harness::processes::{built_in_children, kill, resume, signal, stop};
use crate::harness::replay::DRIVE;
use crate::harness::{Deployment, Sandbox, WATCHDOG, is_running, text};

/// How long a process of this deployment may be silent: longer than a busy machine keeps it from its work.
const SILENCE_S: i64 = 4;

#[test]
fn a_deployment_that_was_stopped_blames_no_process() {
    let sandbox = Sandbox::new();
    let live = DRIVE.replay(&sandbox, "frozen").set("pace", "live").set("supervisor.heartbeat_timeout_s", SILENCE_S);
    let mut run = sandbox.run(&live, &["--speed", "2"]);
    run.wait_for_line("playback   is up");
    let mut observer = Observer::join(sandbox.runtime(), Some("frozen")).unwrap();
    let mut look = |after_ms: u64| loop {
        if let Some(status) = observer.take(WATCHDOG).into_iter().find(|status| status.uptime_ms >= after_ms) {
            return status;
        }
    };
    let uptime_ms = look(0).uptime_ms;
    let processes: Vec<u32> = built_in_children(run.pid()).into_values().collect();
    std::iter::once(run.pid()).chain(processes.iter().copied()).for_each(stop);
    // The passing of time is what is tested.
    let silence = Timespec { tv_sec: SILENCE_S + 1, tv_nsec: 0 };
    poll(&mut [], Some(&silence)).unwrap();
    // The supervisor judges before any process can give a sign of life.
    resume(run.pid());
    let judged = look(uptime_ms + 1000 * SILENCE_S as u64);
    processes.iter().for_each(|pid| resume(*pid));
    assert!(judged.processes().iter().all(|it| it.restarts == 0 && it.pid != 0), "{judged:?}");
    run.wait_for_line("no process is blamed for that time");
    let ended = run.end();
    ended.assert_code(0);
    assert!(!ended.stderr.contains("gave no sign of life") && ended.restarted().is_none(), "{}{}", ended.stdout, ended.stderr);
}

#[test]
fn processes_restart_as_they_were_when_the_program_is_replaced() {
    let sandbox = Sandbox::with_a_copy();
    let mut run = sandbox.run(&DRIVE.replay(&sandbox, "replaced"), &[]);
    run.wait_for_line("std        is up");
    let program = sandbox.path("stillmap");
    fs::remove_file(&program).unwrap();
    fs::write(&program, "#!/bin/sh\nexit 2\n").unwrap();
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    kill(run.pid_of("std"));
    run.wait_for_line("std        is up again");
    assert_eq!(run.end().map(), DRIVE.map);
}

/// Runs a command whose system calls of these numbers fail with this error.
fn without(calls: &[i64], errno: i32, sandbox: &Sandbox, arguments: &[&str]) -> Output {
    let rules: BTreeMap<i64, Vec<seccompiler::SeccompRule>> = calls.iter().map(|call| (*call, Vec::new())).collect();
    let refuse = SeccompAction::Errno(errno.unsigned_abs());
    let filter = SeccompFilter::new(rules, SeccompAction::Allow, refuse, std::env::consts::ARCH.try_into().unwrap()).unwrap();
    let program: BpfProgram = filter.try_into().unwrap();
    // A filter holds for a thread and its children.
    std::thread::scope(|scope| {
        let output = scope.spawn(|| {
            seccompiler::apply_filter(&program).unwrap();
            // Without the harness, which uses the missing call.
            sandbox.stillmap(arguments).output().unwrap()
        });
        output.join().unwrap()
    })
}

/// `pidfd_open` has this number on every architecture.
const PIDFD_OPEN: i64 = 434;

#[test]
fn a_kernel_without_process_descriptors_is_named() {
    let sandbox = Sandbox::new();
    let log = DRIVE.log(&sandbox);
    for errno in [rustix::io::Errno::NOSYS, rustix::io::Errno::PERM] {
        let output = without(&[PIDFD_OPEN], errno.raw_os_error(), &sandbox, &["replay", log.to_str().unwrap()]);
        let said = last_error_line(&output);
        assert!(said.contains("pidfd_open") && said.contains("Linux 5.4 or newer"), "{said}");
    }
    sandbox.assert_nothing_left();
}

/// The number of `flock`.
const FLOCK: i64 = if cfg!(target_arch = "x86_64") { 73 } else { 32 };

#[test]
fn a_file_system_without_locks_is_named() {
    let sandbox = Sandbox::new();
    let log = DRIVE.log(&sandbox);
    let unsupported = rustix::io::Errno::OPNOTSUPP.raw_os_error();
    let said = last_error_line(&without(&[FLOCK], unsupported, &sandbox, &["replay", log.to_str().unwrap()]));
    assert!(said.contains("cannot be locked: ") && said.ends_with("to a folder of a file system with locks"), "{said}");
    // The file that could not be locked may be another's.
    let left: Vec<_> = fs::read_dir(sandbox.runtime()).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert!(left.iter().all(|file| file.extension().is_some_and(|extension| extension == "lock")), "{left:?}");
    left.iter().for_each(|file| fs::remove_file(file).unwrap());
}

/// The last line of a command that fails after it has announced what it does.
#[track_caller]
fn last_error_line(output: &Output) -> String {
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    said.lines().last().unwrap_or_default().to_owned()
}

#[test]
fn a_stack_of_256_kilobytes_is_enough() {
    let sandbox = Sandbox::new();
    let small = DRIVE.replay(&sandbox, "small");
    let mut command = sandbox.program("sh");
    let run = sandbox.command(&small, &[]);
    command.args(["-c", "ulimit -s 256; exec \"$0\" \"$@\""]).arg(run.get_program()).args(run.get_args());
    assert_eq!(sandbox.run_by(command, &small).end().map(), DRIVE.map);
}

#[test]
fn a_second_deployment_leaves_the_state_of_the_first() {
    let sandbox = Sandbox::new();
    let deployment = |name: &str| {
        let robot = Deployment::new(name, &["recorder", "mapping"]).with_driver(["sleep", "1000"]);
        robot.set("out", "out").set("supervisor.startup_deadline_s", 600)
    };
    let mut first = sandbox.run(&deployment("first"), &[]);
    first.wait_for("mapping", "it runs", is_running);
    let outputs = || names_in(&sandbox.path("out"));
    let before = outputs();
    assert!(before.contains(&"state".to_owned()), "{before:?}");
    for arguments in [&[][..], &["--fresh"]] {
        let second = sandbox.run(&deployment("second"), arguments).end();
        second.assert_code(1);
        assert!(second.stderr.contains("another run of stillmap writes into this folder"), "{}", second.stderr);
        assert_eq!(outputs(), before);
    }
    let again = sandbox.run(&deployment("first"), &[]).end();
    assert!(again.stderr.contains("deployment first is already running (process "), "{}", again.stderr);
    signal(first.pid(), Signal::TERM);
    assert!(first.end().stdout.contains("map sha256 "));
}

fn names_in(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}
