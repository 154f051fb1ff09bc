//! The run loop around a process: wake-ups, heartbeat, progress, signals, a clean end.

use std::os::fd::{AsFd, BorrowedFd};
use std::time::{Duration, Instant};

use bus::{BusError, DomainError, FrameReader, FrameWriter, Injection, Membership, MembershipError, Ports, Reader, Received, Tap, Writer};
use messages::{
    Counter, DeploymentStatus, Heartbeat, MAX_COUNTERS, MAX_INPUTS, Payload, Phase, Pictures, ProcessStatus, Progress, Service, Text,
};

use crate::checkpoint::{Checkpoint, SaveError};
use crate::signals::Signals;

/// Longest time between two heartbeats of a work loop that does not hang.
const HEARTBEAT: Duration = Duration::from_millis(200);
/// How long a round takes messages: half of the time between two heartbeats, so that the work on its last message has the other.
const ROUND: Duration = Duration::from_millis(100);
/// How long a finished process keeps its outputs, so that readers which have just joined get what it sent last.
const LINGER: Duration = Duration::from_millis(100);

/// Whatever a step fails with; the process ends and is started again.
pub type StepError = Box<dyn std::error::Error + Send + Sync>;

/// The work of a process.
pub trait Process {
    /// One round: takes everything that waits, publishes what follows from it. Called when an input, a file descriptor or a
    /// due time woke the loop, and at least five times a second.
    ///
    /// # Errors
    /// Anything that only a new start of the process can mend.
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError>;

    /// File descriptors that wake the loop when they are readable.
    fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
        Vec::new()
    }
}

/// A closure is a process that nothing but its inputs and due times wake.
impl<F: FnMut(&mut Context<'_>) -> Result<Next, StepError>> Process for F {
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError> {
        self(context)
    }
}

/// What a step wants next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Next {
    /// To be called when something comes.
    Wait,
    /// To be called when something comes, or after this time.
    WaitAtMost(Duration),
    /// To be called again at once.
    Again,
    /// Not to be called again: the process has done its work.
    Finished,
}

/// What a step may ask of its shell.
pub struct Context<'a> {
    stopping: bool,
    began: Instant,
    membership: &'a Membership,
    report: &'a mut Report,
}

