//! The program of `supervisor.on_event`, started once for each event.
//!
//! It can hold up nothing: one runs at a time, for a limited time, and few events wait.

use crate::child::Child;
use crate::deployment::Deployment;
use crate::events::{Ending, Notice};
use crate::leftovers::Origin;
use crate::lifecycle::Exit;
use crate::notices::words;
use bus::Domain;
use rustix::process::Signal;
use std::collections::VecDeque;
use std::process::Command;
use std::time::{Duration, Instant};

/// Longest run of the program. A mail or a message over a slow link takes seconds.
const LONGEST: Duration = Duration::from_secs(10);
/// Most events that wait. A deployment has at most 23 processes, which can fail at once.
const MOST_WAITING: usize = 32;
/// Longest time that the end of a run waits for the program.
const LONGEST_AT_END: Duration = Duration::from_secs(10);
/// How often the end of a run looks for the end of the program.
const LOOK: Duration = Duration::from_millis(20);

/// What happened, for the environment of the program.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Alert {
    event: &'static str,
    process: String,
    message: String,
}

/// The program with the events that wait for it.
pub(crate) struct Hook {
    command: Vec<String>,
    deployment: String,
    waiting: VecDeque<Alert>,
    dropped: u64,
    running: Option<(Child, Instant)>,
}

impl Hook {
    /// The program of this deployment; an empty command is none.
    pub(crate) fn new(command: &[String], deployment: &str) -> Self {
        Self { command: command.to_vec(), deployment: deployment.to_owned(), waiting: VecDeque::new(), dropped: 0, running: None }
    }

    /// Puts a notice into the queue if it is an event.
    pub(crate) fn notice(&mut self, notice: &Notice, deployment: &Deployment) {
        let Some(event) = event(notice).filter(|_| !self.command.is_empty()) else { return };
        if self.waiting.len() == MOST_WAITING {
            self.dropped += 1;
            return;
        }
        let (process, line) = words(notice, deployment);
        self.waiting.push_back(Alert { event, process: process.to_owned(), message: line.text });
    }

    /// The process id of the program while it runs.
    pub(crate) fn pid(&self) -> Option<u32> {
        self.running.as_ref().map(|(child, _)| child.pid())
    }

    /// Ends the program that has ended or takes too long, and starts it for the next event.
    pub(crate) fn advance(&mut self, domain: &Domain) {
        if let Some((child, since)) = &mut self.running {
            let late = since.elapsed() > LONGEST;
            if late {
                child.signal(Signal::KILL);
            }
            let mut said = Vec::new();
            child.read_output(|line| said.push(line.to_owned()));
            let ended = late || child.has_ended().unwrap_or(true);
            let exit = ended.then(|| {
                child.reap(Origin { domain: domain.directory(), process: Some("on_event") }, |line| said.push(line.to_owned()), |_| {})
            });
            said.iter().for_each(|line| tracing::info!("on_event: {line}"));
            match exit {
                None => return,
                Some(Ok(Exit::Finished)) => {}
                Some(Ok(_)) if late => {
                    tracing::warn!("on_event: {} did not end within {} s and was killed", self.name(), LONGEST.as_secs())
                }
                Some(Ok(exit)) => tracing::warn!("on_event: {} {exit}", self.name()),
                Some(Err(error)) => tracing::warn!("on_event: {error}"),
            }
            self.running = None;
        }
        let Some(alert) = self.waiting.pop_front() else {
            if self.dropped > 0 {
                tracing::warn!("on_event: {} events came too fast for {} and were dropped", self.dropped, self.name());
                self.dropped = 0;
            }
            return;
        };
        domain.close_on_exec();
        match Child::start(self.program(&alert), None) {
            Ok(child) => self.running = Some((child, Instant::now())),
            Err(error) => tracing::warn!("on_event: {} could not be started: {error}", self.name()),
        }
    }

    /// Runs the program for what waits when the run is over, for a limited time.
    pub(crate) fn finish(&mut self, domain: &Domain) {
        let since = Instant::now();
        self.advance(domain);
        while self.running.is_some() {
            if since.elapsed() > LONGEST_AT_END {
                tracing::warn!("on_event: {} was killed with {} events left, for the run has ended", self.name(), self.waiting.len());
                self.running.iter().for_each(|(child, _)| child.signal(Signal::KILL));
                return;
            }
            std::thread::park_timeout(LOOK);
            self.advance(domain);
        }
    }

    fn name(&self) -> &str {
        self.command.first().map_or("", String::as_str)
    }

    fn program(&self, alert: &Alert) -> Command {
        let mut command = Command::new(self.name());
        command.args(self.command.iter().skip(1));
        command.env("STILLMAP_EVENT", alert.event).env("STILLMAP_DEPLOYMENT", &self.deployment);
        command.env("STILLMAP_EVENT_PROCESS", &alert.process).env("STILLMAP_EVENT_MESSAGE", alert.message.replace('\0', " "));
        command
    }
}

/// The name of the event that a notice is, if it is one.
fn event(notice: &Notice) -> Option<&'static str> {
    match notice {
        Notice::Failed { .. } | Notice::Ends(Ending::BadInput { .. } | Ending::Lost { .. } | Ending::DomainBroken) => Some("failed"),
        Notice::Restarting { .. } | Notice::Rebuilds => Some("degraded"),
        Notice::Lost { .. } => Some("lost"),
        Notice::DiskLow { .. } => Some("disk_low"),
        // A process that hangs is restarted, and removed files make everything restart: these follow.
        Notice::Hangs { .. } | Notice::Removed { .. } => None,
        Notice::Up { .. } | Notice::RestartRequested { .. } | Notice::Finished { .. } => None,
        Notice::Ends(Ending::Complete | Ending::NothingLeft | Ending::Asked | Ending::Forced) => None,
        Notice::Restless { .. } | Notice::StoodStill(_) => None,
    }
}
