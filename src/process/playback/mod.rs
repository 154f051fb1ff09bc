//! Playback as a process: from the log to the bus.

mod lane;

use std::time::{Duration, Instant};

use ::playback::{Answers, Behind, Consumer, Resume, STREAMS, Schedule, Turn, turn};
use anyhow::Result;
use bus::{Reader, Received};
use drivelog::{Gaps, Log, LogError, LogVisitor, Logged, Span, visit_logged};
use lane::{Cursor, Images, Lane, Limit, Messages, Source};
use messages::{CameraFrame, CameraMotion, DeploymentStatus, Payload, Pictures, PlaybackControl, Progress, Replay, Service, SonarScan};
use runtime::{Checkpoint, Context, Next, Shell, StepError};
use settings::{BuiltIn, LogTime, Pace, Program, Settings};

/// Most entries of the log looked at in one step: the heartbeat must not wait for a long log.
const MOST_AT_ONCE: usize = 1024;
/// A consumer that has not answered for this long is named.
const LONG_WAIT: Duration = Duration::from_secs(10);
/// Shortest wait for a due time: what is due sooner is sent slightly late, which avoids spinning.
const SHORTEST_WAIT: Duration = Duration::from_millis(1);
/// Counter of parts that the log lacks.
pub(crate) const PARTS_MISSING: &str = "log parts missing";
/// Counter of scans that the log lacks.
pub(crate) const SCANS_MISSING: &str = "scans missing";
/// Counter of pictures that the log lacks.
pub(crate) const FRAMES_MISSING: &str = "frames missing";

/// Plays the log of the settings to its end.
///
/// # Errors
/// When the log cannot be read or the bus fails.
pub(super) fn run(mut shell: Shell, settings: &Settings) -> Result<()> {
    let log = open(&settings.playback)?;
    tracing::info!("playing {}: {}", settings.playback.log.display(), log.preamble().origin);
    let membership = shell.membership();
    let (speed, restarted) = (membership.speed(), membership.incarnation() > 0);
    let checkpoint = shell.checkpoint();
    let resume = checkpoint.restore(|saved| Resume::from_bytes(saved.state).ok_or("it is cut")).unwrap_or_default();
    let kinds = [BuiltIn::Mapping, BuiltIn::Std, BuiltIn::Sbs, BuiltIn::Fti, BuiltIn::Localisation];
    shell.linger_as_source_until(kinds.into_iter().flat_map(|kind| settings.named(kind)));
    if restarted {
        tracing::info!("resumes after scan {}", resume.begin_behind[0]);
    }
    let mut playback = Playback {
        lanes: lanes(&mut shell, settings, &resume, restarted)?,
        checkpoint,
        progress: shell.reader()?,
        statuses: shell.reader()?,
        control: shell.reader()?,
        paused: resume.schedule.is_some_and(|schedule| schedule.rate() <= 0.0),
        rate: resume.schedule.map_or(1.0, |schedule| schedule.rate()),
        resume,
        live_speed: (settings.pace == Pace::Live).then_some(speed),
        first_ns: None,
        blocked: None,
        waits_for: None,
        gaps: None,
    };
    Ok(shell.run(&mut playback)?)
}

/// The log that is played, of whose streams the span of the settings is found.
///
/// # Errors
/// As [`Log::open`].
pub(crate) fn open(playback: &settings::Playback) -> Result<Log, LogError> {
    let ns = |time: LogTime| Duration::from_secs_f64(time.get()).as_nanos() as u64;
    let span = Span { from_ns: ns(playback.from_s), to_ns: playback.to_s.map(ns) };
    Ok(Log::open(&playback.log)?.within(span))
}

/// The streams of the registry that are played. Each reads the log by itself: messages that were recorded together need not be in
/// the order of sensor time.
fn lanes(shell: &mut Shell, settings: &Settings, resume: &Resume, restarted: bool) -> Result<Vec<Lane>> {
    let mut opening = Opening { shell, settings, resume, restarted, lanes: Vec::new() };
    visit_logged(&mut opening)?;
    Ok(opening.lanes)
}

/// Opens a lane for every service that is played.
struct Opening<'a> {
    shell: &'a mut Shell,
    settings: &'a Settings,
    resume: &'a Resume,
    restarted: bool,
    lanes: Vec<Lane>,
}