/// How a process ended that should not have.
#[derive(thiserror::Error)]
pub enum RunError {
    /// The bus failed.
    #[error("{0}")]
    Bus(#[from] BusError),
    /// The domain failed.
    #[error("{0}")]
    Domain(#[from] DomainError),
    /// No supervisor has started this process.
    #[error("{0}")]
    Membership(#[from] MembershipError),
    /// The process failed.
    #[error("{0}")]
    Step(#[source] StepError),
    /// Signals or waiting failed.
    #[error("cannot wait: {0}")]
    Wait(#[from] std::io::Error),
}

/// In words, too: it is what a `main` that returns it prints.
impl core::fmt::Debug for RunError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        core::fmt::Display::fmt(self, f)
    }
}

/// The place of a process on the bus.
pub struct Shell {
    membership: Membership,
    signals: Signals,
    heartbeats: Writer<Heartbeat>,
    progress: Writer<Progress>,
    ports: Ports,
    report: Report,
    /// Why its checkpoint cannot be kept.
    save_error: SaveError,
    /// Processes that may need again what this one has said.
    consumers: Vec<String>,
    /// Recorders, and the services of this process whose end each has not written.
    unrecorded: Vec<(String, &'static str)>,
    /// It brings the world in: it has said all when it is asked to stop.
    is_source: bool,
}

#[derive(Debug, Default)]
struct Report {
    rounds: u64,
    note: Text<128>,
    counters: Vec<Counter>,
    answers: Vec<Answer>,
}

/// How far a source stream has been answered.
#[derive(Debug)]
struct Answer {
    service: &'static str,
    seq: u64,
    /// What was last said of it.
    published: Option<u64>,
}

impl Shell {
    /// Joins the domain that the membership names.
    ///
    /// # Errors
    /// When the domain is gone, broken, or of another version.
    pub fn join(membership: Membership) -> Result<Self, RunError> {
        let signals = Signals::install(membership.supervisor())?;
        let mut ports = Ports::join(&membership)?;
        let mut shell = Self {
            signals,
            heartbeats: ports.uncounted_writer()?,
            progress: ports.uncounted_writer()?,
            ports,
            report: Report::default(),
            save_error: SaveError::default(),
            consumers: Vec::new(),
            unrecorded: Vec::new(),
            is_source: false,
            membership,
        };
        shell.beat(Phase::Starting)?;
        Ok(shell)
    }

    /// Joins the domain of the supervisor that has started this process.
    ///
    /// # Errors
    /// When none has, or as [`join`](Self::join).
    pub fn from_env() -> Result<Self, RunError> {
        Self::join(Membership::from_env()?)
    }

    /// Declares an input: its messages wake the process.
    ///
    /// # Errors
    /// When the service does not exist or cannot be used.
    pub fn reader<T: Payload>(&mut self) -> Result<Reader<T>, BusError> {
        self.ports.reader()
    }

    /// Declares an output.
    ///
    /// # Errors
    /// When the service does not exist or cannot be used.
    pub fn writer<T: Payload>(&mut self) -> Result<Writer<T>, BusError> {
        self.ports.writer()
    }

    /// Declares that this process takes what others send on a routed service.
    ///
    /// # Errors
    /// When the service is not routed in this deployment, or cannot be used.
    pub fn tap<T: Payload>(&mut self) -> Result<Tap<T>, BusError> {
        self.ports.tap()
    }

    /// Declares that this process gives messages to the readers of a routed service.
    ///
    /// # Errors
    /// When the service does not exist or cannot be used.
    pub fn injection<T: Payload>(&mut self) -> Result<Injection<T>, BusError> {
        self.ports.injection()
    }

    /// Declares an input of pictures: they wake the process.
    ///
    /// # Errors
    /// When the service does not exist or cannot be used.
    pub fn frame_reader<P: Pictures>(&mut self) -> Result<FrameReader<P>, BusError> {
        self.ports.frame_reader()
    }

    /// Declares an output of pictures.
    ///
    /// # Errors
    /// When the service does not exist or cannot be used.
    pub fn frame_writer<P: Pictures>(&mut self) -> Result<FrameWriter<P>, BusError> {
        self.ports.frame_writer()
    }

    /// Has this process stay, once it has finished, until the processes of these names are over. They may die and then need again
    /// what it has said, and what a stream held dies with its sender.
    pub fn linger_until(&mut self, names: impl IntoIterator<Item = String>) {
        self.consumers.extend(names);
    }

    /// Has this process stay, once it has finished, until each of these recorders has the end of these services in its file, as
    /// [`Context::answered_on`] tells, or is over. One that is killed before needs them again.
    pub fn linger_until_recorded(&mut self, recorders: impl IntoIterator<Item = String>, services: &[Service]) {
        for recorder in recorders {
            self.unrecorded.extend(services.iter().map(|service| (recorder.clone(), service.name)));
        }
    }

    /// Declares this process a source of what these read: once it has been asked to stop and has finished, it stays until they are
    /// over, as with [`Shell::linger_until`], or until it is asked again.
    pub fn linger_as_source_until(&mut self, names: impl IntoIterator<Item = String>) {
        self.is_source = true;
        self.consumers.extend(names);
    }

    /// Who this process is.
    #[must_use]
    pub fn membership(&self) -> &Membership {
        &self.membership
    }

    /// Where this process saves its state for its next incarnation, and where the run is resumed, for its next start.
    #[must_use]
    pub fn checkpoint(&self) -> Checkpoint {
        Checkpoint::of(&self.membership, self.save_error.clone())
    }

    /// Where this process keeps state that is of no use to the next start of the deployment, and would wear out a disk.
    #[must_use]
    pub fn volatile_checkpoint(&self) -> Checkpoint {
        Checkpoint::volatile(&self.membership, self.save_error.clone())
    }

    /// Lets readers that have joined have what was sent, and waits until a message comes on an input, or for `patience`; for
    /// programs that keep their own loop. [`Shell::run`] also sends the heartbeat that a supervisor expects.
    ///
    /// # Errors
    /// When the system refuses to wait.
    pub fn wait_for_inputs(&self, patience: Duration) -> Result<(), RunError> {
        self.ports.refresh();
        self.wait(&[], patience)
    }

    /// Runs the process until it has finished.
    ///
    /// # Errors
    /// When a step fails, or the bus does.
    pub fn run(mut self, process: &mut impl Process) -> Result<(), RunError> {
        self.beat(Phase::Running)?;
        let mut beaten = Instant::now();
        loop {
            let stopping = self.signals.requested().is_some();
            let mut context = Context { stopping, began: Instant::now(), membership: &self.membership, report: &mut self.report };
            let next = process.step(&mut context).map_err(RunError::Step)?;
            self.report.rounds += 1;
            self.publish_progress()?;
            if next == Next::Finished {
                break;
            }
            if beaten.elapsed() >= HEARTBEAT {
                self.beat(Phase::Running)?;
                self.ports.refresh();
                beaten = Instant::now();
            }
            let until_beat = HEARTBEAT.saturating_sub(beaten.elapsed());
            let patience = match next {
                Next::Again => Duration::ZERO,
                Next::WaitAtMost(longest) => longest.min(until_beat),
                Next::Wait | Next::Finished => until_beat,
            };
            // A request to stop that has been seen is no longer readable: its bytes are taken, so waiting does not spin.
            self.wait(&process.descriptors(), patience)?;
        }
        self.linger()?;
        self.beat(Phase::Ending)?;
        if self.ports.sent() > 0 {
            self.ports.refresh();
            self.wait(&[], LINGER)?;
        }
        Ok(())
    }

    /// Keeps what was published until no consumer needs it any more, or the supervisor asks to stop. A source has been asked once before; one
    /// that has come to its end by itself ends the run with that. A process that starts again then, such as a recorder that was killed,
    /// still reads what it lacks.
    fn linger(&mut self) -> Result<(), RunError> {
        let asked = self.signals.count();
        if self.consumers.is_empty() && self.unrecorded.is_empty() || self.is_source != (asked > 0) {
            return Ok(());
        }
        let mut statuses = self.ports.uncounted_reader::<DeploymentStatus>()?;
        let mut recorded = self.ports.uncounted_reader::<Progress>()?;
        // The supervisor tells the end of a consumer and the death of a reader one after the other.
        let (mut one_starts, mut needed) = (false, Instant::now());
        while self.signals.count() == asked {
            while let Some(received) = statuses.take()? {
                let Received::Message(status) = received else { continue };
                one_starts = status.processes().iter().any(ProcessStatus::is_starting);
                let is_over = |name: &str| status.processes().iter().any(|it| it.process.as_str() == name && it.is_over());
                self.consumers.retain(|name| !is_over(name));
                self.unrecorded.retain(|(recorder, _)| !is_over(recorder));
            }
            while let Some(received) = recorded.take()? {
                let Received::Message(it) = received else { continue };
                self.unrecorded.retain(|(recorder, service)| recorder != it.process.as_str() || *service != it.service.as_str());
            }
            if !self.consumers.is_empty() || !self.unrecorded.is_empty() || one_starts {
                needed = Instant::now();
            } else if needed.elapsed() >= LINGER {
                break;
            }
            let awaited = self.awaited();
            self.report.note = Text::new(&format!("has ended, stays for {awaited}"));
            self.publish_progress()?;
            self.beat(Phase::Ending)?;
            self.ports.refresh();
            self.wait(&[], LINGER)?;
        }
        Ok(())
    }

    /// The processes that a finished one stays for, in words.
    fn awaited(&self) -> String {
        let recorders = self.unrecorded.iter().map(|(recorder, _)| recorder);
        let mut names: Vec<&str> = self.consumers.iter().chain(recorders).map(String::as_str).collect();
        names.dedup();
        if names.is_empty() { "a restart".to_owned() } else { names.join(", ") }
    }

    fn wait(&self, descriptors: &[BorrowedFd<'_>], patience: Duration) -> Result<(), RunError> {
        let others: Vec<BorrowedFd<'_>> = [self.signals.as_fd()].into_iter().chain(descriptors.iter().copied()).collect();
        Ok(self.ports.wait(&others, patience)?)
    }

    /// Publishes what is new, and everything when a reader has just joined: the history of the service holds one answer, and a process may
    /// answer several streams.
    fn publish_progress(&mut self) -> Result<(), BusError> {
        let joined = self.progress.joined();
        for answer in &mut self.report.answers {
            let seq = self.ports.answered(answer.service, answer.seq);
            if answer.published == Some(seq) && !joined {
                continue;
            }
            answer.published = Some(seq);
            let process = Text::new(self.membership.process());
            let stamp_ns = self.membership.clock().now_ns();
            let progress = Progress { process, service: Text::new(answer.service), answered: seq };
            self.progress.send(seq, stamp_ns, &progress)?;
        }
        Ok(())
    }

    fn beat(&mut self, phase: Phase) -> Result<(), BusError> {
        let (report, inputs, sent) = (&self.report, self.ports.inputs(), self.ports.sent());
        let inputs_count = inputs.len().min(MAX_INPUTS) as u32;
        let process = Text::new(self.membership.process());
        let stamp_ns = self.membership.clock().now_ns();
        let note = match &*self.save_error.borrow() {
            Some(save_error) => Text::new(&format!("{save_error}; {}", report.note)),
            None => report.note,
        };
        self.heartbeats.send_with(report.rounds, stamp_ns, |heartbeat| {
            heartbeat.process = process;
            heartbeat.note = note;
            heartbeat.progress = report.rounds;
            heartbeat.sent = sent;
            for (place, input) in heartbeat.inputs.iter_mut().zip(inputs) {
                *place = input;
            }
            for (place, counter) in heartbeat.counters.iter_mut().zip(&report.counters) {
                *place = *counter;
            }
            heartbeat.inputs_count = inputs_count;
            heartbeat.counters_count = report.counters.len() as u32;
            heartbeat.pid = std::process::id();
            heartbeat.phase = phase as u32;
        })
    }
}

impl Context<'_> {
    /// Whether the process has been asked to stop: it finishes what it holds and then returns [`Next::Finished`].
    #[must_use]
    pub fn stopping(&self) -> bool {
        self.stopping
    }

    /// Whether the step has worked for so long that it should return [`Next::Again`]: no other thread sends the heartbeat. Work on
    /// one message or one piece of a result ends before it asks.
    #[must_use]
    pub fn round_is_over(&self) -> bool {
        self.began.elapsed() >= ROUND
    }

    /// Sensor time for drivers, ns since the Unix epoch: runs `speed` times faster than the wall. Nothing but a driver asks.
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        self.membership.clock().now_ns()
    }

    /// Since the deployment started, s of deployment time: as people read it.
    #[must_use]
    pub fn elapsed_s(&self) -> f64 {
        self.membership.clock().elapsed_s()
    }

    /// Says in words what the process is doing or missing; empty when there is nothing to say. Stays until said otherwise.
    pub fn note(&mut self, words: &str) {
        self.report.note = Text::new(words);
    }

    /// Sets a named counter of the heartbeat; at most 16 names, further ones are left out.
    pub fn count(&mut self, name: &str, value: u64) {
        let name = Text::new(name);
        let counters = &mut self.report.counters;
        if let Some(counter) = counters.iter_mut().find(|counter| counter.name == name) {
            counter.value = value;
        } else if counters.len() < MAX_COUNTERS {
            counters.push(Counter { name, value });
        }
    }

    /// Says that every message of the source stream `T` up to `seq` is answered for; lockstep playback goes by it.
    pub fn answered<T: Payload>(&mut self, seq: u64) {
        self.answered_on(T::SERVICE.name, seq);
    }

    /// As [`Context::answered`], for a stream of pictures.
    pub fn answered_frames<P: Pictures>(&mut self, seq: u64) {
        self.answered_on(P::SERVICE.name, seq);
    }

    /// As [`Context::answered`], for the service of this name. A recorder says so of every service whose end it has written.
    pub fn answered_on(&mut self, service: &'static str, seq: u64) {
        let answers = &mut self.report.answers;
        match answers.iter_mut().find(|answer| answer.service == service) {
            Some(answer) => answer.seq = seq,
            None => answers.push(Answer { service, seq, published: None }),
        }
    }
}
