//! The process `recorder`: from the bus to the log on the disk.

mod description;
mod inputs;

use ::recorder::{LogBuffer, LogFile};
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

/// Camera frames after which to flush in lockstep: half of those that playback sends ahead of the acknowledgements.
const FLUSH_FRAMES: u64 = 4;
/// Time between two attempts to write while writing fails.
const RETRY: Duration = Duration::from_secs(1);

/// Records until every other process of the run is over.
///
/// # Errors
/// When the bus fails or the log cannot be created.
pub(super) fn run(mut shell: Shell, settings: &Settings) -> Result<()> {
    let membership = shell.membership();
    let path = settings.out.join(settings.recorder.file.as_str());
    let file =
        LogFile::of_run(&path, membership.run()).map_err(|error| anyhow!("{}: the log cannot be created: {error}", path.display()))?;
    tracing::info!("recording into {}", file.path().display());
    let preamble = describe(membership.run(), settings)?;
    let buffer = LogBuffer::new(&preamble)?;
    let name = membership.process().to_owned();
    let checkpoint = shell.checkpoint();
    let written = checkpoint.restore(|saved| Ok::<_, Infallible>(PerStream::from_bytes(saved.state))).unwrap_or_default();
    let mut inputs = Inputs::open(&mut shell, settings.recorder.pictures)?;
    inputs.skip_to(written.scan, written.frame);
    let mut recorder = Recorder {
        inputs,
        buffer,
        preamble,
        first_path: path,
        file,
        checkpoint,
        name,
        others_are_over: false,
        flush_scans: u64::from(settings.playback.window.get() / 2).max(1),
        lockstep: settings.pace == Pace::Lockstep,
        unwritten: PerStream::default(),
        flush_every: Duration::from_secs_f64(settings.recorder.flush_s.get()),
        flushed_at: Instant::now(),
        last: written,
        written,
        acknowledged: None,
        write_error: None,
    };
    Ok(shell.run(&mut recorder)?)
}

/// A sequence number or a count for the scans, and one for the camera frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct PerStream {
    scan: u64,
    frame: u64,
}

impl PerStream {
    fn to_bytes(self) -> Vec<u8> {
        [self.scan.to_le_bytes(), self.frame.to_le_bytes()].concat()
    }

    /// Numbers that are missing are 0: playback then sends messages again that are in the log.
    fn from_bytes(bytes: &[u8]) -> Self {
        let (numbers, _) = bytes.as_chunks::<8>();
        let number = |at: usize| numbers.get(at).map_or(0, |bytes| u64::from_le_bytes(*bytes));
        Self { scan: number(0), frame: number(1) }
    }
}

struct Recorder {
    inputs: Inputs,
    buffer: LogBuffer,
    preamble: Preamble,
    /// Path of the first part of the log.
    first_path: PathBuf,
    file: LogFile,
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
    /// The last ones in the file.
    written: PerStream,
    /// The last ones that were acknowledged.
    acknowledged: Option<PerStream>,
    /// Why the last write failed, as it was logged.
    write_error: Option<String>,
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
    /// Receives what waits, up to a limit for each input; true when there may be more.
    fn take_inputs(&mut self) -> Result<bool, StepError> {
        let Self { inputs, buffer, name, others_are_over: over, .. } = self;
        let taken = inputs.take(buffer, |status| *over |= others_are_over(name, status))?;
        self.unwritten.scan += taken.scans;
        self.unwritten.frame += taken.frames;
        self.last.scan = self.last.scan.max(self.inputs.last_scan());
        self.last.frame = self.last.frame.max(self.inputs.last_frame().unwrap_or_default());
        Ok(taken.more)
    }

    fn flush_is_due(&self) -> bool {
        if self.buffer.is_blocked() {
            return self.flushed_at.elapsed() >= RETRY;
        }
        let frames_are_due = self.lockstep && self.unwritten.frame >= FLUSH_FRAMES;
        self.unwritten.scan >= self.flush_scans || frames_are_due || self.flushed_at.elapsed() >= self.flush_every
    }

