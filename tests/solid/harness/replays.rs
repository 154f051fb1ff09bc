//! Replays in lockstep of one recorded drive, and the means to disturb them.
#![allow(dead_code, reason = "each test uses its part")]

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::LazyLock;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use rustix::process::Signal;

use super::cork::Cork;
use super::{Bench, kill, map_sha256, signal};

const WORLD: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/config/worlds/corridor.toml");
/// The processes of [`replay_settings`].
pub(crate) const PROCESSES: [&str; 5] = ["mapping", "std", "fti", "recorder", "playback"];
/// A run that says nothing and does not end for so long hangs; nothing is measured by it.
const SILENCE: Duration = Duration::from_secs(60);
/// A test that waits for longer than this for a moment to come has missed it.
const MISSED: Duration = Duration::from_secs(120);

/// One recorded drive for all tests of a file, and the map of its undisturbed replay.
pub(crate) static DRIVE: LazyLock<(Bench, PathBuf, String)> = LazyLock::new(|| {
    let bench = Bench::new();
    let log = record_drive(&bench);
    let settings = bench.write("undisturbed.toml", &replay_settings("undisturbed", &log, ""));
    let map = sha256_of(&Watched::start(bench.stillmap(["run", settings.to_str().unwrap()])).end());
    (bench, log, map)
});

/// Records a simulated drive among walkers, with STD and FTI but no camera; the log.
pub(crate) fn record_drive(bench: &Bench) -> PathBuf {
    let processes = ["recorder", "mapping", "fti", "std", "simulator", "pioneer"].map(entry).concat();
    let settings = format!(
        "name = \"drive\"\nout = \"drive-out\"\n{processes}
        [robot]\nmodel = \"pioneer-1\"\nrange_limit_m = 3.0\nodometry_modulus = 32768
        [simulator]\nworld = {WORLD:?}\n[pioneer]\nport = \"simulator\"
        [mapping]\nkeep_unfiltered = true\n"
    );
    let settings = bench.write("drive.toml", &settings);
    map_sha256(&bench.output(["run", settings.to_str().unwrap(), "--speed", "20"]));
    bench.path("drive-out").join("drive.mcap")
}

/// A deployment that replays a log in lockstep and records it again; `more` goes in front of its sections.
pub(crate) fn replay_settings(name: &str, log: &Path, more: &str) -> String {
    let processes = ["recorder", "mapping", "fti", "std", "playback"].map(entry).concat();
    format!(
        "name = {name:?}\npace = \"lockstep\"\nout = \"{name}-out\"\n{processes}{more}
        [robot]\nmodel = \"pioneer-1\"\nrange_limit_m = 3.0\nodometry_modulus = 32768
        [mapping]\nkeep_unfiltered = true\n
        [playback]\nlog = {log:?}\nwindow = 16\n
        [supervisor]\nrestarts = 1000\nwithin_s = 1.0\nbackoff_first_s = 0.001\nbackoff_last_s = 0.01
        startup_deadline_s = 60.0\nheartbeat_timeout_s = 60.0\nstop_deadline_s = 60.0\n"
    )
}

fn entry(kind: &str) -> String {
    format!("[[process]]\nname = {kind:?}\nrun = {kind:?}\n")
}

/// A command that runs while its lines are looked at one by one.
pub(crate) struct Watched {
    child: Child,
    lines: Receiver<(Instant, String)>,
    said: String,
    stdout: Option<std::thread::JoinHandle<Vec<u8>>>,
}

impl Watched {
    pub(crate) fn start(mut command: Command) -> Self {
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut stdout = child.stdout.take().unwrap();
        let stdout = std::thread::spawn(move || {
            let mut bytes = Vec::new();
            let _ = stdout.read_to_end(&mut bytes);
            bytes
        });
        let stderr = child.stderr.take().unwrap();
        let (sender, lines) = channel();
        std::thread::spawn(move || {
            for line in BufReader::new(stderr).lines().map_while(Result::ok) {
                let _ = sender.send((Instant::now(), line));
            }
        });
        Self { child, lines, said: String::new(), stdout: Some(stdout) }
    }

    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    /// The next line on standard error, if one comes within `patience`; `None` when nothing will come any more.
    pub(crate) fn line(&mut self, patience: Duration) -> Option<Option<(Instant, String)>> {
        match self.lines.recv_timeout(patience) {
            Ok((at, line)) => {
                self.said.push_str(&line);
                self.said.push('\n');
                Some(Some((at, line)))
            }
            Err(RecvTimeoutError::Timeout) => Some(None),
            Err(RecvTimeoutError::Disconnected) => None,
        }
    }

