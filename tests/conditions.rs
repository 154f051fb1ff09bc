//! Random deployments under random conditions: terminals that close, files that are removed, freezes, kills, full disks, lost logs, slow
//! processors. Each ends with the map of its log's replay, or with an exit code and a line that say what is missing.
//!
//! `STILLMAP_CONDITIONS` (default 3) deployments are run; `STILLMAP_CONDITIONS_SEED` chooses conditions and times. The long run:
//!
//!     STILLMAP_CONDITIONS=100 cargo test --release -p stillmap --test stillmap conditions -- --ignored --nocapture

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustix::fs::OFlags;
use rustix::process::{Pid, Signal, kill_process};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

use crate::harness::processes::{built_in_children, children};
use crate::harness::replay::DRIVE;
use crate::harness::{Deployment, Sandbox, WATCHDOG, worlds};

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Condition {
    TerminalCloses,
    SharedMemoryRemoved,
    RuntimeFolderRemoved,
    Frozen,
    ProcessKilled,
    DiskFull,
    LogRemoved,
    LogTruncated,
    SlowProcessor,
}

const CONDITIONS: [Condition; 9] = [
    Condition::TerminalCloses,
    Condition::SharedMemoryRemoved,
    Condition::RuntimeFolderRemoved,
    Condition::Frozen,
    Condition::ProcessKilled,
    Condition::DiskFull,
    Condition::LogRemoved,
    Condition::LogTruncated,
    Condition::SlowProcessor,
];

/// In about this time a deployment runs from its first process to the end of its drive, ms.
const LENGTH_MS: u64 = 12_000;

/// What one deployment goes through.
#[derive(Debug)]
struct Course {
    /// It replays a log at the pace of the drive, or else drives a simulated robot.
    replays: bool,
    /// Conditions, and when they begin, ms after the start.
    conditions: Vec<(u64, Condition)>,
    /// Size of a small disk, kB, and when it becomes larger.
    disk: (u64, Option<u64>),
}

impl Course {
    fn random(random: &mut ChaCha8Rng, can_mount: bool) -> Self {
        let possible: Vec<Condition> = CONDITIONS.into_iter().filter(|it| can_mount || *it != Condition::DiskFull).collect();
        let count = random.random_range(1..=3);
        let mut conditions: Vec<(u64, Condition)> = possible.sample(random, count).map(|condition| (0, *condition)).collect();
        conditions.iter_mut().for_each(|(at, _)| *at = random.random_range(300..LENGTH_MS));
        conditions.sort_unstable();
        let grows = random.random_bool(0.5);
        let disk = (random.random_range(100..2000), grows.then(|| random.random_range(LENGTH_MS / 2..LENGTH_MS)));
        Self { replays: random.random_bool(0.5), conditions, disk }
    }

    fn has(&self, wanted: Condition) -> bool {
        self.conditions.iter().any(|(_, condition)| *condition == wanted)
    }
}

/// A terminal; what is written to it is not read, and it holds it all.
struct Terminal {
    _user: File,
    programs: File,
}

impl Terminal {
    fn open() -> Self {
        let user = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&user).unwrap();
        unlockpt(&user).unwrap();
        let name = PathBuf::from(ptsname(&user, Vec::new()).unwrap().into_string().unwrap());
        let programs = OpenOptions::new().read(true).write(true).custom_flags(OFlags::NOCTTY.bits() as i32).open(name).unwrap();
        Self { _user: user.into(), programs }
    }
}

/// A deployment that runs.
struct Running<'a> {
    sandbox: &'a Sandbox,
    child: Child,
    began: Instant,
    terminal: Option<Terminal>,
    /// Where log and map are at the end.
    out: PathBuf,
    /// Where they are while it runs.
    out_now: PathBuf,
    /// On a disk of its own.
    is_mounted: bool,
}

/// Runs the command on a file system of `$1` kB in place of the folder `$2`, and keeps its contents in `$2.kept`.
const ON_A_SMALL_DISK: &str = "mount -t tmpfs -o size=$1k,mode=700 none \"$2\" || exit 99; out=$2; shift 2
    \"$0\" \"$@\" & trap 'kill -HUP $!' HUP; wait $!; code=$?
    while kill -0 $! 2>/dev/null; do wait $!; code=$?; done; cp -r \"$out/.\" \"$out.kept\"; exit $code";

