//! The process `recorder`: from the bus to the log on the disk.

mod description;
mod inputs;

use ::recorder::{Limits, RunLog, Written};
use anyhow::{Result, anyhow};
use description::describe;
use inputs::Inputs;
use messages::{CameraFrame, Counter, DeploymentStatus, Payload, Pictures, ProcessStatus, SonarScan};
use runtime::{Checkpoint, Context, Next, Shell, Snapshot, StepError};
use serde::{Deserialize, Serialize};
use settings::{Pace, Settings};
use state::{DecodeError, Schema, decode};
use std::io;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Camera frames after which to flush in lockstep: half of those that playback sends ahead of the acknowledgements.
const FLUSH_FRAMES: u64 = 4;
/// Time between two attempts to write while writing fails.
const RETRY: Duration = Duration::from_secs(1);
/// Time between two looks at whether the disk has taken the log.
const SYNC_POLL: Duration = Duration::from_millis(10);
/// Counter of messages that are not in the log.
pub(crate) const NOT_RECORDED: &str = Counter::NOT_RECORDED;
/// Counter of parts of the log that were removed, moved or truncated.
pub(crate) const PARTS_LOST: &str = Counter::PARTS_LOST;

/// Records until every other process of the run is over.
///
/// # Errors
/// When the bus fails or the log cannot be created.
pub(super) fn run(mut shell: Shell, settings: &Settings) -> Result<()> {
    let membership = shell.membership();
    let path = settings.out.join(settings.recorder.file.as_str());
    let preamble = describe(membership.run(), settings)?;
    let name = membership.process().to_owned();
    let checkpoint = shell.checkpoint();
    let RecorderState { last, log } = checkpoint.restore(RecorderState::from_snapshot).unwrap_or_default();
    let log = RunLog::open(&path, preamble, limits(&settings.recorder), log)
        .map_err(|error| anyhow!("{}: the log cannot be created: {error}", path.display()))?;
    tracing::info!("recording into {}", log.path().display());
    let mut inputs = Inputs::open(&mut shell, settings.recorder.pictures)?;
    inputs.skip_to(last.scan, last.frame);
    let mut recorder = Recorder {
        inputs,
        log,
        checkpoint,
        name,
        others_are_over: false,
        flush_scans: u64::from(settings.playback.window.get() / 2).max(1),
        lockstep: settings.pace == Pace::Lockstep,
        unwritten: PerStream::default(),
        flush_every: Duration::from_secs_f64(settings.recorder.flush_s.get()),
        flushed_at: Instant::now(),
        last,
        saved: RecorderState { last, log: Written::default() },
        acknowledged: None,
        written_ends: Vec::new(),
        syncing: None,
    };
    Ok(shell.run(&mut recorder)?)
}

fn limits(of: &settings::Recorder) -> Limits {
    let bytes = |mb: f64| (mb * 1e6) as u64;
    Limits { log_bytes: of.keep_mb.map(|most| bytes(most.get())), free_bytes: of.leave_free_mb.map(|least| bytes(least.get())) }
}

/// State that the next recorder of the run restores.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, Schema)]
struct RecorderState {
    /// The last messages in the log.
    last: PerStream,
    log: Written,
}

impl RecorderState {
    fn from_snapshot(snapshot: &Snapshot<'_>) -> Result<Self, DecodeError> {
        let mut saved: Self = decode(snapshot.state)?;
        if snapshot.before_a_stop {
            // Between two starts the user may have put the files elsewhere.
            saved.log = Written::default();
        }
        Ok(saved)
    }
}

/// A sequence number or a count for the scans, and one for the camera frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Schema)]
struct PerStream {
    scan: u64,
    frame: u64,
}

