//! What the process keeps between its incarnations.

use std::collections::VecDeque;

use bus::Checkpoint;
use messages::{CameraMotion, Payload};

use crate::checkpoint::CheckpointError;
use crate::settings::Settings;
use crate::state::State;

/// Answers that are kept: the history of a stream dies with its sender, and who reads them may have to go back further than
/// this process.
const RECENT: usize = CameraMotion::SERVICE.qos.history;
/// Bytes of a kept answer.
const RECENT_BYTES: usize = 16 + size_of::<CameraMotion>();

/// Number and stamp of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Place {
    pub(crate) seq: u64,
    pub(crate) stamp_ns: u64,
}

/// What a checkpoint keeps.
pub(crate) struct Kept {
    pub(crate) state: State,
    /// Of the last frame that was answered.
    pub(crate) place: Place,
    /// The last answers.
    pub(crate) recent: VecDeque<(Place, CameraMotion)>,
}

impl Kept {
    /// Goes on from the checkpoint when there is one; one that cannot be used is said and done without.
    pub(crate) fn take_up(checkpoint: &Checkpoint, parameters: Settings) -> Self {
        let problem = match checkpoint.load() {
            Ok(None) => None,
            Ok(Some(bytes)) => match Self::restore(parameters.clone(), &bytes) {
                Ok(kept) => {
                    tracing::info!("goes on after frame {}", kept.place.seq);
                    return kept;
                }
                Err(error) => Some(format!("the state in the checkpoint: {error}")),
            },
            Err(error) => Some(error.to_string()),
        };
        if let Some(problem) = problem {
            tracing::error!("learns the background anew: {problem}");
        }
        Self { state: State::new(parameters), place: Place::default(), recent: VecDeque::new() }
    }

    fn restore(parameters: Settings, bytes: &[u8]) -> Result<Self, CheckpointError> {
        let short = |needed: usize| CheckpointError::Short { offset: 0, needed, found: bytes.len() };
        let (numbers, rest) = bytes.split_first_chunk::<24>().ok_or_else(|| short(24))?;
        let [seq, stamp_ns, count] = numbers_of(numbers);
        let length = usize::try_from(count).unwrap_or(usize::MAX).saturating_mul(RECENT_BYTES);
        let (recent, state) = rest.split_at_checked(length).ok_or_else(|| short(length))?;
        let answer = |bytes: &[u8; RECENT_BYTES]| {
            let (place, motion) = bytes.split_first_chunk::<16>()?;
            let [seq, stamp_ns] = numbers_of(place);
            Some((Place { seq, stamp_ns }, bytemuck::try_pod_read_unaligned(motion).ok()?))
        };
        let recent = recent.as_chunks::<RECENT_BYTES>().0.iter().filter_map(answer).collect();
        Ok(Self { state: State::restore(parameters, state)?, place: Place { seq, stamp_ns }, recent })
    }

    /// For the next incarnation.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = [self.place.seq, self.place.stamp_ns, self.recent.len() as u64].map(u64::to_le_bytes).concat();
        for (place, motion) in &self.recent {
            bytes.extend([place.seq, place.stamp_ns].map(u64::to_le_bytes).as_flattened());
            bytes.extend(bytemuck::bytes_of(motion));
        }
        bytes.extend(self.state.save());
        bytes
    }

    /// Takes note of an answer.
    pub(crate) fn answered(&mut self, place: Place, motion: CameraMotion) {
        self.place = place;
        if self.recent.len() == RECENT {
            self.recent.pop_front();
        }
        self.recent.push_back((place, motion));
    }
}

/// Little-endian numbers.
fn numbers_of<const N: usize>(bytes: &[u8]) -> [u64; N] {
    let (numbers, _) = bytes.as_chunks::<8>();
    std::array::from_fn(|at| numbers.get(at).map_or(0, |number| u64::from_le_bytes(*number)))
}