impl<'a> Running<'a> {
    fn start(sandbox: &'a Sandbox, course: &Course) -> Self {
        let deployment = if course.replays {
            DRIVE.replay(sandbox, "course").set("pace", "live").set("fti.patience_s", 10)
        } else {
            Deployment::sonar_only(worlds::path("corridor")).set("name", "course").set("out", "course-out")
        };
        let command = sandbox.command(&deployment, &["--speed", "4"]);
        let out = sandbox.path("course-out");
        let is_mounted = course.has(Condition::DiskFull);
        let mut arguments = vec![];
        if is_mounted {
            fs::create_dir(&out).unwrap();
            fs::create_dir(sandbox.path("course-out.kept")).unwrap();
            arguments.extend(["unshare", "-m", "sh", "-c", ON_A_SMALL_DISK].map(Into::into));
            arguments.extend([command.get_program().to_owned(), course.disk.0.to_string().into(), out.clone().into()]);
        } else {
            arguments.push(command.get_program().to_owned());
        }
        arguments.extend(command.get_args().map(ToOwned::to_owned));
        let terminal = course.has(Condition::TerminalCloses).then(Terminal::open);
        let mut command = match &terminal {
            // Signals of the terminal reach the run.
            Some(_) => sandbox.program("setsid"),
            None => sandbox.program("env"),
        };
        if let Some(terminal) = &terminal {
            let side = || terminal.programs.try_clone().unwrap();
            command.arg("--ctty").stdin(side()).stdout(side()).stderr(side()).env("TERM", "xterm");
        } else {
            let file = |name| Stdio::from(File::create(sandbox.path(name)).unwrap());
            command.stdout(file("stdout")).stderr(file("stderr"));
        }
        let child = command.args(arguments).spawn().unwrap();
        let copied = if is_mounted { sandbox.path("course-out.kept") } else { out.clone() };
        let out_now = if is_mounted { PathBuf::from(format!("/proc/{}/root{}", child.id(), out.display())) } else { out };
        Self { sandbox, child, began: Instant::now(), terminal, out: copied, out_now, is_mounted }
    }

    /// Waits for a time after the start; false if the run has ended before.
    fn wait_until(&mut self, at_ms: u64) -> bool {
        let at = self.began + Duration::from_millis(at_ms);
        while self.child.try_wait().unwrap().is_none() {
            if Instant::now() >= at {
                return true;
            }
            pause_ms(5);
        }
        false
    }

    fn end(&mut self) -> ExitStatus {
        let since = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status;
            }
            assert!(since.elapsed() < WATCHDOG, "it does not end:\n{}", self.said());
            pause_ms(5);
        }
    }

    fn supervisor(&self) -> Option<u32> {
        if self.is_mounted { children(self.child.id()).first().copied() } else { Some(self.child.id()) }
    }

    /// The supervisor and its children, guard included.
    fn tree(&self) -> Vec<u32> {
        self.supervisor().into_iter().flat_map(|pid| std::iter::once(pid).chain(children(pid))).collect()
    }

    fn said(&self) -> String {
        ["stderr", "stdout"].map(|name| fs::read_to_string(self.sandbox.path(name)).unwrap_or_default()).concat()
    }

    fn undergo(&mut self, condition: Condition, random: &mut ChaCha8Rng) {
        match condition {
            Condition::TerminalCloses => self.terminal = None,
            Condition::SharedMemoryRemoved => remove_all(&self.sandbox.shared_memory()),
            Condition::RuntimeFolderRemoved => {
                let entries = fs::read_dir(self.sandbox.runtime()).unwrap();
                remove_all(&entries.map(|entry| entry.unwrap().path()).collect::<Vec<_>>());
            }
            Condition::Frozen => {
                let tree = self.tree();
                signal_all(&tree, Signal::STOP);
                pause_ms(random.random_range(500..4000));
                signal_all(&tree, Signal::CONT);
            }
            Condition::ProcessKilled => {
                let built_in = self.supervisor().map(built_in_children).unwrap_or_default();
                let pids: Vec<u32> = built_in.into_values().collect();
                signal_all(pids.choose(random).map(std::slice::from_ref).unwrap_or_default(), Signal::KILL);
            }
            Condition::LogRemoved => drop(fs::remove_file(self.out_now.join("drive.mcap"))),
            Condition::LogTruncated => {
                drop(OpenOptions::new().write(true).truncate(true).open(self.out_now.join("drive.mcap")));
            }
            // A twentieth of each second for two seconds, and half of the time afterwards.
            Condition::SlowProcessor => {
                for round in 0..40 {
                    let tree = self.tree();
                    signal_all(&tree, Signal::STOP);
                    pause_ms(if round < 20 { 95 } else { 50 });
                    signal_all(&tree, Signal::CONT);
                    pause_ms(if round < 20 { 5 } else { 50 });
                }
            }
            // From the start.
            Condition::DiskFull => {}
        }
    }

    fn enlarge_disk(&self) {
        let Some(pid) = self.supervisor() else { return };
        let out = self.sandbox.path("course-out");
        let words = ["-t", &pid.to_string(), "-m", "mount", "-o", "remount,size=64m"].map(ToOwned::to_owned);
        let _ = Command::new("nsenter").args(words).arg(out).stderr(Stdio::null()).status();
    }
}

