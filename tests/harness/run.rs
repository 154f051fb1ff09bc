//! A command that runs: what it writes, how its deployment is, and how it ends.

use std::io::{BufRead, BufReader, Read};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use messages::{DeploymentStatus, ProcessStatus};

use super::observer::Observer;
use super::processes::{Exit, look_until};
use super::{WATCHDOG, text};

/// A supervisor publishes its status every second: after this time without one, whether it still runs is looked at.
const STATUS: Duration = Duration::from_secs(2);

/// A command that runs; killed with all that it started when dropped before its end.
pub(crate) struct Run {
    child: Child,
    /// Where its deployment is, and the name if it is known.
    runtime: PathBuf,
    deployment: Option<String>,
    lines: Receiver<(Instant, String)>,
    /// Lines of standard error so far, and how many of them have been searched.
    said: Vec<String>,
    searched: usize,
    stdout: Option<JoinHandle<Vec<u8>>>,
}

/// How a command ended.
#[derive(Debug)]
pub(crate) struct Ended {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Run {
    pub(crate) fn start(mut command: Command, runtime: PathBuf, deployment: Option<String>) -> Self {
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut stdout = child.stdout.take().unwrap();
        let stdout = std::thread::spawn(move || {
            let mut bytes = Vec::new();
            let _ = stdout.read_to_end(&mut bytes);
            bytes
        });
        let mut stderr = BufReader::new(child.stderr.take().unwrap());
        let (sender, lines) = channel();
        std::thread::spawn(move || {
            let mut line = Vec::new();
            while stderr.read_until(b'\n', &mut line).is_ok_and(|count| count > 0) {
                let _ = sender.send((Instant::now(), text(line.trim_ascii_end())));
                line.clear();
            }
        });
        Self { child, runtime, deployment, lines, said: Vec::new(), searched: 0, stdout: Some(stdout) }
    }

    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    /// The next line on standard error and when it came, if one comes in time.
    pub(crate) fn line(&mut self, within: Duration) -> Result<(Instant, String), RecvTimeoutError> {
        let (at, line) = self.lines.recv_timeout(within)?;
        self.said.push(line.clone());
        Ok((at, line))
    }

    /// Waits for a line with these words behind those that were waited for before.
    #[track_caller]
    pub(crate) fn wait_for_line(&mut self, words: &str) -> String {
        loop {
            while let Some(line) = self.said.get(self.searched) {
                self.searched += 1;
                if line.contains(words) {
                    return line.clone();
                }
            }
            if let Err(error) = self.line(WATCHDOG) {
                self.fail(&format!("{error} before it said {words:?}"));
            }
        }
    }

    /// Waits until `wanted` holds of the process of this name.
    #[track_caller]
    pub(crate) fn wait_for(&mut self, process: &str, what: &str, wanted: impl Fn(&ProcessStatus) -> bool) -> ProcessStatus {
        let mut found = None;
        self.wait_for_status(&format!("{process}: {what}"), |status| {
            found = status.processes().iter().find(|it| it.process.as_str() == process && wanted(it)).copied();
            found.is_some()
        });
        found.unwrap()
    }

    /// Waits until `wanted` holds of the deployment.
    #[track_caller]
    pub(crate) fn wait_for_status(&mut self, what: &str, mut wanted: impl FnMut(&DeploymentStatus) -> bool) {
        let since = Instant::now();
        let mut observer = None;
        look_until(&format!("{what}: its deployment runs"), || {
            observer = Observer::join(&self.runtime, self.deployment.as_deref());
            observer.is_some() || self.has_ended()
        });
        while let Some(observer) = &mut observer {
            let statuses = observer.take(STATUS);
            if statuses.iter().any(&mut wanted) {
                return;
            }
            // The last status that a supervisor publishes.
            let is_last = |status: &DeploymentStatus| status.ending == 1 && status.processes().iter().all(ProcessStatus::is_over);
            if statuses.iter().any(is_last) || self.has_ended() || since.elapsed() > WATCHDOG {
                break;
            }
        }
        drop(observer);
        self.fail(&format!("never: {what}"));
    }

    /// The process id of a process of its deployment, once it is started.
    #[track_caller]
    pub(crate) fn pid_of(&mut self, process: &str) -> u32 {
        self.wait_for(process, "it is started", |it| it.pid != 0).pid
    }

    fn has_ended(&mut self) -> bool {
        self.child.try_wait().unwrap().is_some()
    }

    /// Waits for its end.
    #[track_caller]
    pub(crate) fn end(mut self) -> Ended {
        loop {
            match self.line(WATCHDOG) {
                Ok(_) => {}
                Err(RecvTimeoutError::Disconnected) => break,
                Err(RecvTimeoutError::Timeout) => self.fail("neither says anything nor ends"),
            }
        }
        let code = self.child.wait().unwrap().code();
        let stdout = text(&self.stdout.take().unwrap().join().unwrap());
        Ended { code, stdout, stderr: self.said.join("\n") + "\n" }
    }

    /// Fails the test with all that is known of the run.
    #[track_caller]
    fn fail(&mut self, why: &str) -> ! {
        let status = Observer::join(&self.runtime, self.deployment.as_deref()).and_then(|mut observer| observer.take(STATUS).pop());
        while self.line(Duration::ZERO).is_ok() {}
        panic!("{why}; it said:\n{}\n{status:#?}", self.said.join("\n"));
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        if self.stdout.is_none() {
            return;
        }
        // A killed supervisor's guard cleans up after it.
        let children = Exit::of_children(self.pid());
        let _ = self.child.kill();
        let _ = self.child.wait();
        children.iter().for_each(|child| {
            child.comes();
        });
    }
}

impl Ended {
    /// The hash of the map on its standard output, of a run that went well.
    #[track_caller]
    pub(crate) fn map(&self) -> String {
        self.assert_code(0);
        let hash = self.stdout.lines().find_map(|line| line.strip_prefix("map sha256 "));
        let hash = hash.unwrap_or_else(|| panic!("no hash in {:?}", self.stdout));
        assert_eq!(hash.len(), 64);
        hash.to_owned()
    }

    #[track_caller]
    pub(crate) fn assert_code(&self, code: i32) {
        assert_eq!(self.code, Some(code), "{}{}", self.stdout, self.stderr);
    }

    /// Whether its summary names restarts.
    pub(crate) fn restarted(&self) -> Option<&str> {
        self.stdout.lines().find_map(|line| line.strip_prefix("restarted  "))
    }
}
