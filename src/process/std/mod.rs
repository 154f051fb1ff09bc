//! The process around STD: scans from the bus, an answer to each onto it.

mod parameters;

use bus::{BusError, Reader, Received, Recent, Writer};
use messages::{Replay, SonarMotion, SonarScan, StreamCursor};
use runtime::{Checkpoint, Context, Next, Process, RunError, Shell, StepError};
use settings::{BuiltIn, Settings};
use stillmap_std::{Parameters, ParametersError, StateError, Std};

pub(crate) use parameters::parameters;

/// Most scans taken in one round, so that the heartbeat is never late.
const TAKEN_PER_ROUND: usize = 128;

/// How STD ended that should not have.
#[derive(Debug, thiserror::Error)]
pub enum StdError {
    /// The settings make no STD.
    #[error("[std]: {0}")]
    Parameters(#[from] ParametersError),
    /// A service cannot be used.
    #[error("{0}")]
    Bus(#[from] BusError),
    /// The work loop failed.
    #[error("{0}")]
    Run(#[from] RunError),
}

/// Answers scans until they end or the process is asked to stop.
///
/// # Errors
/// Settings that make no STD, or a bus that fails.
pub fn run(mut shell: Shell, settings: &Settings) -> Result<(), StdError> {
    let parameters = parameters(settings);
    let checkpoint = shell.checkpoint();
    let restored = checkpoint.restore(|saved| restore(parameters, saved.state));
    let (std, place, recent) = match restored {
        Some(restored) => restored,
        None => (Std::new(parameters)?, StreamCursor::default(), Recent::default()),
    };
    if place.seq > 0 {
        tracing::info!("goes on after scan {}", place.seq);
    }
    let mut scans = shell.reader::<SonarScan>()?;
    scans.skip_to(place.seq, place.stamp_ns);
    let mut motions = shell.writer()?;
    recent.republish(&mut motions)?;
    shell.linger_until(settings.named(BuiltIn::Fti));
    Ok(shell.run(&mut Difference {
        std,
        scans,
        motions,
        recent,
        checkpoint,
        place,
        checkpointed: place.seq,
        moving_scans: 0,
        movers: 0,
    })?)
}

struct Difference {
    std: Std,
    scans: Reader<SonarScan>,
    motions: Writer<SonarMotion>,
    recent: Recent<SonarMotion>,
    checkpoint: Checkpoint,
    /// The last scan that was answered.
    place: StreamCursor,
    /// Last scan that the checkpoint includes.
    checkpointed: u64,
    moving_scans: u64,
    movers: u64,
}

impl Process for Difference {
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError> {
        let mut next = Next::Again;
        for _ in 0..TAKEN_PER_ROUND {
            match self.scans.take()? {
                None => {
                    next = Next::Wait;
                    break;
                }
                Some(Received::Message(scan)) => {
                    self.place = StreamCursor { seq: scan.seq(), stamp_ns: scan.stamp_ns() };
                    self.answer(&scan)?;
                }
                Some(Received::End { .. }) => {
                    next = Next::Finished;
                    break;
                }
            }
        }
        // Also what a checkpoint includes: who saved it may have been killed before it could say so.
        context.answered::<SonarScan>(self.place.seq);
        context.count("scans with movers", self.moving_scans);
        context.count("movers", self.movers);
        context.count("tracks", self.std.tracks().len() as u64);
        if context.stopping() && next == Next::Wait {
            next = Next::Finished;
        }
        if next == Next::Finished {
            self.save()?;
            self.motions.end(self.place.seq, self.place.stamp_ns)?;
        }
        Ok(next)
    }
}

impl Difference {
    fn answer(&mut self, scan: &SonarScan) -> Result<(), StepError> {
        let StreamCursor { seq, stamp_ns } = self.place;
        let motion = self.std.step(stamp_ns, scan);
        self.moving_scans += u64::from(motion.count > 0);
        self.movers += u64::from(motion.count);
        self.recent.note(seq, stamp_ns, &motion);
        self.motions.send(seq, stamp_ns, &motion)?;
        if seq >= self.checkpointed + Replay::SCANS.checkpoint || self.checkpoint.is_missing() {
            self.save()?;
        }
        Ok(())
    }

    fn save(&mut self) -> Result<(), StepError> {
        let bytes = postcard::to_allocvec(&((self.place.seq, self.place.stamp_ns), self.recent.to_bytes(), self.std.to_bytes()))?;
        self.checkpoint.save(&bytes);
        self.checkpointed = self.place.seq;
        Ok(())
    }
}

fn restore(parameters: Parameters, bytes: &[u8]) -> Result<(Std, StreamCursor, Recent<SonarMotion>), StateError> {
    let ((seq, stamp_ns), recent, state): ((u64, u64), Vec<u8>, Vec<u8>) = postcard::from_bytes(bytes)?;
    let recent = Recent::from_bytes(&recent).ok_or(postcard::Error::DeserializeBadEncoding)?;
    Ok((Std::from_bytes(parameters, &state)?, StreamCursor { seq, stamp_ns }, recent))
}
