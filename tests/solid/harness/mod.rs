//! What the tests of whole deployments share: a runtime folder of their own, the command, its status, its map.
#![allow(dead_code, reason = "each test uses its part")]

pub(crate) mod cork;
pub(crate) mod replays;

use std::io::Read;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

/// Longest a run may take before the test is called hung; nothing is measured by it.
const WATCHDOG: Duration = Duration::from_secs(240);

/// A place where no other test's deployment lives; gone with everything in it when dropped.
pub(crate) struct Bench {
    runtime: tempfile::TempDir,
    files: tempfile::TempDir,
    executable: PathBuf,
}

impl Bench {
    pub(crate) fn new() -> Self {
        let executable = PathBuf::from(env!("CARGO_BIN_EXE_stillmap"));
        Self { runtime: tempfile::tempdir().unwrap(), files: tempfile::tempdir().unwrap(), executable }
    }

    /// With a copy of the command of its own: a long run outlasts the next build.
    pub(crate) fn with_a_copy() -> Self {
        let mut bench = Self::new();
        let copy = bench.path("stillmap");
        std::fs::copy(&bench.executable, &copy).unwrap();
        bench.executable = copy;
        bench
    }

    /// A folder or file for the test's own use.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.files.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, text).unwrap();
        path
    }

    /// The folder where its deployments live.
    pub(crate) fn runtime(&self) -> &Path {
        self.runtime.path()
    }

    /// A deployment file: the demo's, in this world, with the sonars alone and with patience. What a busy machine delays changes
    /// nothing then: no picture is skipped and no deadline passes.
    pub(crate) fn sonar_only(&self, world: &str) -> PathBuf {
        let demo = include_str!("../../../config/demo.toml");
        let changes = [
            ("worlds/hall.toml", world),
            ("provides = \"pictures\"", "provides = \"off\""),
            ("[recorder]", "[fti]\npatience_s = 10\n\n[recorder]"),
            ("[[process]]\nname = \"sbs\"          # what moves, as the camera sees it\nrun = \"sbs\"\n", ""),
            ("[[process]]\nname = \"viewer\"       # the live page for a browser; the run does not depend on it\nrun = \"viewer\"\n", ""),
        ];
        let text = changes.into_iter().fold(demo.to_owned(), |text, (from, to)| {
            assert!(text.contains(from), "{from}");
            text.replacen(from, to, 1)
        });
        let text = text.split("[viewer]").next().unwrap_or_default();
        self.write("sonar-only.toml", text)
    }

    /// The `stillmap` command in this bench.
    pub(crate) fn stillmap<I: AsRef<std::ffi::OsStr>>(&self, arguments: impl IntoIterator<Item = I>) -> Command {
        let mut command = self.stillmap_by(&self.executable);
        command.args(arguments);
        command
    }

    /// Another program in this bench, one that starts the command.
    pub(crate) fn stillmap_by(&self, program: impl AsRef<std::ffi::OsStr>) -> Command {
        let mut command = Command::new(program);
        command.env("STILLMAP_RUNTIME_DIR", self.runtime.path()).current_dir(self.files.path());
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    /// Runs the command to its end.
    pub(crate) fn output<I: AsRef<std::ffi::OsStr>>(&self, arguments: impl IntoIterator<Item = I>) -> Output {
        Run::start(self.stillmap(arguments)).end()
    }

    /// The processes of the one deployment that runs, as `stillmap status --json` tells; none when nothing runs.
    pub(crate) fn processes(&self) -> Vec<Value> {
        let output = self.output(["status", "--json"]);
        let all: Value = serde_json::from_slice(&output.stdout).unwrap_or_default();
        all[0]["processes"].as_array().cloned().unwrap_or_default()
    }

    /// Waits until `wanted` holds for the process of this name.
    pub(crate) fn wait_for(&self, name: &str, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        let started = Instant::now();
        loop {
            let found = self.processes().into_iter().find(|process| process["process"] == name);
            if let Some(found) = found.filter(|process| wanted(process)) {
                return found;
            }
            assert!(started.elapsed() < WATCHDOG, "{name} never came to this: {what}");
        }
    }

    /// What is left on this machine of the deployments of this bench: files of the runtime folder and shared memory.
    pub(crate) fn left_behind(&self) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(self.runtime.path()).into_iter().flatten().flatten();
        let mut left: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
        let names: Vec<PathBuf> = left.iter().map(|path| path.with_extension("")).collect();
        for entry in std::fs::read_dir("/dev/shm").unwrap().flatten() {
            let ours = |path: &PathBuf| {
                let prefix = format!("stillmap_{:08x}_", crc32fast::hash(path.as_os_str().as_encoded_bytes()));
                entry.file_name().to_string_lossy().starts_with(&prefix)
            };
            if names.iter().chain(&self.seen()).any(ours) {
                left.push(entry.path());
            }
        }
        left
    }

    /// Domain folders that deployments of this bench have used; remembered, since a clean end removes them.
    fn seen(&self) -> Vec<PathBuf> {
        let text = std::fs::read_to_string(self.path("domains-seen")).unwrap_or_default();
        text.lines().map(PathBuf::from).collect()
    }

    /// Remembers the folder of the deployment that runs now.
    pub(crate) fn remember_domain(&self) {
        let output = self.output(["status", "--json"]);
        let all: Value = serde_json::from_slice(&output.stdout).unwrap();
        self.remember(Path::new(all[0]["folder"].as_str().expect("a deployment runs")));
    }

    /// Remembers the folder of a deployment.
    pub(crate) fn remember(&self, folder: &Path) {
        std::fs::write(self.path("domains-seen"), folder.to_str().unwrap()).unwrap();
    }
}

