//! The process around SBS: frames in, an answer to each out.

mod parameters;
mod remarks;

use bus::{BusError, FrameReader, FrameWriter, Received};
use messages::{
    CameraBackground, CameraFrame, CameraMask, CameraMotion, CameraStatus, FrameLayout, Payload, Pictures, PixelFormat, Service,
    StreamCursor,
};
use runtime::{Answers, Checkpoint, Context, Fold, Next, Recent, RunError, Shell, StepError, run_fold};
use settings::{BuiltIn, Pace, Settings};
use state::{encode, take};

use ::sbs::plane::Plane;
use ::sbs::transform::Transform;
use ::sbs::{CheckpointError, Frame, Parameters, Remark, State};

pub(crate) use parameters::parameters;
use remarks::Remarks;

/// Frames between two background pictures, which are for display only.
const BACKGROUND_FRAMES: u64 = 8;

/// An error that ends SBS.
#[derive(Debug, thiserror::Error)]
pub enum SbsError {
    /// A service cannot be used.
    #[error("{0}")]
    Bus(#[from] BusError),
    /// The work loop failed.
    #[error("{0}")]
    Run(#[from] RunError),
}

/// Answers frames until they end or the process is asked to stop.
///
/// # Errors
/// When the bus fails.
pub fn run(mut shell: Shell, settings: &Settings) -> Result<(), SbsError> {
    // A new start of the deployment learns the background again: the robot stands, and the scene may have changed.
    let checkpoint = shell.volatile_checkpoint();
    let mut subtraction = Subtraction::new(&mut shell, &checkpoint, settings)?;
    shell.linger_until(settings.named(BuiltIn::Fti));
    shell.linger_until_recorded(settings.named(BuiltIn::Recorder), &[CameraMotion::SERVICE]);
    Ok(run_fold(shell, checkpoint, &mut subtraction)?)
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Counts {
    answered: u64,
    skipped: u64,
    refused: u64,
    not_compensated: u64,
    blobs: u64,
}

/// Counter of frames that were answered.
pub(crate) const FRAMES_ANSWERED: &str = "frames answered";
/// Counter of frames that were skipped because a newer one waited.
pub(crate) const FRAMES_SKIPPED: &str = "frames skipped";

/// Whether so many frames are skipped that the computer is too slow. A restart skips the frames that wait meanwhile, which are at most
/// those of the history: one percent of a drive of three minutes at 15 Hz.
pub(crate) fn are_many(skipped: u64, answered: u64) -> bool {
    skipped > CameraFrame::SERVICE.qos.history as u64 && skipped * 100 > skipped + answered
}

/// The frame to be answered next, and those before it that are skipped.
#[derive(Default)]
struct NextFrame {
    skipped: Vec<StreamCursor>,
    frame: Option<bus::Frame<CameraFrame>>,
}

struct Subtraction {
    state: State,
    frames: FrameReader<CameraFrame>,
    motions: Answers<CameraMotion>,
    masks: FrameWriter<CameraMask>,
    backgrounds: FrameWriter<CameraBackground>,
    /// Memory of the last checkpoint, which the next one reuses.
    buffer: Vec<u8>,
    lockstep: bool,
    counts: Counts,
    remarks: Remarks,
}

impl Fold for Subtraction {
    const SOURCE: Service = CameraFrame::SERVICE;

    fn take(&mut self) -> Result<bool, StepError> {
        let NextFrame { skipped, frame } = self.next_frame()?;
        let mut skipped = skipped.into_iter().peekable();
        let last = self.motions.last();
        if let Some(refused) = self.frames.take_refused().filter(|refused| refused.seq > last.seq)
            && frame.as_ref().is_none_or(|frame| refused.seq < frame.seq())
        {
            // The stamps of the answers must not run backwards because that of a refused frame does.
            while let Some(at) = skipped.next_if(|at| at.seq < refused.seq) {
                self.motions.skip(at)?;
            }
            let stamp_ns = refused.stamp_ns.max(last.stamp_ns).min(frame.as_ref().map_or(u64::MAX, bus::Frame::stamp_ns));
            self.refuse(StreamCursor { seq: refused.seq, stamp_ns }, &refused.problem)?;
        }
        skipped.try_for_each(|at| self.motions.skip(at))?;
        let Some(frame) = frame else { return Ok(false) };
        self.answer(&frame)?;
        Ok(true)
    }

    fn received(&self) -> StreamCursor {
        self.motions.last()
    }

    fn is_complete(&self) -> bool {
        self.frames.ended()
    }

    fn save(&mut self, checkpoint: &mut Checkpoint) -> Result<(), StepError> {
        let mut bytes = std::mem::take(&mut self.buffer);
        bytes.clear();
        self.buffer = self.state.save_to(encode(self.motions.recent(), bytes));
        checkpoint.save(&self.buffer);
        Ok(())
    }

    fn finish(&mut self, _: &Context<'_>) -> Result<Next, StepError> {
        let StreamCursor { seq, stamp_ns } = self.motions.last();
        self.motions.end()?;
        self.masks.end(seq, stamp_ns)?;
        self.backgrounds.end(seq, stamp_ns)?;
        Ok(Next::Finished)
    }

    fn report(&mut self, context: &mut Context<'_>, _: bool) {
        let Counts { answered, skipped, refused, not_compensated, blobs } = self.counts;
        context.count(FRAMES_ANSWERED, answered);
        context.count(FRAMES_SKIPPED, skipped);
        context.count("frames refused", refused);
        context.count("frames not compensated", not_compensated);
        context.count("blobs", blobs);
        if are_many(skipped, answered) {
            let too_slow = format!("this computer is too slow: {skipped} of {} pictures skipped", skipped + answered);
            context.note(&[&too_slow, self.remarks.now()].into_iter().filter(|words| !words.is_empty()).collect::<Vec<_>>().join("; "));
        } else {
            context.note(self.remarks.now());
        }
    }
}

impl Subtraction {
    fn new(shell: &mut Shell, checkpoint: &Checkpoint, settings: &Settings) -> Result<Self, BusError> {
        let parameters = parameters(settings);
        let restored = checkpoint.restore(|saved| restore(parameters.clone(), saved.state));
        let (state, recent) = restored.unwrap_or_else(|| (State::new(parameters), Recent::default()));
        let StreamCursor { seq, stamp_ns } = recent.last();
        if seq > 0 {
            tracing::info!("resumes after frame {seq}");
        }
        let mut frames = shell.frame_reader()?;
        frames.skip_to(seq, stamp_ns);
        if settings.pace == Pace::Live {
            frames.join();
        }
        Ok(Self {
            state,
            frames,
            motions: Answers::new(shell, recent)?,
            masks: shell.frame_writer()?,
            backgrounds: shell.frame_writer()?,
            buffer: Vec::new(),
            lockstep: settings.pace == Pace::Lockstep,
            counts: Counts::default(),
            remarks: Remarks::default(),
        })
    }

    /// The next frame; live the newest one: older frames that wait are skipped and counted.
    fn next_frame(&mut self) -> Result<NextFrame, BusError> {
        let mut next = NextFrame::default();
        while let Some(received) = self.frames.take()? {
            let Received::Message(frame) = received else { break };
            next.skipped.extend(next.frame.replace(frame).map(|older| older.cursor()));
            if self.lockstep {
                break;
            }
        }
        self.counts.skipped += next.skipped.len() as u64;
        Ok(next)
    }

    fn answer(&mut self, frame: &bus::Frame<CameraFrame>) -> Result<(), StepError> {
        let at = frame.cursor();
        let answer = self.state.step(&Frame { stamp_ns: at.stamp_ns, layout: frame.layout(), bytes: frame.bytes(), odometry: None });
        if let Some(remark) = self.remarks.answered(at.seq, &answer) {
            tracing::info!("{remark}");
        }
        self.counts.refused += u64::from(matches!(answer.remark, Remark::Refused(_)));
        self.counts.not_compensated += u64::from(answer.motion.status == CameraStatus::NotCompensated as u32);
        self.counts.blobs += u64::from(answer.motion.count);
        self.publish_answer(at, &answer.motion)?;
        Ok(self.publish_pictures(at)?)
    }

    /// Answers a frame whose shape or time is not valid.
    fn refuse(&mut self, at: StreamCursor, problem: &str) -> Result<(), StepError> {
        if let Some(remark) = self.remarks.refused(at.seq, problem) {
            tracing::warn!("{remark}");
        }
        let transform = Transform::identity().rows();
        let motion = CameraMotion { transform, status: CameraStatus::Refused as u32, ..CameraMotion::default() };
        self.counts.refused += 1;
        Ok(self.publish_answer(at, &motion)?)
    }

    fn publish_answer(&mut self, at: StreamCursor, motion: &CameraMotion) -> Result<(), BusError> {
        self.counts.answered += 1;
        self.motions.publish(at, motion)
    }

    /// Publishes mask and background where a process reads them.
    fn publish_pictures(&mut self, StreamCursor { seq, stamp_ns }: StreamCursor) -> Result<(), BusError> {
        if self.masks.is_read()
            && let Some(mask) = self.state.mask()
        {
            self.masks.send(seq, stamp_ns, grey(&mask), mask.values())?;
        }
        if seq.is_multiple_of(BACKGROUND_FRAMES)
            && self.backgrounds.is_read()
            && let Some(background) = self.state.background()
        {
            self.backgrounds.send(seq, stamp_ns, grey(&background), background.values())?;
        }
        Ok(())
    }
}

fn restore(parameters: Parameters, bytes: &[u8]) -> Result<(State, Recent<CameraMotion>), CheckpointError> {
    let (recent, state) = take(bytes)?;
    Ok((State::restore(parameters, state)?, recent))
}

fn grey(plane: &Plane<u8>) -> FrameLayout {
    FrameLayout::packed(plane.width() as u32, plane.height() as u32, PixelFormat::Grey)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bus::Domain;

    /// The frames that are answered of five that wait, and the number of frames that are skipped. Readers of the answers miss nothing.
    fn taken(pace: &str) -> (Vec<u64>, u64) {
        let domain = Domain::open(&format!("test-sbs-skip-{pace}-{}", std::process::id()), 1.0).unwrap();
        let mut source = Shell::join(domain.membership_for("source", 0, "x".as_ref())).unwrap();
        let mut shell = Shell::join(domain.membership_for("sbs", 0, "x".as_ref())).unwrap();
        let text = format!("name = \"x\"\npace = \"{pace}\"\n[[process]]\nname = \"p\"\nrun = \"playback\"\n");
        let settings = Settings::parse("x.toml", &text).unwrap();
        let checkpoint = shell.volatile_checkpoint();
        let mut subtraction = Subtraction::new(&mut shell, &checkpoint, &settings).unwrap();
        let mut frames: FrameWriter<CameraFrame> = source.frame_writer().unwrap();
        let layout = FrameLayout::packed(80, 60, PixelFormat::Grey);
        for seq in 1..=5 {
            frames.send_with(seq, seq, layout, |bytes| bytes.fill(seq as u8)).unwrap();
        }
        frames.end(5, 5).unwrap();
        let mut answers = source.reader::<CameraMotion>().unwrap();
        while subtraction.take().unwrap() {}
        let mut taken = Vec::new();
        while let Some(Received::Message(answer)) = answers.take().unwrap() {
            assert_eq!(answer.lost_before(), 0);
            taken.push(answer.seq());
        }
        assert!(subtraction.frames.ended());
        let skipped = subtraction.counts.skipped;
        drop((source, shell, subtraction, frames, answers));
        domain.close().unwrap();
        (taken, skipped)
    }

    #[test]
    fn live_a_frame_behind_a_newer_one_is_skipped_and_counted() {
        assert_eq!(taken("live"), (vec![5], 4));
    }

    #[test]
    fn in_lockstep_no_frame_is_skipped() {
        assert_eq!(taken("lockstep"), (vec![1, 2, 3, 4, 5], 0));
    }
}
