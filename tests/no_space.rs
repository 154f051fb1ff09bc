//! Full memory and full disks: whole deployments in a mount namespace of their own, on file systems of a few megabytes.
//!
//! Only root may mount; for other users these tests say so and pass.

use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use messages::ProcessStatus;
use rustix::process::Signal;

use crate::harness::processes::{kill, signal};
use crate::harness::replay::DRIVE;
use crate::harness::{Deployment, Ended, Run, Sandbox};
use crate::resume::{robot_of_its_own, robot_port};

const SHARED_MEMORY: &str = "/dev/shm";

/// Whether mounts can be made; says so when not.
fn can_mount() -> bool {
    let tried = Command::new("unshare").args(["-m", "sh", "-c", "mount -t tmpfs -o size=1m none /mnt"]).stderr(Stdio::null()).status();
    let can = tried.is_ok_and(|status| status.success());
    if !can {
        eprintln!("skipped: only root may mount a small file system");
    }
    can
}

/// Runs a deployment with a file system of this size, as mount(8) takes it, in place of a folder. Its contents at the end are copied into
/// the folder beside it whose name ends with `.kept`, if there is one. When the test fails it kills the shell, and the run then ends, too.
fn run_on_a_small_disk(sandbox: &Sandbox, folder: &Path, size: &str, deployment: &Deployment, more: &[&str]) -> Run {
    let script = "folder=$1; shift; mount -t tmpfs -o size=$1,mode=700 none \"$folder\" || exit 99; shift
        setpriv --pdeathsig TERM -- \"$0\" \"$@\" & trap 'kill -TERM $!' TERM
        wait $!; code=$?; [ ! -d \"$folder.kept\" ] || cp -r \"$folder/.\" \"$folder.kept\"; exit $code";
    let command = sandbox.command(deployment, more);
    let mut small = sandbox.program("unshare");
    small.args(["-m", "sh", "-c", script]).arg(command.get_program()).arg(folder).arg(size).args(command.get_args());
    sandbox.run_by(small, deployment)
}

/// A folder as the run sees it.
fn within(run: &Run, folder: &Path) -> PathBuf {
    PathBuf::from(format!("/proc/{}/root{}", run.pid(), folder.display()))
}

/// A command that sees the file systems of the run.
fn beside(sandbox: &Sandbox, run: &Run, arguments: &[&str]) -> Ended {
    let command = sandbox.stillmap(arguments);
    let mut beside = sandbox.program("nsenter");
    beside.args(["-t", &run.pid().to_string(), "-m"]).arg(command.get_program()).args(command.get_args());
    sandbox.start(beside).end()
}

/// Takes all space that is left on a file system, until the file is removed.
fn fill(folder: &Path) -> PathBuf {
    let path = folder.join("fill");
    let mut file = File::create(&path).unwrap();
    while file.write_all(&[0; 4096]).is_ok() {}
    path
}

#[test]
fn a_run_waits_while_shared_memory_is_full() {
    if !can_mount() {
        return;
    }
    let sandbox = Sandbox::new();
    let memory = Path::new(SHARED_MEMORY);
    let mut run = run_on_a_small_disk(&sandbox, memory, "80m", &DRIVE.replay(&sandbox, "replay"), &[]);
    run.wait_for_line("playback   is up");
    let file = fill(&within(&run, memory));
    run.wait_for_line("/dev/shm is full: nothing is started until there is room");
    let status = beside(&sandbox, &run, &["status"]);
    status.assert_code(1);
    assert!(status.stderr.contains("/dev/shm has "), "{}", status.stderr);
    fs::remove_file(file).unwrap();
    run.wait_for_line("/dev/shm was full for");
    assert_eq!(run.end().map(), DRIVE.map);
}

#[test]
fn the_memory_fault_fills_and_frees_shared_memory() {
    if !can_mount() {
        return;
    }
    let sandbox = Sandbox::new();
    let mut run = run_on_a_small_disk(&sandbox, Path::new(SHARED_MEMORY), "80m", &DRIVE.replay(&sandbox, "replay"), &[]);
    run.wait_for_line("playback   is up");
    let injected = beside(&sandbox, &run, &["inject", "memory", "--for", "1"]);
    injected.assert_code(0);
    let lines: Vec<&str> = injected.stdout.lines().collect();
    assert!(
        matches!(lines.as_slice(), [taken, "the shared memory is released"] if taken.ends_with("bytes of shared memory for 1 s")),
        "{lines:?}"
    );
    run.wait_for_line("/dev/shm is full: nothing is started until there is room");
    run.wait_for_line("/dev/shm was full for");
    assert_eq!(run.end().map(), DRIVE.map);
}

#[test]
fn the_memory_fault_refuses_to_fill_more_than_a_gigabyte() {
    if !can_mount() {
        return;
    }
    let sandbox = Sandbox::new();
    let replay = DRIVE.replay(&sandbox, "replay").with("injector").fault(toml::toml! { kind = "memory" });
    let mut run = run_on_a_small_disk(&sandbox, Path::new(SHARED_MEMORY), "2g", &replay, &[]);
    run.wait_for_line("takes all free shared memory as configured, until the end");
    let said = run.wait_for_line("shared memory cannot be taken");
    assert!(said.contains("/dev/shm has ") && said.contains("expected at most 1073741824"), "{said}");
    let ended = run.end();
    assert_eq!((ended.map(), ended.restarted()), (DRIVE.map.clone(), None), "{}", ended.stderr);
}

#[test]
fn a_disk_that_takes_no_checkpoint_ends_no_process() {
    if !can_mount() {
        return;
    }
    let sandbox = Sandbox::new();
    let replay = DRIVE.replay(&sandbox, "replay").set("supervisor.restarts", 0);
    let state = sandbox.runtime().to_owned();
    let mut run = run_on_a_small_disk(&sandbox, &state, "4m", &replay, &[]);
    run.wait_for_line("playback   is up");
    fill(&within(&run, &state));
    let said = run.wait_for_line(".checkpoint: No space left on device");
    assert!(said.contains("from an older state"), "{said}");
    let ended = run.end();
    assert_eq!((ended.map(), ended.restarted()), (DRIVE.map.clone(), None), "{}", ended.stderr);
}

#[test]
fn a_driver_killed_on_a_full_disk_continues_its_numbers() {
    if !can_mount() {
        return;
    }
    let sandbox = Sandbox::new();
    let world = robot_of_its_own(&sandbox, "4");
    let robot = Deployment::new("robot", &["recorder", "mapping", "pioneer"]).set("pioneer.port", robot_port(&sandbox));
    let out = sandbox.path("robot-out");
    fs::create_dir(&out).unwrap();
    let mut run = run_on_a_small_disk(&sandbox, &out, "4m", &robot, &["--speed", "4"]);
    run.wait_for_line("pioneer    is up");
    let file = fill(&within(&run, &out));
    run.wait_for_line("the disk is full");
    // The recorder has given back some space.
    let more = within(&run, &out).join("more");
    fs::create_dir(&more).unwrap();
    let more = fill(&more);
    let has_no_room = |pioneer: &ProcessStatus| pioneer.note.as_str().contains("its state cannot be kept: No space");
    run.wait_for("pioneer", "it cannot save its state", has_no_room);
    // More than a driver that restarted its numbering would publish before it is noticed.
    let before = run.wait_for("mapping", "it receives", |it| it.received > 0).received;
    let at = run.wait_for("mapping", "40 more scans", |it| it.received >= before + 40).received;
    kill(run.wait_for("pioneer", "it still cannot save its state", has_no_room).pid);
    run.wait_for_line("pioneer    is up again");
    let mapping = run.wait_for("mapping", "10 more scans", |it| it.received >= at + 10);
    assert_eq!(mapping.refused, 0, "{mapping:?}");
    [file, more].iter().for_each(|file| fs::remove_file(file).unwrap());
    signal(run.pid(), Signal::TERM);
    let ended = run.end();
    assert_eq!(ended.restarted(), Some("pioneer once"), "{}", ended.stderr);
    let continued = ended.stderr.contains("resumed the running session");
    assert!(!ended.stderr.contains("has restarted its numbers") && continued, "{}", ended.stderr);
    drop(world);
}

/// A script that runs the command with this much shared memory, as mount(8) takes it, of which a file of that name takes some bytes.
fn run_beside_a_file(sandbox: &Sandbox, size: &str, file: &str, bytes: u64, deployment: &Deployment) -> Ended {
    let script = "mount -t tmpfs -o size=$1 none /dev/shm && head -c $3 /dev/zero > /dev/shm/$2 || exit 99; shift 3; exec \"$0\" \"$@\"";
    let command = sandbox.command(deployment, &[]);
    let mut small = sandbox.program("unshare");
    small.args(["-m", "sh", "-c", script]).arg(command.get_program()).args([size, file, &bytes.to_string()]).args(command.get_args());
    sandbox.run_by(small, deployment).end()
}

#[test]
fn too_little_shared_memory_is_refused_at_the_start() {
    if !can_mount() {
        return;
    }
    let sandbox = Sandbox::new();
    for size in ["1m", "4m"] {
        let ended = run_on_a_small_disk(&sandbox, Path::new(SHARED_MEMORY), size, &DRIVE.replay(&sandbox, "replay"), &[]).end();
        ended.assert_code(1);
        assert!(ended.stderr.contains("/dev/shm has ") && ended.stderr.contains(" bytes free, expected at least "), "{}", ended.stderr);
    }
}

#[test]
fn a_replay_runs_in_ten_megabytes_of_shared_memory() {
    if !can_mount() {
        return;
    }
    let sandbox = Sandbox::new();
    let ended = run_on_a_small_disk(&sandbox, Path::new(SHARED_MEMORY), "10m", &DRIVE.replay(&sandbox, "replay"), &[]).end();
    assert_eq!(ended.map(), DRIVE.map, "{}", ended.stderr);
    assert!(!ended.stderr.contains("/dev/shm is full"), "{}", ended.stderr);
}

#[test]
fn leftovers_are_removed_before_shared_memory_is_measured() {
    if !can_mount() {
        return;
    }
    let sandbox = Sandbox::new();
    let replay = DRIVE.replay(&sandbox, "replay");
    let folder = sandbox.runtime().join(replay.name());
    let prefix = format!("stillmap_{:08x}_", crc32fast::hash(folder.as_os_str().as_encoded_bytes()));
    let ended = run_beside_a_file(&sandbox, "10m", &format!("{prefix}left.data"), 8 << 20, &replay);
    assert_eq!(ended.map(), DRIVE.map, "{}", ended.stderr);
    let ended = run_beside_a_file(&sandbox, "10m", "another.data", 8 << 20, &replay);
    ended.assert_code(1);
    assert!(ended.stderr.contains(" bytes free, expected at least "), "{}", ended.stderr);
}

#[test]
fn recording_resumes_in_a_new_file_once_a_full_disk_has_space() {
    if !can_mount() {
        return;
    }
    let sandbox = Sandbox::new();
    let replay = DRIVE.replay(&sandbox, "replay").set("pace", "live").set("supervisor.restarts", 0);
    let (out, kept) = (sandbox.path("replay-out"), sandbox.path("replay-out.kept"));
    for folder in [&out, &kept] {
        fs::create_dir(folder).unwrap();
    }
    let mut run = run_on_a_small_disk(&sandbox, &out, "256k", &replay, &["--speed", "10"]);
    let said = run.wait_for_line("the disk is full");
    assert!(said.contains("drive.mcap") && said.contains("messages are not recorded until a write succeeds"), "{said}");
    let more = ["-t", &run.pid().to_string(), "-m", "mount", "-o", "remount,size=64m", out.to_str().unwrap()];
    assert!(Command::new("nsenter").args(more).status().unwrap().success());
    let said = run.wait_for_line("recording resumed in");
    assert!(said.contains("drive.2.mcap"), "{said}");
    let (before, _) = said.split_once(" messages were not recorded").unwrap();
    // Until it tries again it receives at least its own heartbeats.
    assert!(before.rsplit(' ').next().unwrap().parse::<u64>().unwrap() > 0, "{said}");
    let ended = run.end();
    ended.assert_code(3);
    assert!(ended.stdout.contains("log        INCOMPLETE: ") && ended.stdout.contains(" not recorded\n"), "{}", ended.stdout);
    assert_eq!(ended.restarted(), None);
    for (file, lacks) in [("drive.mcap", Some("missing   part 2 of the log")), ("drive.2.mcap", None)] {
        let single = sandbox.path(file);
        fs::copy(kept.join(file), &single).unwrap();
        let info = sandbox.output(["log", "info", single.to_str().unwrap()]);
        info.assert_code(if lacks.is_some() { 3 } else { 0 });
        assert!(info.stdout.contains("complete") && info.stdout.contains("robot/scan"), "{file}: {}", info.stdout);
        assert!(lacks.is_none_or(|lacks| info.stdout.contains(lacks)), "{file}: {}", info.stdout);
        fs::remove_file(single).unwrap();
    }
}

#[test]
fn a_disk_that_stays_full_makes_the_run_incomplete() {
    if !can_mount() {
        return;
    }
    let sandbox = Sandbox::new();
    let replay = DRIVE.replay(&sandbox, "replay").set("pace", "live").set("supervisor.restarts", 0);
    let (out, kept) = (sandbox.path("replay-out"), sandbox.path("replay-out.kept"));
    for folder in [&out, &kept] {
        fs::create_dir(folder).unwrap();
    }
    let mut run = run_on_a_small_disk(&sandbox, &out, "256k", &replay, &["--speed", "10"]);
    run.wait_for_line("the disk is full");
    let ended = run.end();
    ended.assert_code(3);
    assert!(ended.stdout.contains("log        INCOMPLETE: ") && ended.stdout.contains(" not recorded\n"), "{}", ended.stdout);
    assert!(ended.stderr.contains("the log is incomplete: ") && ended.stderr.contains(" messages were not recorded"), "{}", ended.stderr);
    let info = sandbox.output(["log", "info", kept.join("drive.mcap").to_str().unwrap()]);
    info.assert_code(3);
    assert!(info.stdout.contains("robot/scan"), "{}", info.stdout);
}