struct Recorder {
    inputs: Inputs,
    log: RunLog,
    checkpoint: Checkpoint,
    name: String,
    /// The run ends and every other process is over.
    others_are_over: bool,
    /// Scans after which to flush. In lockstep playback waits for scans that are not in the file.
    flush_scans: u64,
    lockstep: bool,
    /// Counts of what waits for the next flush.
    unwritten: PerStream,
    flush_every: Duration,
    flushed_at: Instant,
    /// The last ones received.
    last: PerStream,
    /// State at the last flush, as it was saved.
    saved: RecorderState,
    /// The last ones that were acknowledged.
    acknowledged: Option<PerStream>,
    /// The services whose end was taken before the last flush, and their last numbers.
    written_ends: Vec<(&'static str, u64)>,
    /// The log has ended, and the disk is taking it.
    syncing: Option<JoinHandle<io::Result<()>>>,
}

impl runtime::Process for Recorder {
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError> {
        let next = if self.syncing.is_some() { self.check_when_synced() } else { self.record(context.stopping())? };
        self.report(context);
        Ok(next)
    }
}

impl Recorder {
    /// Records what waits, and ends the log when it is complete.
    fn record(&mut self, stopping: bool) -> Result<Next, StepError> {
        let more_waits = self.take_inputs()?;
        if !more_waits && (stopping || self.others_are_over) {
            self.flush()?;
            self.syncing = Some(self.log.finish()?);
            self.save();
            return Ok(Next::Again);
        }
        if self.flush_is_due() {
            self.flush()?;
        } else {
            self.log.write_chunks()?;
        }
        Ok(if more_waits {
            Next::Again
        } else {
            Next::WaitAtMost(self.flush_every.saturating_sub(self.flushed_at.elapsed()).max(Duration::from_millis(1)))
        })
    }

    /// Checks the log once the disk has taken it.
    fn check_when_synced(&mut self) -> Next {
        match self.syncing.take() {
            Some(syncing) if !syncing.is_finished() => {
                self.syncing = Some(syncing);
                Next::WaitAtMost(SYNC_POLL)
            }
            syncing => {
                let synced = syncing.map(JoinHandle::join).unwrap_or(Ok(Ok(())));
                self.log.check(synced.unwrap_or_else(|_| Err(io::Error::other("the thread has failed"))));
                Next::Finished
            }
        }
    }

    /// Receives what waits, up to a limit for each input; true when there may be more.
    fn take_inputs(&mut self) -> Result<bool, StepError> {
        let Self { inputs, log, name, others_are_over: over, .. } = self;
        let taken = inputs.take(log.buffer(), |status| *over |= others_are_over(name, status))?;
        self.unwritten.scan += taken.scans;
        self.unwritten.frame += taken.frames;
        self.last.scan = self.last.scan.max(self.inputs.last_scan());
        self.last.frame = self.last.frame.max(self.inputs.last_frame().unwrap_or_default());
        Ok(taken.more)
    }

    fn flush_is_due(&self) -> bool {
        if self.log.is_blocked() {
            return self.flushed_at.elapsed() >= RETRY;
        }
        let frames_are_due = self.lockstep && self.unwritten.frame >= FLUSH_FRAMES;
        // Those who have ended stay until this is in the file.
        let an_end_is_due = self.inputs.ended().len() > self.written_ends.len();
        an_end_is_due || self.unwritten.scan >= self.flush_scans || frames_are_due || self.flushed_at.elapsed() >= self.flush_every
    }

    fn flush(&mut self) -> Result<(), StepError> {
        self.flushed_at = Instant::now();
        self.log.flush()?;
        self.unwritten = PerStream::default();
        self.written_ends = self.inputs.ended();
        self.save();
        Ok(())
    }

    /// Saves the state. Without it a restarted recorder receives messages again that are in the log.
    fn save(&mut self) {
        // Acknowledged whether or not the write succeeded: a full disk must not stop a run in lockstep.
        let saved = RecorderState { last: self.last, log: self.log.written() };
        if self.saved != saved || self.checkpoint.is_missing() {
            self.checkpoint.save_state(&saved);
            self.saved = saved;
        }
    }

    fn report(&mut self, context: &mut Context<'_>) {
        let last = self.saved.last;
        if self.acknowledged != Some(last) {
            context.answered::<SonarScan>(last.scan);
            if self.inputs.last_frame().is_some() {
                context.answered_frames::<CameraFrame>(last.frame);
            }
            self.acknowledged = Some(last);
        }
        for &(service, seq) in &self.written_ends {
            if ![SonarScan::SERVICE.name, CameraFrame::SERVICE.name].contains(&service) {
                context.answered_on(service, seq);
            }
        }
        context.count("messages recorded", self.log.recorded());
        context.count(NOT_RECORDED, self.log.not_recorded());
        context.count(PARTS_LOST, self.log.parts_missing());
        context.count("bytes", self.log.bytes());
        context.note(self.log.write_error().unwrap_or_default());
    }
}

/// Whether the run ends and every process but this one is over.
fn others_are_over(name: &str, status: &DeploymentStatus) -> bool {
    status.ending == 1 && status.processes().iter().filter(|it| it.process.as_str() != name).all(ProcessStatus::is_over)
}
