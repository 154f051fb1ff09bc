//! The process around SBS: frames from the bus, an answer to each onto it.

mod kept;
mod parameters;
mod remarks;

use bus::{BusError, FrameReader, FrameWriter, Received, Writer};
use messages::{CameraBackground, CameraFrame, CameraMask, CameraMotion, CameraStatus, FrameLayout, PixelFormat, Replay, StreamCursor};
use runtime::{Checkpoint, Context, Next, Process, RunError, Shell, StepError};
use settings::{BuiltIn, Pace, Settings};

use ::sbs::plane::Plane;
use ::sbs::transform::Transform;
use ::sbs::{Frame, Remark};

use kept::Kept;
pub(crate) use parameters::parameters;
use remarks::Remarks;

/// Frames between two background pictures: they are for people.
const BACKGROUND_FRAMES: u64 = 8;
/// Most frames worked on in one round, so that the heartbeat is never late.
const TAKEN_PER_ROUND: usize = 16;

/// How SBS ended that should not have.
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
    let mut subtraction = Subtraction::new(&mut shell, settings)?;
    shell.linger_until(settings.named(BuiltIn::Fti));
    Ok(shell.run(&mut subtraction)?)
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Counts {
    answered: u64,
    skipped: u64,
    refused: u64,
    not_compensated: u64,
    blobs: u64,
}

struct Subtraction {
    kept: Kept,
    frames: FrameReader<CameraFrame>,
    motions: Writer<CameraMotion>,
    masks: FrameWriter<CameraMask>,
    backgrounds: FrameWriter<CameraBackground>,
    checkpoint: Checkpoint,
    /// Last frame that the checkpoint includes.
    checkpointed: u64,
    /// The last checkpoint: the next one takes its memory.
    saved: Vec<u8>,
    lockstep: bool,
    counts: Counts,
    remarks: Remarks,
}

impl Process for Subtraction {
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError> {
        let mut next = Next::Again;
        for _ in 0..TAKEN_PER_ROUND {
            if !self.answer_next()? {
                next = if self.frames.ended() || context.stopping() { Next::Finished } else { Next::Wait };
                break;
            }
        }
        // Also what a checkpoint includes: who saved it may have been killed before it could say so.
        context.answered_frames::<CameraFrame>(self.kept.place.seq);
        if next == Next::Finished {
            self.finish()?;
        }
        self.report(context);
        Ok(next)
    }
}

impl Subtraction {
    fn new(shell: &mut Shell, settings: &Settings) -> Result<Self, BusError> {
        // A start of the deployment is no moment to go on with the background of another: the robot stands, and it is learnt anew.
        let checkpoint = shell.volatile_checkpoint();
        let kept = Kept::take_up(&checkpoint, parameters(settings));
        let mut frames = shell.frame_reader()?;
        frames.skip_to(kept.place.seq, kept.place.stamp_ns);
        if settings.pace == Pace::Live {
            frames.join();
        }
        let mut motions: Writer<CameraMotion> = shell.writer()?;
        kept.recent.republish(&mut motions)?;
        Ok(Self {
            checkpointed: kept.place.seq,
            kept,
            frames,
            motions,
            masks: shell.frame_writer()?,
            backgrounds: shell.frame_writer()?,
            checkpoint,
            saved: Vec::new(),
            lockstep: settings.pace == Pace::Lockstep,
            counts: Counts::default(),
            remarks: Remarks::default(),
        })
    }

    /// Answers the next frame; false when none waits.
    fn answer_next(&mut self) -> Result<bool, StepError> {
        let frame = self.next_frame()?;
        if let Some(refused) = self.frames.take_refused().filter(|refused| refused.seq > self.kept.place.seq) {
            let is_before = frame.as_ref().is_none_or(|frame| refused.seq < frame.seq());
            if is_before {
                // What follows must not seem to run backwards because this one does.
                let stamp_ns = refused.stamp_ns.max(self.kept.place.stamp_ns).min(frame.as_ref().map_or(u64::MAX, bus::Frame::stamp_ns));
                self.refuse(StreamCursor { seq: refused.seq, stamp_ns }, &refused.problem)?;
            }
        }
        let Some(frame) = frame else { return Ok(false) };
        self.answer(&frame)?;
        Ok(true)
    }

    /// The next frame, live the newest: what waits when a newer one is there is skipped and counted.
    fn next_frame(&mut self) -> Result<Option<bus::Frame<CameraFrame>>, BusError> {
        let mut newest = None;
        while let Some(received) = self.frames.take()? {
            let Received::Message(frame) = received else { break };
            self.counts.skipped += u64::from(newest.replace(frame).is_some());
            if self.lockstep {
                break;
            }
        }
        Ok(newest)
    }