/// A command that runs; killed when dropped.
pub(crate) struct Run {
    child: Child,
    stdout: Option<std::thread::JoinHandle<Vec<u8>>>,
    stderr: Option<std::thread::JoinHandle<Vec<u8>>>,
}

impl Run {
    pub(crate) fn start(mut command: Command) -> Self {
        let mut child = command.spawn().unwrap();
        let stdout = collect(child.stdout.take().unwrap());
        let stderr = collect(child.stderr.take().unwrap());
        Self { child, stdout: Some(stdout), stderr: Some(stderr) }
    }

    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Waits for its end, but not for ever.
    pub(crate) fn end(mut self) -> Output {
        wait_for_exit(&exit_of(self.pid()));
        let status = self.child.wait().unwrap();
        let stdout = self.stdout.take().unwrap().join().unwrap();
        let stderr = self.stderr.take().unwrap().join().unwrap();
        Output { status, stdout, stderr }
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn collect(mut pipe: impl Read + Send + 'static) -> std::thread::JoinHandle<Vec<u8>> {
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        let _ = pipe.read_to_end(&mut bytes);
        bytes
    })
}

/// A descriptor that becomes readable when the process exits.
fn exit_of(pid: u32) -> OwnedFd {
    let pid = rustix::process::Pid::from_raw(i32::try_from(pid).unwrap()).unwrap();
    rustix::process::pidfd_open(pid, rustix::process::PidfdFlags::empty()).unwrap()
}

/// The same for every child of a process.
pub(crate) fn exits_of_children(pid: u32) -> Vec<OwnedFd> {
    let children = std::fs::read_to_string(format!("/proc/{pid}/task/{pid}/children")).unwrap();
    children.split_ascii_whitespace().map(|child| exit_of(child.parse().unwrap())).collect()
}

/// Waits for an exit, but not for ever.
#[track_caller]
pub(crate) fn wait_for_exit(exit: &OwnedFd) {
    let mut polled = [rustix::event::PollFd::new(exit, rustix::event::PollFlags::IN)];
    let watchdog = rustix::event::Timespec { tv_sec: WATCHDOG.as_secs() as i64, tv_nsec: 0 };
    assert_eq!(rustix::event::poll(&mut polled, Some(&watchdog)).unwrap(), 1, "the process hangs");
}

pub(crate) fn kill(pid: u64) {
    signal(pid, rustix::process::Signal::KILL);
}

pub(crate) fn signal(pid: u64, signal: rustix::process::Signal) {
    let pid = rustix::process::Pid::from_raw(i32::try_from(pid).unwrap()).unwrap();
    rustix::process::kill_process(pid, signal).unwrap();
}