impl Opening<'_> {
    /// Where the log is read for a service; `None` if the service is not played.
    fn cursor<T>(&self, service: &Service) -> Result<Option<Cursor<T>>> {
        // SBS detects the camera motion again in the pictures.
        let is_made_again = service.name == CameraMotion::SERVICE.name && !self.settings.playback.camera_motion;
        Ok(if service.replay.is_some() && !is_made_again { Some(Cursor::new(open(&self.settings.playback)?)) } else { None })
    }

    fn limits(&self, service: &Service, window: u32, lead: u32) -> Vec<Limit> {
        let (lockstep, lead) = (self.settings.pace == Pace::Lockstep, self.restarted.then_some(lead));
        let limit = |consumers, size| Limit::new(Answers::new(consumers), size, lead, lockstep);
        let mut limits = vec![limit(consumers(self.settings, service.name), window)];
        if service.name == CameraFrame::SERVICE.name {
            // The numbers of the motions are those of the pictures.
            limits.push(limit(consumers(self.settings, CameraMotion::SERVICE.name), PICTURES_AHEAD_OF_FTI));
        }
        limits
    }

    /// Adds a lane in which lockstep sends at most `window` messages ahead of the slowest consumer.
    fn add(&mut self, source: Box<dyn Source>, service: &Service, window: u32) {
        let streams = STREAMS.iter().zip(self.resume.begin_behind).zip(self.resume.reserved);
        let Some((stream, ((of, begin_behind), assumed))) = streams.enumerate().find(|(_, ((of, _), _))| of.service == service.name) else {
            return;
        };
        self.lanes.push(Lane {
            source,
            stream,
            service: service.name,
            begin_behind,
            assumed,
            limits: self.limits(service, window, of.replay.lead),
            last: (0, 0),
            sent: 0,
            ended: false,
        });
    }
}

impl LogVisitor for Opening<'_> {
    type Error = anyhow::Error;

    fn message<T: Logged>(&mut self) -> Result<()> {
        if let Some(cursor) = self.cursor(&T::SERVICE)? {
            let source = Messages::<T> { cursor, writer: self.shell.writer()? };
            self.add(Box::new(source), &T::SERVICE, self.settings.playback.window.get());
        }
        Ok(())
    }

    fn pictures<P: Pictures>(&mut self) -> Result<()> {
        if let Some((cursor, replay)) = self.cursor(&P::SERVICE)?.zip(P::SERVICE.replay) {
            let source = Images::<P> { cursor, writer: self.shell.frame_writer()? };
            self.add(Box::new(source), &P::SERVICE, replay.window);
        }
        Ok(())
    }
}

/// Pictures that lockstep sends ahead of FTI, which reads their answers. A killed FTI lacks the answers to those, and to the ones since
/// its last checkpoint: together they are less than the history of the answers holds.
const PICTURES_AHEAD_OF_FTI: u32 = CameraMotion::SERVICE.qos.history as u32 - Replay::SCANS.checkpoint as u32 - 1;

/// The processes of the deployment that consume a stream. Commands are left out: they need not report what they have answered.
fn consumers(settings: &Settings, service: &str) -> Vec<Consumer> {
    let consumer = |process: &settings::Process| match process.program {
        Program::BuiltIn(kind) => consumer(kind, process.name.as_str(), service, settings),
        Program::Command(_) => None,
    };
    settings.process.iter().filter_map(consumer).collect()
}

/// A process as a consumer of a stream; `None` if it is none.
fn consumer(kind: BuiltIn, name: &str, service: &str, settings: &Settings) -> Option<Consumer> {
    let [scans, frames, motions] = [SonarScan::SERVICE.name, CameraFrame::SERVICE.name, CameraMotion::SERVICE.name];
    // Others are waited for in turn: STD and SBS by FTI, FTI and localisation by mapping.
    let depth = match kind {
        BuiltIn::Fti => 1,
        BuiltIn::Mapping => 2,
        _ => 0,
    };
    let ends_itself = kind != BuiltIn::Recorder;
    let of = |reports_on| Some(Consumer { name: name.to_owned(), ends_itself, depth, reports_on });
    match kind {
        BuiltIn::Mapping | BuiltIn::Std | BuiltIn::Fti | BuiltIn::Localisation if service == scans => of(scans),
        BuiltIn::Fti if service == motions && settings.expects_camera_motion() => of(motions),
        BuiltIn::Sbs if service == frames => of(frames),
        BuiltIn::Recorder if service == scans => of(scans),
        BuiltIn::Recorder if service == frames && settings.recorder.pictures => of(frames),
        _ => None,
    }
}

