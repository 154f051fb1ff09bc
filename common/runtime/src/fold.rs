//! The run loop of a process whose algorithm is a fold over a source stream.

use std::time::{Duration, Instant};

use messages::{Service, StreamCursor};

use crate::checkpoint::Checkpoint;
use crate::shell::{Context, Next, Process, RunError, Shell, StepError};

/// Most messages taken in one round: half of the lockstep window of scans, so that playback sends the other half meanwhile.
const TAKEN_PER_ROUND: usize = 128;

/// After so long without a message the state is saved. A stream's history is lost with its sender: what came since the last checkpoint
/// could not be sent again to processes that start together with their sources. Sources send every 0.1 s or so.
const IDLE: Duration = Duration::from_secs(1);

/// A process as a fold: messages in, state, messages out.
///
/// [`run_fold`] calls these methods; an implementation holds the inputs, the algorithm and the outputs. Restoring is the work of
/// its constructor: [`Checkpoint::restore`], then [`Reader::skip_to`](bus::Reader::skip_to) for each input and
/// [`Answers::new`](crate::Answers::new) for each stream of answers.
///
/// ```no_run
/// use bus::{Reader, Received};
/// use messages::{Payload, Service, SonarMotion, SonarScan, StreamCursor};
/// use stillmap_runtime::{Answers, Checkpoint, Context, Fold, Next, Recent, Shell, StepError, run_fold};
///
/// /// Reports of every scan that nothing moves.
/// struct Nothing {
///     scans: Reader<SonarScan>,
///     motions: Answers<SonarMotion>,
/// }
///
/// impl Fold for Nothing {
///     const SOURCE: Service = SonarScan::SERVICE;
///
///     fn take(&mut self) -> Result<bool, StepError> {
///         let Some(received) = self.scans.take()? else { return Ok(false) };
///         if let Received::Message(scan) = received {
///             self.motions.publish(scan.cursor(), &SonarMotion::default())?;
///         }
///         Ok(true)
///     }
///
///     fn received(&self) -> StreamCursor {
///         self.motions.last()
///     }
///
///     fn is_complete(&self) -> bool {
///         self.scans.ended()
///     }
///
///     fn save(&mut self, checkpoint: &mut Checkpoint) -> Result<(), StepError> {
///         checkpoint.save_state(self.motions.recent());
///         Ok(())
///     }
///
///     fn finish(&mut self, _: &Context<'_>) -> Result<Next, StepError> {
///         self.motions.end()?;
///         Ok(Next::Finished)
///     }
/// }
///
/// let mut shell = Shell::from_env()?;
/// let checkpoint = shell.checkpoint();
/// let recent: Recent<SonarMotion> = checkpoint.restore_state().unwrap_or_default();
/// let mut scans = shell.reader::<SonarScan>()?;
/// scans.skip_to(recent.last().seq, recent.last().stamp_ns);
/// let motions = Answers::new(&mut shell, recent)?;
/// run_fold(shell, checkpoint, &mut Nothing { scans, motions })?;
/// # Ok::<(), stillmap_runtime::RunError>(())
/// ```
pub trait Fold {
    /// The stream that the process answers. Its [`Replay`](messages::Replay) gives the interval of checkpoints.
    const SOURCE: Service;

    /// Takes a message of any input, if one waits, steps the algorithm and publishes what follows. Returns whether one waited.
    ///
    /// # Errors
    /// Anything that only a restart of the process can mend.
    fn take(&mut self) -> Result<bool, StepError>;

    /// The last message of the source that the state includes; all zero before the first.
    fn received(&self) -> StreamCursor;

    /// The number up to which every message of the source is answered. It counts what a checkpoint includes: the process that
    /// saved it may have been killed before it could report it.
    fn answered(&self) -> u64 {
        self.received().seq
    }

    /// Whether the state is to be saved now although the source does not ask for it: where another input is so frequent that its history
    /// does not reach back to the last checkpoint.
    fn must_save(&self) -> bool {
        false
    }

    /// Whether no input can come that the state still depends on.
    fn is_complete(&self) -> bool;

    /// Saves the state.
    ///
    /// # Errors
    /// When the state cannot be encoded. What the file system refuses is reported by the [`Checkpoint`].
    fn save(&mut self, checkpoint: &mut Checkpoint) -> Result<(), StepError>;