/// Messages of one service in a log, in order.
pub(crate) fn recorded<T: drivelog::Logged>(log: &Path) -> Vec<(u64, T)> {
    let mut log = drivelog::Log::open(log).unwrap();
    let mut messages = Vec::new();
    while let Some(entry) = log.next_of::<T>().unwrap() {
        if let drivelog::Entry::Message { seq, payload, .. } = entry {
            messages.push((seq, payload));
        }
    }
    messages
}

pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// The line `map sha256 HEX` of a command's output.
#[track_caller]
pub(crate) fn map_sha256(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(0), "{}{}", text(&output.stdout), text(&output.stderr));
    let stdout = text(&output.stdout);
    let hash = stdout.lines().find_map(|line| line.strip_prefix("map sha256 ")).unwrap_or_else(|| panic!("no hash in {stdout:?}"));
    assert_eq!(hash.len(), 64);
    hash.to_owned()
}

/// A map as ROS map_server reads it: row 0 of `cells` is the smallest y.
pub(crate) struct PgmMap {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) cell_m: f64,
    pub(crate) origin_m: [f64; 2],
    pub(crate) cells: Vec<u8>,
}

pub(crate) const OCCUPIED: u8 = 0;
pub(crate) const FREE: u8 = 254;
pub(crate) const UNKNOWN: u8 = 205;

impl PgmMap {
    pub(crate) fn read(folder: &Path) -> Self {
        let yaml = std::fs::read_to_string(folder.join("map.yaml")).unwrap();
        let value = |key: &str| yaml.lines().find_map(|line| line.strip_prefix(&format!("{key}: "))).unwrap().trim().to_owned();
        let origin: Vec<f64> = value("origin").trim_matches(['[', ']']).split(',').map(|number| number.trim().parse().unwrap()).collect();
        let bytes = std::fs::read(folder.join(value("image").trim_matches('"'))).unwrap();
        let mut fields = Vec::new();
        let mut at = 0;
        while fields.len() < 4 {
            let end = at + bytes[at..].iter().position(u8::is_ascii_whitespace).unwrap();
            fields.push(text(&bytes[at..end]));
            at = end + 1;
        }
        assert_eq!(fields[0], "P5");
        assert_eq!(fields[3], "255");
        let (width, height): (usize, usize) = (fields[1].parse().unwrap(), fields[2].parse().unwrap());
        let pixels = &bytes[at..];
        assert_eq!(pixels.len(), width * height);
        let cells = pixels.chunks(width).rev().flatten().copied().collect();
        Self { width, height, cell_m: value("resolution").parse().unwrap(), origin_m: [origin[0], origin[1]], cells }
    }

    pub(crate) fn at(&self, x_m: f64, y_m: f64) -> u8 {
        let column = ((x_m - self.origin_m[0]) / self.cell_m).floor();
        let row = ((y_m - self.origin_m[1]) / self.cell_m).floor();
        let inside = (0.0..self.width as f64).contains(&column) && (0.0..self.height as f64).contains(&row);
        if inside { self.cells[row as usize * self.width + column as usize] } else { UNKNOWN }
    }

    pub(crate) fn count(&self, value: u8) -> usize {
        self.cells.iter().filter(|cell| **cell == value).count()
    }

    /// Share of the steps of 5 cm from `from_m` to `to_m` that have an occupied cell within `reach_m` across.
    pub(crate) fn wall_share(&self, from_m: [f64; 2], to_m: [f64; 2], reach_m: f64) -> f64 {
        let (dx, dy) = (to_m[0] - from_m[0], to_m[1] - from_m[1]);
        let length = dx.hypot(dy);
        let steps = (length / 0.05).ceil() as usize;
        let found = (0..steps).filter(|step| {
            let t = (*step as f64 + 0.5) / steps as f64;
            let across = (reach_m / 0.025).ceil() as i32;
            (-across..=across).any(|k| {
                let offset = f64::from(k) * 0.025;
                let x = from_m[0] + dx * t - dy / length * offset;
                let y = from_m[1] + dy * t + dx / length * offset;
                self.at(x, y) == OCCUPIED
            })
        });
        found.count() as f64 / steps as f64
    }
}
