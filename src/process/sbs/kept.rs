//! What the process keeps between its incarnations.

use bus::Recent;
use messages::{CameraMotion, StreamCursor};
use runtime::Checkpoint;

use ::sbs::{CheckpointError, Parameters, State};

/// What a checkpoint keeps.
pub(super) struct Kept {
    pub(super) state: State,
    /// Of the last frame that was answered.
    pub(super) place: StreamCursor,
    /// The last answers.
    pub(super) recent: Recent<CameraMotion>,
}

impl Kept {
    /// Goes on from the checkpoint when there is one that can be used; otherwise the background is learnt anew.
    pub(super) fn take_up(checkpoint: &Checkpoint, parameters: Parameters) -> Self {
        match checkpoint.restore(|saved| Self::restore(parameters.clone(), saved.state)) {
            Some(kept) => {
                tracing::info!("goes on after frame {}", kept.place.seq);
                kept
            }
            None => Self { state: State::new(parameters), place: StreamCursor::default(), recent: Recent::default() },
        }
    }

    fn restore(parameters: Parameters, bytes: &[u8]) -> Result<Self, CheckpointError> {
        let short = |needed: usize| CheckpointError::Short { offset: 0, needed, found: bytes.len() };
        let (numbers, rest) = bytes.split_first_chunk::<24>().ok_or_else(|| short(24))?;
        let (numbers, _) = numbers.as_chunks::<8>();
        let [seq, stamp_ns, length] = std::array::from_fn(|at| numbers.get(at).map_or(0, |number| u64::from_le_bytes(*number)));
        let length = usize::try_from(length).unwrap_or(usize::MAX);
        let (recent, state) = rest.split_at_checked(length).ok_or_else(|| short(length))?;
        let recent = Recent::from_bytes(recent).ok_or(CheckpointError::Value { offset: 24 + length, what: "the last answers" })?;
        Ok(Self { state: State::restore(parameters, state)?, place: StreamCursor { seq, stamp_ns }, recent })
    }

    /// Appends it as bytes, for the next incarnation.
    pub(super) fn write_to(&self, bytes: &mut Vec<u8>) {
        let recent = self.recent.to_bytes();
        bytes.extend([self.place.seq, self.place.stamp_ns, recent.len() as u64].map(u64::to_le_bytes).as_flattened());
        bytes.extend(recent);
        self.state.write_to(bytes);
    }

    /// Takes note of an answer.
    pub(super) fn answered(&mut self, place: StreamCursor, motion: &CameraMotion) {
        self.place = place;
        self.recent.note(place.seq, place.stamp_ns, motion);
    }
}
