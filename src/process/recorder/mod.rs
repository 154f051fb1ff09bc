//! The recorder as a process: from the bus to the disk.

mod description;
mod inputs;

use ::recorder::{LogFile, Tape};
use anyhow::{Result, anyhow};
use description::describe;
use drivelog::Preamble;
use inputs::Inputs;
use messages::{CameraFrame, DeploymentStatus, ProcessStatus, SonarScan};
use runtime::{Checkpoint, Context, Next, Shell, StepError};
use settings::{Pace, Settings};
use std::convert::Infallible;
use std::io;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Camera frames after which to flush in lockstep: half of what playback has on the way.
const HELD_FRAMES: u64 = 4;
/// Time until a file that refused is tried again.
const RETRY: Duration = Duration::from_secs(1);

/// Records until the run has ended.
///
/// # Errors
/// When the bus fails or the log cannot be begun.
pub(super) fn run(mut shell: Shell, settings: &Settings) -> Result<()> {
    let membership = shell.membership();
    let path = settings.out.join(settings.recorder.file.as_str());
    let file = LogFile::of_run(&path, membership.run()).map_err(|error| anyhow!("{}: the log cannot be made: {error}", path.display()))?;
    tracing::info!("recording into {}", file.path().display());
    let preamble = describe(membership.run(), settings)?;
    let tape = Tape::new(&preamble)?;
    let name = membership.process().to_owned();
    let checkpoint = shell.checkpoint();
    let safe = checkpoint.take_up(|saved| Ok::<_, Infallible>(Answered::from_bytes(saved.state))).unwrap_or_default();
    let mut inputs = Inputs::open(&mut shell, settings.recorder.pictures)?;
    inputs.skip_to(safe.scan, safe.frame);
    let mut recorder = Recorder {
        inputs,
        tape,
        preamble,
        first_path: path,
        file,
        checkpoint,
        name,
        others_are_over: false,
        hold: u64::from(settings.playback.window.get() / 2).max(1),
        lockstep: settings.pace == Pace::Lockstep,
        held: Answered::default(),
        flush_every: Duration::from_secs_f64(settings.recorder.flush_s.get()),
        flushed_at: Instant::now(),
        last: safe,
        safe,
        told: None,
        trouble: None,
    };
    Ok(shell.run(&mut recorder)?)
}

/// Scans and camera frames: numbers, or counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Answered {
    scan: u64,
    frame: u64,
}

impl Answered {
    fn to_bytes(self) -> Vec<u8> {
        [self.scan.to_le_bytes(), self.frame.to_le_bytes()].concat()
    }

    /// What cannot be read is 0: playback then sends more than is lacking.
    fn from_bytes(bytes: &[u8]) -> Self {
        let (numbers, _) = bytes.as_chunks::<8>();
        let number = |at: usize| numbers.get(at).map_or(0, |bytes| u64::from_le_bytes(*bytes));
        Self { scan: number(0), frame: number(1) }
    }
}

struct Recorder {
    inputs: Inputs,
    tape: Tape,
    preamble: Preamble,
    /// The first file of the log.
    first_path: PathBuf,
    file: LogFile,
    checkpoint: Checkpoint,
    name: String,
    /// The run ends, and whoever could still say something has said it.
    others_are_over: bool,
    /// Scans after which to flush: lockstep waits for what is not in the file.
    hold: u64,
    lockstep: bool,
    /// How many wait for the next flush.
    held: Answered,
    flush_every: Duration,
    flushed_at: Instant,
    /// The last ones taken.
    last: Answered,
    /// The last ones that are in the file.
    safe: Answered,
    /// The last ones that were said to be in the file.
    told: Option<Answered>,
    /// Why the file refuses, as it was last said.
    trouble: Option<String>,
}

impl runtime::Process for Recorder {
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError> {
        let more_waits = self.take_inputs()?;
        let at_end = !more_waits && (context.stopping() || self.others_are_over);
        if at_end {
            self.finish()?;
        } else if self.flush_is_due() {
            self.flush()?;
        } else {
            self.write_chunks();
        }
        self.report(context);
        Ok(if at_end {
            Next::Finished
        } else if more_waits {
            Next::Again
        } else {
            Next::WaitAtMost(self.flush_every.saturating_sub(self.flushed_at.elapsed()).max(Duration::from_millis(1)))
        })
    }
}

impl Recorder {
    /// Takes what waits, up to a share; true when there may be more.
    fn take_inputs(&mut self) -> Result<bool, StepError> {
        let Self { inputs, tape, name, others_are_over, .. } = self;
        let taken = inputs.take(tape, |status| *others_are_over |= is_alone(name, status))?;
        self.held.scan += taken.scans;
        self.held.frame += taken.frames;
        self.last.scan = self.last.scan.max(self.inputs.last_scan());
        self.last.frame = self.last.frame.max(self.inputs.last_frame().unwrap_or_default());
        Ok(taken.more)
    }