struct Playback {
    lanes: Vec<Lane>,
    resume: Resume,
    checkpoint: Checkpoint,
    progress: Reader<Progress>,
    statuses: Reader<DeploymentStatus>,
    control: Reader<PlaybackControl>,
    /// A viewer has paused it.
    paused: bool,
    /// Live: speed of the log relative to the deployment's clock.
    rate: f64,
    /// Deployment seconds per second of real time; `None` in lockstep.
    live_speed: Option<f64>,
    /// Stamp of the first message.
    first_ns: Option<u64>,
    /// Lockstep: since when nothing may be sent, and how much was sent before.
    blocked: Option<(Instant, u64)>,
    /// The consumer that it has waited for long, in words.
    waits_for: Option<String>,
    /// What the log lacks, once it has been read to its end.
    gaps: Option<Gaps>,
}

impl runtime::Process for Playback {
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError> {
        self.take_reports()?;
        self.take_requests(context)?;
        if context.stopping() {
            self.lanes.iter_mut().try_for_each(Lane::end)?;
            return Ok(Next::Finished);
        }
        let next = self.play(context)?;
        self.watch();
        self.look_for_gaps();
        self.report(context);
        Ok(next)
    }
}

impl Playback {
    /// Takes the reports of the consumers and the supervisor.
    fn take_reports(&mut self) -> Result<(), StepError> {
        while let Some(received) = self.progress.take()? {
            if let Received::Message(progress) = received {
                let Progress { process, service, answered } = &*progress;
                let answers = self.lanes.iter_mut().flat_map(Lane::answers);
                answers.for_each(|answers| answers.answered(process.as_str(), service.as_str(), *answered));
            }
        }
        while let Some(received) = self.statuses.take()? {
            if let Received::Message(status) = received {
                for process in status.processes().iter().filter(|it| it.is_over()) {
                    self.lanes.iter_mut().flat_map(Lane::answers).for_each(|answers| answers.over(process.process.as_str()));
                }
            }
        }
        Ok(())
    }

    /// Takes the requests of a viewer.
    fn take_requests(&mut self, context: &Context<'_>) -> Result<(), StepError> {
        let mut asked = None;
        while let Some(received) = self.control.take()? {
            if let Received::Message(control) = received {
                asked = Some(*control);
            }
        }
        let Some(PlaybackControl { speed, paused, .. }) = asked else { return Ok(()) };
        self.paused = paused == 1;
        if let Some(clock) = self.live_speed {
            self.rate = speed / clock;
            let schedule = self.resume.schedule;
            self.resume.schedule = schedule.map(|it| it.paced(context.now_ns(), if paused == 1 { 0.0 } else { speed / clock }));
            self.checkpoint.save(&self.resume.to_bytes());
        }
        Ok(())
    }

    /// Sends what may be sent now.
    fn play(&mut self, context: &Context<'_>) -> Result<Next, StepError> {
        self.lanes.iter_mut().for_each(Lane::heed_answers);
        for _ in 0..MOST_AT_ONCE {
            for lane in &mut self.lanes {
                if !lane.search(&|| context.round_is_over())? {
                    return Ok(Next::Again);
                }
            }
            let heads = self.lanes.iter_mut().map(Lane::head).collect::<Result<Vec<_>, StepError>>()?;
            let lane = match turn(&heads) {
                Turn::Of(lane) => lane,
                Turn::Hold => return Ok(Next::Wait),
                Turn::Over => {
                    let is_complete = self.lanes.iter().all(Lane::is_complete);
                    return Ok(if is_complete { Next::Finished } else { Next::Wait });
                }
            };
            let Some(lane) = self.lanes.get_mut(lane) else { continue };
            let Some((seq, stamp_ns)) = lane.source.peek() else { continue };
            self.first_ns.get_or_insert(stamp_ns);
            if seq <= lane.begin_behind {
                lane.pass_over(seq, stamp_ns)?;
                continue;
            }
            if self.paused {
                return Ok(Next::Wait);
            }
            let (schedule, is_new) = match self.resume.schedule {
                Some(schedule) => (schedule, false),
                None => (Schedule::new(context.now_ns(), stamp_ns).paced(context.now_ns(), self.rate), true),
            };
            if let Some(wait) = hold_back(self.live_speed, schedule, context.now_ns(), stamp_ns) {
                return Ok(wait);
            }
            self.resume.schedule = Some(schedule);
            if self.resume.reserve(lane.stream, seq) | is_new | self.checkpoint.is_missing() {
                self.checkpoint.save(&self.resume.to_bytes());
            }
            lane.send(seq, stamp_ns)?;
        }
        Ok(Next::Again)
    }