    /// Waits for a line with these words.
    #[track_caller]
    pub(crate) fn wait_for_line(&mut self, words: &str) -> String {
        loop {
            match self.line(SILENCE) {
                Some(Some((_, line))) if line.contains(words) => return line,
                Some(Some(_)) => {}
                Some(None) => panic!("hangs without having said {words:?}; it said:\n{}", self.said),
                None => panic!("ended without having said {words:?}; it said:\n{}", self.said),
            }
        }
    }

    /// Waits for its end: its exit code, what it wrote to standard output and to standard error.
    #[track_caller]
    pub(crate) fn end(self) -> (Option<i32>, String, String) {
        self.end_or(String::new)
    }

    /// As [`Watched::end`]; when it hangs, `look` tells how it is then.
    #[track_caller]
    pub(crate) fn end_or(mut self, look: impl Fn() -> String) -> (Option<i32>, String, String) {
        loop {
            match self.line(SILENCE) {
                Some(Some(_)) => {}
                Some(None) => panic!("hangs; it said:\n{}\n{}", self.said, look()),
                None => break,
            }
        }
        let code = self.child.wait().unwrap().code();
        let stdout = self.stdout.take().unwrap().join().unwrap();
        (code, super::text(&stdout), std::mem::take(&mut self.said))
    }
}

impl Drop for Watched {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The children of a supervisor that run a built-in process, with their process ids, as the kernel knows them.
pub(crate) fn children(supervisor: u32) -> Vec<(String, u64)> {
    let listed = std::fs::read_to_string(format!("/proc/{supervisor}/task/{supervisor}/children")).unwrap_or_default();
    let kind = |pid: &str| {
        let command = std::fs::read(format!("/proc/{pid}/cmdline")).ok()?;
        let words: Vec<&[u8]> = command.split(|byte| *byte == 0).collect();
        (words.get(1) == Some(&b"process".as_slice())).then(|| super::text(words[2]))
    };
    listed.split_ascii_whitespace().filter_map(|pid| Some((kind(pid)?, pid.parse().ok()?))).collect()
}

#[track_caller]
pub(crate) fn wait_until(what: &str, wanted: impl Fn() -> bool) {
    let since = Instant::now();
    while !wanted() {
        assert!(since.elapsed() < MISSED, "never: {what}");
        std::thread::yield_now();
    }
}

/// The process of this kind, as soon as it is there.
#[track_caller]
pub(crate) fn pid_of(run: &Watched, process: &str) -> u64 {
    let find = || children(run.pid()).into_iter().find(|(name, _)| name == process).map(|(_, pid)| pid);
    wait_until(&format!("{process} is there"), || find().is_some());
    find().unwrap()
}

/// Kills a process that writes a checkpoint for each message, of which `fresh` is the file, in the middle of writing one: those before
/// it are there, and of this one nothing.
#[track_caller]
pub(crate) fn kill_in_the_middle_of_one_of_its_checkpoints(run: &Watched, process: &str, fresh: &Path) {
    let pid = pid_of(run, process);
    let stopped = || std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap().contains(") T ");
    let cork = loop {
        signal(pid, Signal::STOP);
        wait_until("it stands still", stopped);
        if !fresh.exists() {
            break Cork::put(fresh, true);
        }
        signal(pid, Signal::CONT);
    };
    signal(pid, Signal::CONT);
    wait_until("a checkpoint is begun", || cork.holds(pid));
    // It must not start again before its file is as the kill left it.
    signal(run.pid().into(), Signal::STOP);
    kill(pid);
    cork.leave_what_was_written();
    signal(run.pid().into(), Signal::CONT);
}

/// Kills a process that may just have ended by itself; whether it was there.
pub(crate) fn try_kill(pid: u64) -> bool {
    let pid = rustix::process::Pid::from_raw(i32::try_from(pid).unwrap()).unwrap();
    rustix::process::kill_process(pid, rustix::process::Signal::KILL).is_ok()
}

/// The hash on the last line of what a run printed.
#[track_caller]
pub(crate) fn sha256_of(ended: &(Option<i32>, String, String)) -> String {
    let (code, stdout, stderr) = ended;
    assert_eq!(*code, Some(0), "{stdout}{stderr}");
    let line = stdout.lines().last().unwrap_or_default();
    line.strip_prefix("map sha256 ").unwrap_or_else(|| panic!("the last line is {line:?}; {stderr}")).to_owned()
}

/// Pseudo-random numbers from a seed (SplitMix64).
pub(crate) struct Dice(pub(crate) u64);

impl Dice {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub(crate) fn below(&mut self, bound: usize) -> usize {
        (self.next() % bound as u64) as usize
    }
}