/// Times of conditions are random; nothing is synchronised by them.
fn pause_ms(ms: u64) {
    std::thread::sleep(Duration::from_millis(ms));
}

/// Processes may have exited in the meantime.
fn signal_all(pids: &[u32], signal: Signal) {
    for pid in pids {
        let _ = kill_process(Pid::from_raw(i32::try_from(*pid).unwrap()).unwrap(), signal);
    }
}

/// Files may have been removed in the meantime.
fn remove_all(paths: &[PathBuf]) {
    paths.iter().for_each(|path| drop(if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) }));
}

fn can_mount() -> bool {
    let tried = Command::new("unshare").args(["-m", "sh", "-c", "mount -t tmpfs none /mnt"]).stderr(Stdio::null()).status();
    tried.is_ok_and(|status| status.success())
}

/// How a deployment ended that went well, or how it went wrong.
fn run(course: &Course, random: &mut ChaCha8Rng) -> Result<&'static str, String> {
    let sandbox = Sandbox::new();
    let mut running = Running::start(&sandbox, course);
    let mut events: Vec<(u64, Option<Condition>)> = course.conditions.iter().map(|(at, condition)| (*at, Some(*condition))).collect();
    events.extend(course.disk.1.map(|at| (at, None)));
    events.sort_unstable();
    for (at, condition) in events {
        if !running.wait_until(at) {
            break;
        }
        match condition {
            Some(condition) => running.undergo(condition, random),
            None if running.is_mounted => running.enlarge_disk(),
            None => {}
        }
    }
    let status = running.end();
    let said = running.said();
    let log = running.out.join("drive.mcap");
    match status.code() {
        Some(0) => {
            let replay = sandbox.output(["replay".as_ref(), log.as_os_str(), "--out".as_ref(), sandbox.path("again").as_os_str()]);
            // A terminal that closes at once ends the run before the first scan.
            if replay.code == Some(2) && replay.stderr.contains("has no scan to replay") && course.has(Condition::TerminalCloses) {
                return Ok("ended before the first scan");
            }
            if replay.code != Some(0) {
                return Err(format!("exit code 0, but its log: {:?} {}{}\n{said}", replay.code, replay.stdout, replay.stderr));
            }
            if map(&running.out) != map(&sandbox.path("again")) {
                return Err(format!("exit code 0, but its map is not that of its log\n{}\n{said}", replay.stdout));
            }
            Ok("map of its log")
        }
        Some(_) if course.has(Condition::TerminalCloses) => Ok("exit code only: its terminal is closed"),
        Some(1 | 3) => {
            let last = said.lines().last().unwrap_or_default();
            let names = ["failed ", "not finished", "INCOMPLETE", "DOUBTFUL", "error: "];
            if names.iter().any(|name| last.contains(name)) { Ok("says what is missing") } else { Err(format!("{status}\n{said}")) }
        }
        _ => Err(format!("{status}\n{said}")),
    }
}

fn map(folder: &Path) -> Option<Vec<u8>> {
    fs::read(folder.join("map.pgm")).ok()
}

#[test]
#[ignore = "a minute and more: run by name"]
fn random_conditions_leave_the_map_of_the_log_or_an_error() {
    let number = |variable: &str, default: u64| std::env::var(variable).map_or(default, |text| text.parse().unwrap());
    let (count, seed) = (number("STILLMAP_CONDITIONS", 3), number("STILLMAP_CONDITIONS_SEED", 1));
    let can_mount = can_mount();
    let mut ends: BTreeMap<&str, u64> = BTreeMap::new();
    let mut wrong = Vec::new();
    for at in seed..seed + count {
        let mut random = ChaCha8Rng::seed_from_u64(at);
        let course = Course::random(&mut random, can_mount);
        let end = run(&course, &mut random);
        eprintln!("seed {at}: {course:?}: {}", end.as_ref().map_or("WRONG", |end| end));
        match end {
            Ok(end) => *ends.entry(end).or_default() += 1,
            Err(why) => wrong.push(format!("seed {at}: {course:?}: {why}")),
        }
    }
    eprintln!("{count} deployments from seed {seed}: {ends:?}");
    assert!(wrong.is_empty(), "{} of {count} went wrong:\n{}", wrong.len(), wrong.join("\n\n"));
}