    fn flush_is_due(&self) -> bool {
        if self.tape.is_blocked() {
            return self.flushed_at.elapsed() >= RETRY;
        }
        let frames_are_due = self.lockstep && self.held.frame >= HELD_FRAMES;
        self.held.scan >= self.hold || frames_are_due || self.flushed_at.elapsed() >= self.flush_every
    }

    /// Brings what was recorded into the file. When that refuses, recording goes on in a new one once the disk takes it; when it
    /// is full, at once.
    fn flush(&mut self) -> Result<(), StepError> {
        self.flushed_at = Instant::now();
        let goes_on = self.tape.is_blocked() || self.tape.is_full();
        let written = if goes_on { self.go_on_in_a_new_file()? } else { self.file.append(self.tape.flush()?) };
        self.settle(written);
        // What the file refuses for good is not waited for.
        self.held = Answered::default();
        if self.safe != self.last {
            self.safe = self.last;
            // Without it a restarted recorder is sent more than it lacks.
            self.checkpoint.keep(&self.safe.to_bytes());
        }
        Ok(())
    }

    /// Brings the chunks that are closed into the file, so that memory does not hold all that comes until the next flush.
    fn write_chunks(&mut self) {
        if !self.tape.is_blocked() && !self.tape.chunks().is_empty() {
            let written = self.file.append(self.tape.chunks());
            self.settle(written);
        }
    }

    /// Takes note of whether the file has taken what it was given.
    fn settle(&mut self, written: io::Result<()>) {
        match written {
            Ok(()) => {
                self.tape.taken();
                self.trouble = None;
            }
            Err(error) => {
                self.tape.refused();
                self.say_trouble(&error);
            }
        }
    }

    /// Ends the file with what it lacks and its index, and begins the next part of the log.
    fn go_on_in_a_new_file(&mut self) -> Result<io::Result<()>, StepError> {
        let was_blocked = self.tape.is_blocked();
        if let Err(error) = self.file.append(self.tape.finish()?) {
            return Ok(Err(error));
        }
        self.tape.taken();
        let mut tape = self.tape.next(&self.preamble)?;
        let begun = LogFile::next(&self.first_path).and_then(|mut file| match file.append(tape.flush().map_err(io::Error::other)?) {
            Ok(()) => Ok(file),
            // A part without its beginning would be taken for a damaged log.
            Err(error) => std::fs::remove_file(file.path()).and(Err(error)),
        });
        Ok(begun.map(|file| {
            let path = file.path().display();
            if was_blocked {
                tracing::info!("recording again, into {path}; {} messages were not recorded", tape.left_out());
            } else {
                tracing::info!("recording goes on in {path}");
            }
            (self.file, self.tape) = (file, tape);
        }))
    }

    fn say_trouble(&mut self, error: &io::Error) {
        let what = match error.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => "the disk is full",
            io::ErrorKind::FileTooLarge => "the log may grow no further",
            _ => "the log cannot be written",
        };
        let trouble = format!("{what}: {}: {error}", self.file.path().display());
        if self.trouble.as_ref() != Some(&trouble) {
            tracing::error!("{trouble}; what comes is not recorded until it can be");
            self.trouble = Some(trouble);
        }
    }

    /// Ends the log with its index. What is lost when the disk is full is the index: the log can be read without.
    fn finish(&mut self) -> Result<(), StepError> {
        self.flush()?;
        if let Err(error) = self.file.append(self.tape.finish()?) {
            self.say_trouble(&error);
        }
        tracing::info!("recorded {} bytes in {}", self.file.bytes(), self.file.path().display());
        Ok(())
    }

    fn report(&mut self, context: &mut Context<'_>) {
        if self.told != Some(self.safe) {
            context.answered::<SonarScan>(self.safe.scan);
            if self.inputs.last_frame().is_some() {
                context.answered_frames::<CameraFrame>(self.safe.frame);
            }
            self.told = Some(self.safe);
        }
        context.count("messages recorded", self.tape.recorded());
        context.count("messages not recorded", self.tape.left_out());
        context.count("bytes", self.file.bytes());
        context.note(self.trouble.as_deref().unwrap_or_default());
    }
}

/// Whether the run ends and every process but this one is over.
fn is_alone(name: &str, status: &DeploymentStatus) -> bool {
    status.ending == 1 && status.processes().iter().filter(|it| it.process.as_str() != name).all(ProcessStatus::is_over)
}
