//! Memory and disks that are full: whole deployments in a mount namespace of their own, on file systems of a few megabytes.
//!
//! Only root may mount; for anybody else these tests say so and do nothing.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod harness;

use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use harness::replays::{DRIVE, Watched, replay_settings, sha256_of};
use harness::{Bench, text};
use serde_json::Value;

/// Whether mounts can be made; says so when not.
fn can_mount() -> bool {
    let tried = Command::new("unshare").args(["-m", "sh", "-c", "mount -t tmpfs -o size=1m none /mnt"]).stderr(Stdio::null()).status();
    let can = tried.is_ok_and(|status| status.success());
    if !can {
        let _ = writeln!(std::io::stderr(), "skipped: only root may mount a small file system");
    }
    can
}

/// A run with a file system of this size, mount(8)'s way to say it, in place of a folder. What it holds at the end is copied into the folder
/// beside it whose name ends with `.kept`, if there is one. A test that fails kills the shell; the run then ends, too.
fn on_a_small_disk(bench: &Bench, folder: &Path, size: &str, arguments: &[&str]) -> Watched {
    let script = "folder=$1; shift; mount -t tmpfs -o size=$1,mode=700 none \"$folder\" || exit 99; shift
        setpriv --pdeathsig TERM -- \"$0\" \"$@\" & trap 'kill -TERM $!' TERM
        wait $!; code=$?; [ ! -d \"$folder.kept\" ] || cp -r \"$folder/.\" \"$folder.kept\"; exit $code";
    let command = bench.stillmap(arguments);
    let mut small = bench.stillmap_by("unshare");
    small.args(["-m", "sh", "-c", script]).arg(command.get_program()).arg(folder).arg(size).args(command.get_args());
    Watched::start(small)
}

/// Settings by which whoever ends too early fails for good.
fn without_restarts(settings: &str) -> String {
    let (before, after) = settings.split_once("restarts = 1000").unwrap();
    format!("{before}restarts = 0{after}")
}

/// A folder as the run sees it.
fn within(run: &Watched, folder: &Path) -> PathBuf {
    PathBuf::from(format!("/proc/{}/root{}", run.pid(), folder.display()))
}

/// What a command says that sees the file systems of the run.
fn beside(bench: &Bench, run: &Watched, arguments: &[&str]) -> Output {
    let command = bench.stillmap(arguments);
    let mut beside = bench.stillmap_by("nsenter");
    beside.args(["-t", &run.pid().to_string(), "-m"]).arg(command.get_program()).args(command.get_args());
    beside.output().unwrap()
}

/// Takes everything that is left on a file system; freed when the file is removed.
fn fill(folder: &Path) -> PathBuf {
    let path = folder.join("ballast");
    let mut ballast = File::create(&path).unwrap();
    while ballast.write_all(&[0; 4096]).is_ok() {}
    path
}

#[test]
fn shared_memory_that_is_used_up_is_sat_out_and_the_map_does_not_notice() {
    if !can_mount() {
        return;
    }
    let (_, log, undisturbed) = &*DRIVE;
    let bench = Bench::new();
    let settings = bench.write("replay.toml", &replay_settings("replay", log, ""));
    let memory = Path::new("/dev/shm");
    let mut run = on_a_small_disk(&bench, memory, "80m", &["run", settings.to_str().unwrap()]);
    drop(run.wait_for_line("playback   is up"));
    let ballast = fill(&within(&run, memory));
    drop(run.wait_for_line("/dev/shm is full: nothing is started until there is room"));
    let look = beside(&bench, &run, &["status"]);
    assert!(text(&look.stderr).contains("/dev/shm has ") && look.status.code().is_some(), "{look:?}");
    fs::remove_file(ballast).unwrap();
    drop(run.wait_for_line("/dev/shm was full for"));
    let ended = run.end();
    assert_eq!(&sha256_of(&ended), undisturbed, "{}", ended.2);
}

#[test]
fn the_fault_that_takes_shared_memory_gives_it_back() {
    if !can_mount() {
        return;
    }
    let (_, log, undisturbed) = &*DRIVE;
    let bench = Bench::new();
    let settings = bench.write("replay.toml", &replay_settings("replay", log, ""));
    let mut run = on_a_small_disk(&bench, Path::new("/dev/shm"), "80m", &["run", settings.to_str().unwrap()]);
    drop(run.wait_for_line("playback   is up"));
    let injected = beside(&bench, &run, &["inject", "memory", "--for", "1"]);
    assert_eq!(injected.status.code(), Some(0), "{injected:?}");
    let told = text(&injected.stdout);
    let told: Vec<&str> = told.lines().collect();
    assert!(
        matches!(told.as_slice(), [taken, "the shared memory is released"] if taken.ends_with("bytes of shared memory for 1 s")),
        "{told:?}"
    );
    drop(run.wait_for_line("/dev/shm is full: nothing is started until there is room"));
    drop(run.wait_for_line("/dev/shm was full for"));
    let ended = run.end();
    assert_eq!(&sha256_of(&ended), undisturbed, "{}", ended.2);
}

#[test]
fn shared_memory_as_large_as_the_computers_is_not_taken() {
    if !can_mount() {
        return;
    }
    let bench = Bench::new();
    let more = "[[process]]\nname = \"injector\"\nrun = \"injector\"\n[[fault]]\nkind = \"memory\"\n";
    let settings = bench.write("replay.toml", &replay_settings("replay", &DRIVE.1, more));
    let mut run = on_a_small_disk(&bench, Path::new("/dev/shm"), "2g", &["run", settings.to_str().unwrap()]);
    drop(run.wait_for_line("takes all free shared memory as configured, until the end"));
    let said = run.wait_for_line("shared memory cannot be taken");
    assert!(said.contains("/dev/shm has ") && said.contains("expected at most 1073741824"), "{said}");
    let ended = run.end();
    assert_eq!(sha256_of(&ended), DRIVE.2, "{}", ended.2);
    assert!(!ended.1.contains("restarted"), "{}", ended.1);
}

#[test]
fn a_disk_that_takes_no_checkpoint_ends_nobody() {
    if !can_mount() {
        return;
    }
    let (_, log, undisturbed) = &*DRIVE;
    let bench = Bench::new();
    let settings = bench.write("replay.toml", &without_restarts(&replay_settings("replay", log, "")));
    let state = bench.runtime().to_owned();
    let mut run = on_a_small_disk(&bench, &state, "4m", &["run", settings.to_str().unwrap()]);
    drop(run.wait_for_line("playback   is up"));
    drop(fill(&within(&run, &state)));
    let said = run.wait_for_line("goes on from an older state");
    assert!(said.contains(".checkpoint: No space left on device"), "{said}");
    let ended = run.end();
    assert_eq!(&sha256_of(&ended), undisturbed, "{}", ended.2);
    assert!(!ended.1.contains("restarted"), "{}", ended.1);
}

/// A robot with a line of its own: the simulator's, in another deployment.
fn robot(bench: &Bench) -> (Watched, PathBuf) {
    let world = concat!(env!("CARGO_MANIFEST_DIR"), "/config/worlds/corridor-empty.toml");
    // A deployment needs somebody who could have scans to say.
    let settings = format!(
        "name = \"world\"\nout = \"world-out\"\n[[process]]\nname = \"simulator\"\nrun = \"simulator\"\n\
         [[process]]\nname = \"nobody\"\ncommand = [\"sleep\", \"600\"]\n\
         [supervisor]\nstartup_deadline_s = 600\n[simulator]\nworld = {world:?}\n"
    );
    let settings = bench.write("world.toml", &settings);
    let mut run = Watched::start(bench.stillmap(["run", settings.to_str().unwrap(), "--speed", "4"]));
    drop(run.wait_for_line("simulator  is up"));
    let processes = ["recorder", "mapping", "pioneer"].map(|kind| format!("[[process]]\nname = {kind:?}\nrun = {kind:?}\n")).concat();
    let port = bench.runtime().join("world/robot");
    let settings = format!("name = \"robot\"\nout = \"robot-out\"\n{processes}[pioneer]\nport = {port:?}\n");
    (run, bench.write("robot.toml", &settings))
}

/// What `stillmap status` tells of a process of the robot's deployment, which sees other file systems than the test.
fn told(bench: &Bench, run: &Watched, process: &str) -> Value {
    let all: Value = serde_json::from_slice(&beside(bench, run, &["status", "--deployment", "robot", "--json"]).stdout).unwrap_or_default();
    let processes = all[0]["processes"].as_array().cloned().unwrap_or_default();
    processes.into_iter().find(|it| it["process"] == process).unwrap_or_default()
}

#[test]
fn a_driver_that_dies_while_the_disk_is_full_goes_on_with_its_numbers() {
    if !can_mount() {
        return;
    }
    let bench = Bench::new();
    let (world, settings) = robot(&bench);
    let out = bench.path("robot-out");
    fs::create_dir(&out).unwrap();
    let mut run = on_a_small_disk(&bench, &out, "4m", &["run", settings.to_str().unwrap(), "--speed", "4"]);
    drop(run.wait_for_line("pioneer    is up"));
    let ballast = fill(&within(&run, &out));
    drop(run.wait_for_line("the disk is full"));
    // What the recorder has given back is taken, too.
    let more = within(&run, &out).join("more");
    fs::create_dir(&more).unwrap();
    let more = fill(&more);
    let has_no_room = |pioneer: &Value| pioneer["note"].as_str().is_some_and(|note| note.contains("its state cannot be kept: No space"));
    while !has_no_room(&told(&bench, &run, "pioneer")) {}
    let received = || told(&bench, &run, "mapping")["received"].as_u64();
    // More than come while a driver that begins anew is not yet heard.
    let before = received();
    while received() < before.map(|count| count + 40) {}
    let at = received();
    let pioneer = told(&bench, &run, "pioneer");
    assert!(has_no_room(&pioneer), "{pioneer}");
    harness::kill(pioneer["pid"].as_u64().unwrap());
    drop(run.wait_for_line("pioneer    is up again"));
    while told(&bench, &run, "mapping")["received"].as_u64() < at.map(|count| count + 10) {
        let mapping = told(&bench, &run, "mapping");
        assert_eq!(mapping["refused"], 0, "{mapping}");
    }
    [ballast, more].iter().for_each(|file| fs::remove_file(file).unwrap());
    harness::signal(run.pid().into(), rustix::process::Signal::TERM);
    drop(world);
    let (_, stdout, stderr) = run.end();
    assert!(stdout.contains("restarted  pioneer once"), "{stdout}{stderr}");
    assert!(!stderr.contains("has begun anew") && stderr.contains("took up the running session"), "{stderr}");
}

#[test]
fn without_enough_shared_memory_nothing_starts() {
    if !can_mount() {
        return;
    }
    let bench = Bench::new();
    let settings = bench.write("replay.toml", &replay_settings("replay", &DRIVE.1, ""));
    let run = on_a_small_disk(&bench, Path::new("/dev/shm"), "16m", &["run", settings.to_str().unwrap()]);
    let (code, _, said) = run.end();
    assert_ne!(code, Some(0));
    assert!(said.contains("/dev/shm has 16777216 bytes free, expected at least 67108864"), "{said}");
}

#[test]
fn a_disk_that_is_full_stops_the_recording_and_space_brings_it_back_in_a_new_file() {
    if !can_mount() {
        return;
    }
    let (_, log, _) = &*DRIVE;
    let bench = Bench::new();
    let settings = bench.write("replay.toml", &without_restarts(&replay_settings("replay", log, "")).replace("\"lockstep\"", "\"live\""));
    let out = bench.path("replay-out");
    let kept = bench.path("replay-out.kept");
    for folder in [&out, &kept] {
        fs::create_dir(folder).unwrap();
    }
    let mut run = on_a_small_disk(&bench, &out, "256k", &["run", settings.to_str().unwrap(), "--speed", "10"]);
    let said = run.wait_for_line("the disk is full");
    assert!(said.contains("drive.mcap") && said.contains("messages are not recorded until a write succeeds"), "{said}");
    let more = ["-t", &run.pid().to_string(), "-m", "mount", "-o", "remount,size=64m", out.to_str().unwrap()];
    assert!(Command::new("nsenter").args(more).status().unwrap().success());
    let said = run.wait_for_line("recording resumed in");
    assert!(said.contains("drive.2.mcap"), "{said}");
    let (before, _) = said.split_once(" messages were not recorded").unwrap();
    // Until it tries again it hears at least itself.
    assert!(before.rsplit(' ').next().unwrap().parse::<u64>().unwrap() > 0, "{said}");
    let (code, stdout, stderr) = run.end();
    assert_eq!(code, Some(0), "{stdout}{stderr}");
    assert!(!stdout.contains("restarted") && stdout.contains("map sha256"), "{stdout}");
    for file in ["drive.mcap", "drive.2.mcap"] {
        let alone = bench.path("alone.mcap");
        fs::copy(kept.join(file), &alone).unwrap();
        let info = bench.output(["log", "info", alone.to_str().unwrap()]);
        let (code, told) = (info.status.code(), text(&info.stdout));
        assert!(code == Some(0) && told.contains("complete") && told.contains("robot/scan"), "{file}: {told}{}", text(&info.stderr));
    }
}