    /// Writes what was recorded. After a failed write, and when the part is full, recording continues in a new part.
    fn flush(&mut self) -> Result<(), StepError> {
        self.flushed_at = Instant::now();
        let part_ends = self.buffer.is_blocked() || self.buffer.is_full();
        let result = if part_ends { self.begin_next_part()? } else { self.file.append(self.buffer.flush()?) };
        self.note_result(result);
        // Acknowledged whether or not the write succeeded: a full disk must not stop a run in lockstep.
        self.unwritten = PerStream::default();
        if self.written != self.last || self.checkpoint.is_missing() {
            self.written = self.last;
            // Without it a restarted recorder is sent messages again that are in the log.
            self.checkpoint.save(&self.written.to_bytes());
        }
        Ok(())
    }

    /// Writes the closed chunks, so that they do not wait in memory for the next flush.
    fn write_chunks(&mut self) {
        if !self.buffer.is_blocked() && !self.buffer.chunks().is_empty() {
            let result = self.file.append(self.buffer.chunks());
            self.note_result(result);
        }
    }

    /// Takes note of whether a write succeeded.
    fn note_result(&mut self, result: io::Result<()>) {
        match result {
            Ok(()) => {
                self.buffer.written();
                self.write_error = None;
            }
            Err(error) => {
                self.buffer.write_failed();
                self.log_write_error(&error);
            }
        }
    }

    /// Ends the part with what is not written and its index, and begins the next one.
    fn begin_next_part(&mut self) -> Result<io::Result<()>, StepError> {
        let was_blocked = self.buffer.is_blocked();
        if let Err(error) = self.file.append(self.buffer.finish()?) {
            return Ok(Err(error));
        }
        self.buffer.written();
        let mut buffer = self.buffer.next(&self.preamble)?;
        let created = LogFile::next(&self.first_path).and_then(|mut file| match file.append(buffer.flush().map_err(io::Error::other)?) {
            Ok(()) => Ok(file),
            // A part without its preamble would look like a damaged log.
            Err(error) => std::fs::remove_file(file.path()).and(Err(error)),
        });
        Ok(created.map(|file| {
            let path = file.path().display();
            if was_blocked {
                tracing::info!("recording resumed in {path}; {} messages were not recorded", buffer.dropped());
            } else {
                tracing::info!("recording continues in {path}");
            }
            (self.file, self.buffer) = (file, buffer);
        }))
    }

    fn log_write_error(&mut self, error: &io::Error) {
        let what = match error.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => "the disk is full",
            io::ErrorKind::FileTooLarge => "the log file has reached its size limit",
            _ => "the log cannot be written",
        };
        let cause = format!("{what}: {}: {error}", self.file.path().display());
        if self.write_error.as_ref() != Some(&cause) {
            tracing::error!("{cause}; messages are not recorded until a write succeeds");
            self.write_error = Some(cause);
        }
    }

    /// Ends the log with its index. On a full disk the index is lost; the log can be read without it.
    fn finish(&mut self) -> Result<(), StepError> {
        self.flush()?;
        if let Err(error) = self.file.append(self.buffer.finish()?) {
            self.log_write_error(&error);
        }
        tracing::info!("recorded {} bytes in {}", self.file.bytes(), self.file.path().display());
        Ok(())
    }

    fn report(&mut self, context: &mut Context<'_>) {
        if self.acknowledged != Some(self.written) {
            context.answered::<SonarScan>(self.written.scan);
            if self.inputs.last_frame().is_some() {
                context.answered_frames::<CameraFrame>(self.written.frame);
            }
            self.acknowledged = Some(self.written);
        }
        context.count("messages recorded", self.buffer.recorded());
        context.count("messages not recorded", self.buffer.dropped());
        context.count("bytes", self.file.bytes());
        context.note(self.write_error.as_deref().unwrap_or_default());
    }
}

/// Whether the run ends and every process but this one is over.
fn others_are_over(name: &str, status: &DeploymentStatus) -> bool {
    status.ending == 1 && status.processes().iter().filter(|it| it.process.as_str() != name).all(ProcessStatus::is_over)
}
