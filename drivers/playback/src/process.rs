//! Playback as a process: from the log to the bus.

use std::time::Duration;

use bus::{BusError, Checkpoint, Context, Next, Reader, Received, RunError, Shell, StepError, Writer};
use drivelog::{Entry, Log, LogError};
use messages::{DeploymentStatus, Payload, ProcessState, Progress, SonarScan};
use settings::{BuiltIn, Pace, Program, Settings};

use crate::answers::{Answers, Consumer};
use crate::schedule::Schedule;
use crate::window::Window;

/// Most entries of the log looked at in one step: the heartbeat must not wait for a long log.
const MOST_AT_ONCE: usize = 1024;
/// Shortest wait for a due time: what is due within it is done a little late rather than by spinning.
const SHORTEST_WAIT: Duration = Duration::from_millis(1);

/// Why playback ended that should not have.
#[derive(Debug, thiserror::Error)]
pub enum PlaybackError {
    /// The log cannot be read.
    #[error("{0}")]
    Log(#[from] LogError),
    /// The bus failed.
    #[error("{0}")]
    Bus(#[from] BusError),
    /// The process failed at its work; at a damaged log, too, whose error is then the source.
    #[error("{0}")]
    Run(#[from] RunError),
}

/// Plays the log of the settings to its end.
///
/// # Errors
/// When the log cannot be read or the bus fails.
pub fn run(mut shell: Shell, settings: &Settings) -> Result<(), PlaybackError> {
    let log = Log::open(&settings.playback.log)?;
    tracing::info!("playing {}: {}", settings.playback.log.display(), log.preamble().origin);
    let membership = shell.membership();
    let (speed, restarted) = (membership.speed(), membership.incarnation() > 0);
    let checkpoint = shell.checkpoint();
    let mut playback = Playback {
        log,
        next: None,
        position: if restarted { Position::Unknown } else { Position::At },
        scans: shell.writer()?,
        progress: shell.reader()?,
        statuses: shell.reader()?,
        answers: Answers::new(consumers(settings)),
        pacing: match settings.pace {
            Pace::Live => Pacing::Live { schedule: load(&checkpoint), checkpoint, speed },
            Pace::Lockstep => Pacing::Lockstep(Window::new(settings.playback.window.get())),
        },
        first_ns: None,
        last: (0, 0),
        sent: 0,
        ended: false,
    };
    Ok(shell.run(&mut playback)?)
}

/// The processes of the deployment that answer scans; what any other executable does is not known.
fn consumers(settings: &Settings) -> impl Iterator<Item = Consumer> {
    settings.process.iter().filter_map(|process| {
        let ends_itself = match process.program {
            Program::BuiltIn(BuiltIn::Mapping) => true,
            Program::BuiltIn(BuiltIn::Recorder) => false,
            Program::BuiltIn(BuiltIn::Pioneer | BuiltIn::Simulator | BuiltIn::Playback) | Program::Command(_) => return None,
        };
        Some(Consumer { name: process.name.as_str().to_owned(), ends_itself })
    })
}

fn load(checkpoint: &Checkpoint) -> Option<Schedule> {
    match checkpoint.load() {
        Ok(bytes) => bytes.as_deref().and_then(Schedule::from_bytes),
        Err(error) => {
            tracing::warn!("{error}");
            None
        }
    }
}

struct Playback {
    log: Log,
    /// The entry of the log that comes next.
    next: Option<Entry<SonarScan>>,
    position: Position,
    scans: Writer<SonarScan>,
    progress: Reader<Progress>,
    statuses: Reader<DeploymentStatus>,
    answers: Answers,
    pacing: Pacing,
    /// Stamp of the first message.
    first_ns: Option<u64>,
    /// Number and stamp of the last message sent.
    last: (u64, u64),
    sent: u64,
    ended: bool,
}

/// Where in the log playback stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Position {
    /// Restarted: the consumers have to say how far they are.
    Unknown,
    /// On the way to what follows this message.
    Behind(u64),
    /// At the next message to send.
    At,
}

enum Pacing {
    Live { schedule: Option<Schedule>, checkpoint: Checkpoint, speed: f64 },
    Lockstep(Window),
}

impl bus::Process for Playback {
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError> {
        self.listen()?;
        if context.stopping() {
            self.end()?;
            return Ok(Next::Finished);
        }
        let next = self.play(context)?;
        self.report(context);
        Ok(next)
    }
}

impl Playback {
    /// Takes what the consumers and the supervisor say.
    fn listen(&mut self) -> Result<(), StepError> {
        while let Some(received) = self.progress.take()? {
            if let Received::Message(progress) = received
                && progress.service.as_str() == SonarScan::SERVICE.name
            {
                self.answers.answered(progress.process.as_str(), progress.answered);
            }
        }
        let over = [ProcessState::Finished, ProcessState::Failed].map(|state| state as u32);
        while let Some(received) = self.statuses.take()? {
            if let Received::Message(status) = received {
                let processes = status.processes.iter().take(status.count as usize);
                processes.filter(|it| over.contains(&it.state)).for_each(|it| self.answers.over(it.process.as_str()));
            }
        }
        Ok(())
    }

    /// Sends what may be sent now.
    fn play(&mut self, context: &Context<'_>) -> Result<Next, StepError> {
        if self.position == Position::Unknown {
            if self.answers.silent().is_some() {
                return Ok(Next::Wait);
            }
            let answered = self.answers.floor().unwrap_or_default();
            tracing::info!("goes on after scan {answered}");
            self.position = Position::Behind(answered);
        }
        if let (Pacing::Lockstep(window), floor) = (&mut self.pacing, self.answers.floor()) {
            // Without a consumer there is nobody to wait for.
            window.answered(floor.unwrap_or(u64::MAX));
        }
        for _ in 0..MOST_AT_ONCE {
            if self.ended {
                return Ok(if self.answers.are_complete(self.last.0) { Next::Finished } else { Next::Wait });
            }
            if self.next.is_none() {
                self.next = self.log.next_of()?;
            }
            let Some(Entry::Message { seq, stamp_ns, payload }) = &self.next else {
                self.end()?;
                continue;
            };
            let (seq, stamp_ns) = (*seq, *stamp_ns);
            self.first_ns.get_or_insert(stamp_ns);
            if let Position::Behind(answered) = self.position
                && seq <= answered
            {
                self.last = (seq, stamp_ns);
                self.next = None;
                continue;
            }
            self.position = Position::At;
            if let Some(wait) = self.pacing.hold_back(context.now_ns(), stamp_ns)? {
                return Ok(wait);
            }
            self.scans.send(seq, stamp_ns, payload)?;
            self.pacing.sent(seq);
            self.sent += 1;
            self.last = (seq, stamp_ns);
            self.next = None;
        }
        Ok(Next::Again)
    }

    fn end(&mut self) -> Result<(), StepError> {
        if !self.ended {
            self.scans.end(self.last.0, self.last.1)?;
            self.ended = true;
        }
        Ok(())
    }

    fn report(&self, context: &mut Context<'_>) {
        let (read, bytes) = self.log.position();
        let played_s = self.last.1.saturating_sub(self.first_ns.unwrap_or(self.last.1)) as f64 * 1e-9;
        let percent = 100.0 * read as f64 / bytes.max(1) as f64;
        let note = match (self.position, self.answers.silent()) {
            (Position::Unknown, Some(silent)) => format!("waits until {silent} says how far it is"),
            _ if self.ended => format!("{played_s:.1} s of the log, to its end"),
            _ => format!("{played_s:.1} s of the log, {percent:.0} % of it read"),
        };
        context.note(&note);
        context.count("scans played", self.sent);
    }
}

impl Pacing {
    /// How long the message with this stamp has to wait; `None` when it may be sent.
    fn hold_back(&mut self, now_ns: u64, stamp_ns: u64) -> Result<Option<Next>, StepError> {
        match self {
            Self::Lockstep(window) => Ok((!window.has_room()).then_some(Next::Wait)),
            Self::Live { schedule, checkpoint, speed } => {
                let schedule = match schedule {
                    Some(schedule) => *schedule,
                    None => {
                        let new = Schedule::new(now_ns, stamp_ns);
                        checkpoint.save(&new.to_bytes())?;
                        *schedule.insert(new)
                    }
                };
                let due_in_ns = schedule.due_in_ns(now_ns, stamp_ns);
                if due_in_ns == 0 {
                    return Ok(None);
                }
                let wall = Duration::from_nanos((due_in_ns as f64 / *speed) as u64);
                Ok(Some(Next::WaitAtMost(wall.max(SHORTEST_WAIT))))
            }
        }
    }

    fn sent(&mut self, seq: u64) {
        if let Self::Lockstep(window) = self {
            window.sent(seq);
        }
    }
}
