//! A place for one test's deployments and files.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;

use super::{Deployment, Ended, Run};

/// A runtime folder and a folder for files that no other test has; gone when dropped. A test that passes has left nothing in shared memory.
pub(crate) struct Sandbox {
    runtime: tempfile::TempDir,
    files: tempfile::TempDir,
    executable: PathBuf,
    /// Folders of the deployments that were started.
    domains: Mutex<BTreeSet<PathBuf>>,
}

impl Sandbox {
    pub(crate) fn new() -> Self {
        let [runtime, files] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        Self { runtime, files, executable: PathBuf::from(env!("CARGO_BIN_EXE_stillmap")), domains: Mutex::default() }
    }

    /// With a copy of the command of its own: a long run outlasts the next build.
    pub(crate) fn with_a_copy() -> Self {
        let mut sandbox = Self::new();
        let copy = sandbox.path("stillmap");
        std::fs::copy(&sandbox.executable, &copy).unwrap();
        sandbox.executable = copy;
        sandbox
    }

    /// A file or folder for the test's own use.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.files.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, text).unwrap();
        path
    }

    /// The folder of its deployments.
    pub(crate) fn runtime(&self) -> &Path {
        self.runtime.path()
    }

    /// The `stillmap` command in this sandbox.
    pub(crate) fn stillmap<I: AsRef<OsStr>>(&self, arguments: impl IntoIterator<Item = I>) -> Command {
        let mut command = self.program(&self.executable);
        command.args(arguments);
        command
    }

    /// Another program in this sandbox, one that starts the command.
    pub(crate) fn program(&self, program: impl AsRef<OsStr>) -> Command {
        let mut command = Command::new(program);
        command.env("STILLMAP_RUNTIME_DIR", self.runtime()).env_remove("STILLMAP_LOG").current_dir(self.files.path());
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    /// Starts a command that runs at most one deployment.
    pub(crate) fn start(&self, command: Command) -> Run {
        self.spawn(command, None)
    }

    /// Runs the command to its end.
    #[track_caller]
    pub(crate) fn output<I: AsRef<OsStr>>(&self, arguments: impl IntoIterator<Item = I>) -> Ended {
        self.start(self.stillmap(arguments)).end()
    }

    /// `stillmap run` of a deployment with more arguments.
    pub(crate) fn command(&self, deployment: &Deployment, more: &[&str]) -> Command {
        let settings = deployment.write(self);
        self.domains.lock().unwrap().insert(self.runtime().join(deployment.name()));
        let mut command = self.stillmap(["run"]);
        command.arg(settings).args(more);
        command
    }

    /// Starts a deployment.
    pub(crate) fn run(&self, deployment: &Deployment, more: &[&str]) -> Run {
        self.spawn(self.command(deployment, more), Some(deployment.name()))
    }

    /// Starts a deployment by a command of the test's own, one made of [`Sandbox::command`].
    pub(crate) fn run_by(&self, command: Command, deployment: &Deployment) -> Run {
        self.spawn(command, Some(deployment.name()))
    }

    fn spawn(&self, command: Command, deployment: Option<&str>) -> Run {
        let run = Run::start(command, self.runtime().to_owned(), deployment.map(str::to_owned));
        // The names that `stillmap demo` and `stillmap replay` give.
        let own_names = ["demo", "replay"].map(|name| self.runtime().join(format!("{name}-{}", run.pid())));
        self.domains.lock().unwrap().extend(own_names);
        run
    }

    /// Replays a log in lockstep; the hash of its map, which is in the folder of this name.
    #[track_caller]
    pub(crate) fn replayed(&self, log: &Path, out: &str) -> String {
        self.output(["replay".as_ref(), log.as_os_str(), "--out".as_ref(), self.path(out).as_os_str()]).map()
    }

    /// What is left of its deployments: files of the runtime folder and shared memory.
    pub(crate) fn left_behind(&self) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(self.runtime()).into_iter().flatten().flatten();
        let in_runtime = entries.map(|entry| entry.path());
        in_runtime.chain(self.shared_memory()).collect()
    }

    /// Files of its deployments in shared memory.
    pub(crate) fn shared_memory(&self) -> Vec<PathBuf> {
        let domains = self.domains.lock().unwrap();
        let prefix = |domain: &PathBuf| format!("stillmap_{:08x}_", crc32fast::hash(domain.as_os_str().as_encoded_bytes()));
        let prefixes: Vec<String> = domains.iter().map(prefix).collect();
        let is_ours = |path: &PathBuf| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            prefixes.iter().any(|prefix| name.starts_with(prefix))
        };
        std::fs::read_dir("/dev/shm").unwrap().flatten().map(|entry| entry.path()).filter(is_ours).collect()
    }

    #[track_caller]
    pub(crate) fn assert_nothing_left(&self) {
        assert_eq!(self.left_behind(), Vec::<PathBuf>::new());
    }
}

impl Drop for Sandbox {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            self.assert_nothing_left();
        }
    }
}