    /// Names the consumer that keeps the others waiting when that takes long.
    fn watch(&mut self) {
        let sent = self.lanes.iter().map(|lane| lane.sent).sum();
        let behind = self.lanes.iter().filter_map(|lane| Some((lane.behind()?, lane)));
        let Some((Behind { name, answered, .. }, lane)) = behind.min_by_key(|(behind, _)| *behind).filter(|_| !self.paused) else {
            (self.blocked, self.waits_for) = (None, None);
            return;
        };
        match self.blocked {
            Some((since, before)) if before == sent => {
                if since.elapsed() >= LONG_WAIT && self.waits_for.is_none() {
                    let words = format!("waits for {name}, which has answered {} up to {answered} of {}", lane.service, lane.last.0);
                    tracing::warn!("{words}");
                    self.waits_for = Some(words);
                }
            }
            _ => (self.blocked, self.waits_for) = (Some((Instant::now(), sent)), None),
        }
    }

    /// Names what the log lacks, at its end.
    fn look_for_gaps(&mut self) {
        let of_scans = |lane: &&Lane| lane.service == SonarScan::SERVICE.name && lane.ended;
        let Some(scans) = self.lanes.iter().find(of_scans).filter(|_| self.gaps.is_none()) else { return };
        let gaps = scans.source.gaps();
        for gap in gaps.lines() {
            tracing::warn!("missing in the log: {gap}");
        }
        self.gaps = Some(gaps);
    }

    fn report(&self, context: &mut Context<'_>) {
        if let Some(gaps) = &self.gaps {
            let missing = |service: &str| gaps.messages.get(service).map_or(0, |missing| missing.messages);
            context.count(PARTS_MISSING, gaps.missing_parts());
            context.count(SCANS_MISSING, missing(SonarScan::SERVICE.name));
            context.count(FRAMES_MISSING, missing(CameraFrame::SERVICE.name));
        }
        let last_ns = self.lanes.iter().map(|lane| lane.last.1).max().unwrap_or_default();
        let played_s = last_ns.saturating_sub(self.first_ns.unwrap_or(last_ns)) as f64 * 1e-9;
        let positions = self.lanes.iter().filter(|lane| !lane.ended).map(|lane| lane.source.position());
        let at_end = || self.lanes.first().map_or((0, 0), |lane| lane.source.position());
        let (read, bytes) = positions.min().unwrap_or_else(at_end);
        let percent = 100.0 * read as f64 / bytes.max(1) as f64;
        let so_far = format!("{played_s:.1} s of the log, {percent:.0} % of it read");
        context.note(&self.waits_for.as_ref().map_or_else(|| so_far.clone(), |waits_for| format!("{waits_for}; {so_far}")));
        for lane in self.lanes.iter().filter(|lane| lane.sent > 0) {
            context.count(&format!("{} played", lane.service), lane.sent);
        }
        context.count(PlaybackControl::PAUSED, u64::from(self.paused));
        if let Some(speed) = self.live_speed {
            context.count(PlaybackControl::PERCENT, (100.0 * speed * self.rate).round() as u64);
        }
        context.count("done", read);
        context.count("total", bytes);
    }
}

/// Live: how long the message with this stamp has to wait; `None` when it may be sent.
fn hold_back(live_speed: Option<f64>, schedule: Schedule, now_ns: u64, stamp_ns: u64) -> Option<Next> {
    let speed = live_speed?;
    let due_in_ns = schedule.due_in_ns(now_ns, stamp_ns);
    let wall = Duration::from_nanos((due_in_ns as f64 / speed) as u64);
    (due_in_ns > 0).then(|| Next::WaitAtMost(wall.max(SHORTEST_WAIT)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fti_lacks_after_a_kill_is_in_the_history() {
        let process = |name: &str| format!("[[process]]\nname = \"{name}\"\nrun = \"{name}\"\n");
        let text = format!("name = \"x\"\n{}", ["std", "sbs", "fti", "playback"].map(process).concat());
        let settings = Settings::parse("x.toml", &text).unwrap();
        let [consumer] = consumers(&settings, CameraMotion::SERVICE.name).try_into().unwrap();
        assert_eq!((consumer.name.as_str(), consumer.reports_on), ("fti", CameraMotion::SERVICE.name));
        for ahead in [PICTURES_AHEAD_OF_FTI, Replay::SCANS.window] {
            assert!(u64::from(ahead) + Replay::SCANS.checkpoint < CameraMotion::SERVICE.qos.history as u64);
        }
    }
}