    fn answer(&mut self, frame: &bus::Frame<CameraFrame>) -> Result<(), StepError> {
        let place = StreamCursor { seq: frame.seq(), stamp_ns: frame.stamp_ns() };
        let answer =
            self.kept.state.step(&Frame { stamp_ns: place.stamp_ns, layout: frame.layout(), bytes: frame.bytes(), odometry: None });
        if let Some(words) = self.remarks.answered(place.seq, &answer) {
            tracing::info!("{words}");
        }
        self.counts.refused += u64::from(matches!(answer.remark, Remark::Refused(_)));
        self.counts.not_compensated += u64::from(answer.motion.status == CameraStatus::NotCompensated as u32);
        self.counts.blobs += u64::from(answer.motion.count);
        self.send(place, answer.motion)?;
        self.show()?;
        if place.seq >= self.checkpointed + Replay::FRAMES.checkpoint || self.checkpoint.is_missing() {
            self.save()?;
        }
        Ok(())
    }

    /// Answers a frame whose shape or time cannot be meant.
    fn refuse(&mut self, place: StreamCursor, problem: &str) -> Result<(), StepError> {
        if let Some(words) = self.remarks.refused(place.seq, problem) {
            tracing::warn!("{words}");
        }
        let transform = Transform::identity().rows();
        let motion = CameraMotion { transform, status: CameraStatus::Refused as u32, ..CameraMotion::default() };
        self.counts.refused += 1;
        Ok(self.send(place, motion)?)
    }

    fn send(&mut self, place: StreamCursor, motion: CameraMotion) -> Result<(), BusError> {
        self.motions.send(place.seq, place.stamp_ns, &motion)?;
        self.counts.answered += 1;
        self.kept.answered(place, &motion);
        Ok(())
    }

    /// Sends pictures to whoever looks.
    fn show(&mut self) -> Result<(), BusError> {
        let StreamCursor { seq, stamp_ns } = self.kept.place;
        if self.masks.is_read()
            && let Some(mask) = self.kept.state.mask()
        {
            self.masks.send(seq, stamp_ns, grey(&mask), mask.values())?;
        }
        if seq.is_multiple_of(BACKGROUND_FRAMES)
            && self.backgrounds.is_read()
            && let Some(background) = self.kept.state.background()
        {
            self.backgrounds.send(seq, stamp_ns, grey(&background), background.values())?;
        }
        Ok(())
    }

    fn save(&mut self) -> Result<(), StepError> {
        self.saved.clear();
        self.kept.write_to(&mut self.saved);
        self.checkpoint.save(&self.saved);
        self.checkpointed = self.kept.place.seq;
        Ok(())
    }

    fn finish(&mut self) -> Result<(), StepError> {
        self.save()?;
        let StreamCursor { seq, stamp_ns } = self.kept.place;
        self.motions.end(seq, stamp_ns)?;
        self.masks.end(seq, stamp_ns)?;
        self.backgrounds.end(seq, stamp_ns)?;
        Ok(())
    }

    fn report(&self, context: &mut Context<'_>) {
        let Counts { answered, skipped, refused, not_compensated, blobs } = self.counts;
        context.count("frames answered", answered);
        context.count("frames skipped", skipped);
        context.count("frames refused", refused);
        context.count("frames not compensated", not_compensated);
        context.count("blobs", blobs);
        context.note(self.remarks.now());
    }
}

fn grey(plane: &Plane<u8>) -> FrameLayout {
    FrameLayout::packed(plane.width() as u32, plane.height() as u32, PixelFormat::Grey)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bus::Domain;

    /// What is worked on of five frames that wait, and how many are skipped.
    fn taken(pace: &str) -> (Vec<u64>, u64) {
        let domain = Domain::open(&format!("test-sbs-skip-{pace}-{}", std::process::id()), 1.0).unwrap();
        let mut source = Shell::join(domain.membership_for("source", 0, "x".as_ref())).unwrap();
        let mut shell = Shell::join(domain.membership_for("sbs", 0, "x".as_ref())).unwrap();
        let text = format!("name = \"x\"\npace = \"{pace}\"\n[[process]]\nname = \"p\"\nrun = \"playback\"\n");
        let settings = Settings::parse("x.toml", &text).unwrap();
        let mut subtraction = Subtraction::new(&mut shell, &settings).unwrap();
        let mut frames: FrameWriter<CameraFrame> = source.frame_writer().unwrap();
        let layout = FrameLayout::packed(80, 60, PixelFormat::Grey);
        for seq in 1..=5 {
            frames.send_with(seq, seq, layout, |bytes| bytes.fill(seq as u8)).unwrap();
        }
        frames.end(5, 5).unwrap();
        let mut taken = Vec::new();
        while let Some(frame) = subtraction.next_frame().unwrap() {
            taken.push(frame.seq());
        }
        assert!(subtraction.frames.ended());
        let skipped = subtraction.counts.skipped;
        drop((source, shell, subtraction, frames));
        domain.close().unwrap();
        (taken, skipped)
    }

    #[test]
    fn live_what_waits_behind_a_newer_frame_is_skipped_and_counted() {
        assert_eq!(taken("live"), (vec![5], 4));
    }

    #[test]
    fn in_lockstep_nothing_is_skipped() {
        assert_eq!(taken("lockstep"), (vec![1, 2, 3, 4, 5], 0));
    }
}