    /// Publishes what is due by time and not by message, once in a round. `more`: inputs still wait. Returns when it is to be
    /// called again; [`Next::Wait`] where nothing is due.
    ///
    /// # Errors
    /// As [`take`](Self::take).
    fn publish(&mut self, more: bool) -> Result<Next, StepError> {
        let _ = more;
        Ok(Next::Wait)
    }

    /// Decides what is pending: no more input is taken. The state was saved before, so that a restart resumes from there.
    ///
    /// # Errors
    /// As [`take`](Self::take).
    fn end(&mut self) -> Result<(), StepError> {
        Ok(())
    }

    /// Publishes the ends of the outputs and writes results, after [`end`](Self::end) and once nothing is left to
    /// [`publish`](Self::publish). Work that takes long returns [`Next::Again`] when [`Context::round_is_over`], and is called
    /// again until it returns [`Next::Finished`].
    ///
    /// # Errors
    /// As [`take`](Self::take).
    fn finish(&mut self, context: &Context<'_>) -> Result<Next, StepError>;

    /// Sets counters and note of the heartbeat, once in a round. `more`: inputs still wait.
    fn report(&mut self, context: &mut Context<'_>, more: bool) {
        let _ = (context, more);
    }
}

/// Runs a fold until its inputs have ended or the process is asked to stop.
///
/// A round takes messages until none waits or [`Context::round_is_over`]; then the heartbeat and the reports follow. The state is
/// saved after as many messages of the source as its replay allows, when none came for a while, and before the end.
///
/// # Errors
/// When a step fails, or the bus does.
pub fn run_fold<F: Fold>(shell: Shell, checkpoint: Checkpoint, fold: &mut F) -> Result<(), RunError> {
    let checkpointed = fold.received().seq;
    shell.run(&mut Folding { fold, checkpoint, checkpointed, taken: None, has_ended: false })
}

/// A fold in its run loop.
struct Folding<'a, F> {
    fold: &'a mut F,
    checkpoint: Checkpoint,
    /// Last message of the source that the checkpoint includes.
    checkpointed: u64,
    /// When the last message was taken that the checkpoint does not include.
    taken: Option<Instant>,
    has_ended: bool,
}

impl<F: Fold> Folding<'_, F> {
    const INTERVAL: u64 = match F::SOURCE.replay {
        Some(replay) => replay.checkpoint,
        None => panic!("the source of a fold is a stream that is played back"),
    };

    /// Takes what waits, for a round at most; returns whether there may be more.
    fn take_inputs(&mut self, context: &Context<'_>) -> Result<bool, StepError> {
        for _ in 0..TAKEN_PER_ROUND {
            if !self.fold.take()? {
                return Ok(false);
            }
            self.taken = Some(Instant::now());
            let is_due = self.fold.received().seq >= self.checkpointed + Self::INTERVAL || self.fold.must_save();
            if is_due || self.checkpoint.is_missing() {
                self.save()?;
            }
            if context.round_is_over() {
                break;
            }
        }
        Ok(true)
    }

    fn save(&mut self) -> Result<(), StepError> {
        self.fold.save(&mut self.checkpoint)?;
        self.checkpointed = self.fold.received().seq;
        self.taken = None;
        Ok(())
    }

    fn save_when_idle(&mut self) -> Result<(), StepError> {
        if self.taken.is_some_and(|taken| taken.elapsed() >= IDLE) { self.save() } else { Ok(()) }
    }
}

impl<F: Fold> Process for Folding<'_, F> {
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError> {
        let more = !self.has_ended && self.take_inputs(context)?;
        context.answered_on(F::SOURCE.name, self.fold.answered());
        if !self.has_ended && !more && (context.stopping() || self.fold.is_complete()) {
            self.save()?;
            self.fold.end()?;
            self.has_ended = true;
        }
        if !self.has_ended {
            self.save_when_idle()?;
        }
        self.fold.report(context, more);
        let next = self.fold.publish(more)?;
        match next {
            _ if more => Ok(Next::Again),
            Next::Wait if self.has_ended => self.fold.finish(context),
            next => Ok(next),
        }
    }
}
