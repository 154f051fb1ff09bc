//! Playback as a process: from the log to the bus.

use std::time::Duration;

use bus::{BusError, Checkpoint, Context, Next, Reader, Received, RunError, Shell, StepError, Writer};
use drivelog::{Entry, Log, LogError};
use messages::{DeploymentStatus, Payload, PlaybackControl, ProcessState, Progress, SonarScan};
use settings::{BuiltIn, Pace, Program, Settings};

use crate::answers::{Answers, Consumer};
use crate::resume::{Resume, SPARE};
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
    let resume = load(&checkpoint);
    if restarted {
        tracing::info!("goes on behind scan {}", resume.begin_behind());
    }
    let window = settings.playback.window.get();
    let mut playback = Playback {
        log,
        next: None,
        begin_behind: resume.begin_behind(),
        assumed: resume.reserved,
        resume,
        checkpoint,
        scans: shell.writer()?,
        progress: shell.reader()?,
        statuses: shell.reader()?,
        control: shell.reader()?,
        paused: resume.schedule.is_some_and(|schedule| schedule.rate() <= 0.0),
        rate: resume.schedule.map_or(1.0, |schedule| schedule.rate()),
        answers: Answers::new(consumers(settings)),
        pacing: match settings.pace {
            Pace::Live => Pacing::Live { speed },
            Pace::Lockstep if restarted => Pacing::Lockstep { window: Window::new(window.min(SPARE)), size: window },
            Pace::Lockstep => Pacing::Lockstep { window: Window::new(window), size: window },
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
            Program::BuiltIn(BuiltIn::Mapping | BuiltIn::Std | BuiltIn::Fti) => true,
            Program::BuiltIn(BuiltIn::Recorder) => false,
            Program::BuiltIn(BuiltIn::Pioneer | BuiltIn::Simulator | BuiltIn::Playback | BuiltIn::Viewer) | Program::Command(_) => {
                return None;
            }
        };
        Some(Consumer { name: process.name.as_str().to_owned(), ends_itself })
    })
}

/// What an earlier incarnation left.
fn load(checkpoint: &Checkpoint) -> Resume {
    match checkpoint.load() {
        Ok(bytes) => bytes.as_deref().and_then(Resume::from_bytes).unwrap_or_default(),
        Err(error) => {
            tracing::warn!("{error}");
            Resume::default()
        }
    }
}

struct Playback {
    log: Log,
    /// The entry of the log that comes next.
    next: Option<Entry<SonarScan>>,
    /// Nobody lacks this message or one before it.
    begin_behind: u64,
    /// What a consumer has answered that has not said so.
    assumed: u64,
    resume: Resume,
    checkpoint: Checkpoint,
    scans: Writer<SonarScan>,
    progress: Reader<Progress>,
    statuses: Reader<DeploymentStatus>,
    control: Reader<PlaybackControl>,
    /// Somebody who watches has asked for it to stand still.
    paused: bool,
    /// Live: how many times faster than the deployment's clock the log goes.
    rate: f64,
    answers: Answers,
    pacing: Pacing,
    /// Stamp of the first message.
    first_ns: Option<u64>,
    /// Number and stamp of the last message sent.
    last: (u64, u64),
    sent: u64,
    ended: bool,
}

enum Pacing {
    Live { speed: f64 },
    Lockstep { window: Window, size: u32 },
}

impl bus::Process for Playback {
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError> {
        self.listen()?;
        self.obey(context)?;
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

    /// Takes what somebody who watches asks for.
    fn obey(&mut self, context: &Context<'_>) -> Result<(), StepError> {
        let mut asked = None;
        while let Some(received) = self.control.take()? {
            if let Received::Message(control) = received {
                asked = Some(*control);
            }
        }
        let Some(PlaybackControl { speed, paused, .. }) = asked else { return Ok(()) };
        self.paused = paused == 1;
        if let Pacing::Live { speed: clock } = &self.pacing {
            self.rate = speed / clock;
            let schedule = self.resume.schedule;
            self.resume.schedule = schedule.map(|it| it.paced(context.now_ns(), if paused == 1 { 0.0 } else { speed / clock }));
            self.checkpoint.save(&self.resume.to_bytes())?;
        }
        Ok(())
    }

    /// Sends what may be sent now.
    fn play(&mut self, context: &Context<'_>) -> Result<Next, StepError> {
        if let Pacing::Lockstep { window, size } = &mut self.pacing {
            if !self.answers.lack_one() {
                window.resize(*size);
            }
            // Without a consumer there is nobody to wait for.
            window.answered(self.answers.floor(self.assumed).unwrap_or(u64::MAX));
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
            if seq > self.begin_behind {
                if self.paused {
                    return Ok(Next::Wait);
                }
                let (schedule, is_new) = match self.resume.schedule {
                    Some(schedule) => (schedule, false),
                    None => (Schedule::new(context.now_ns(), stamp_ns).paced(context.now_ns(), self.rate), true),
                };
                if let Some(wait) = self.pacing.hold_back(schedule, context.now_ns(), stamp_ns) {
                    return Ok(wait);
                }
                self.resume.schedule = Some(schedule);
                if self.resume.reserve(seq) | is_new {
                    self.checkpoint.save(&self.resume.to_bytes())?;
                }
                self.scans.send(seq, stamp_ns, payload)?;
                self.pacing.sent(seq);
                self.sent += 1;
            }
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
        context.note(&format!("{played_s:.1} s of the log, {percent:.0} % of it read"));
        context.count("scans played", self.sent);
        context.count(PlaybackControl::PAUSED, u64::from(self.paused));
        if let Pacing::Live { speed } = &self.pacing {
            context.count(PlaybackControl::PERCENT, (100.0 * speed * self.rate).round() as u64);
        }
        context.count("done", read);
        context.count("total", bytes);
    }
}

impl Pacing {
    /// How long the message with this stamp has to wait; `None` when it may be sent.
    fn hold_back(&self, schedule: Schedule, now_ns: u64, stamp_ns: u64) -> Option<Next> {
        match self {
            Self::Lockstep { window, .. } => (!window.has_room()).then_some(Next::Wait),
            Self::Live { speed } => {
                let due_in_ns = schedule.due_in_ns(now_ns, stamp_ns);
                let wall = Duration::from_nanos((due_in_ns as f64 / speed) as u64);
                (due_in_ns > 0).then(|| Next::WaitAtMost(wall.max(SHORTEST_WAIT)))
            }
        }
    }

    fn sent(&mut self, seq: u64) {
        if let Self::Lockstep { window, .. } = self {
            window.sent(seq);
        }
    }
}
