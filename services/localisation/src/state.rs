//! The whole state as bytes, so that a restarted process resumes where it stopped.

use std::borrow::Cow;

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};
use state::{DecodeError, decode, encode};

use crate::horizon::Horizon;
use crate::localisation::{Localisation, Waiting};
use crate::parameters::{Parameters, ParametersError};
use crate::tracking::Tracking;

/// Bytes that are no state of this version.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StateError {
    /// They are of another version or damaged.
    #[error(transparent)]
    Bytes(#[from] DecodeError),
    /// A number names a node, an echo or a line that there is not.
    #[error("the state names a node, an echo or a line that it does not have")]
    Inconsistent,
    /// The parameters it is restored with.
    #[error(transparent)]
    Parameters(#[from] ParametersError),
}

#[derive(Serialize, Deserialize, Schema)]
struct State<'a> {
    revisions: u32,
    horizon: Cow<'a, Horizon<Waiting>>,
    tracking: Cow<'a, Tracking>,
}

impl Localisation {
    /// The whole state.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let (horizon, tracking) = (Cow::Borrowed(&self.horizon), Cow::Borrowed(&self.tracking));
        encode(&State { revisions: self.revisions, horizon, tracking }, Vec::new())
    }

    /// A service that resumes from a state. What was being computed beside the scans is computed again, which may take as long as
    /// it had taken.
    ///
    /// # Errors
    /// Bytes of another version or damaged ones; parameters out of range.
    pub fn from_bytes(parameters: Parameters, bytes: &[u8]) -> Result<Self, StateError> {
        let State { revisions, horizon, tracking } = decode(bytes)?;
        let mut localisation = Self::new(parameters)?;
        localisation.revisions = revisions;
        localisation.horizon = horizon.into_owned();
        localisation.tracking = tracking.into_owned();
        if !localisation.tracking.is_consistent() {
            return Err(StateError::Inconsistent);
        }
        let model = localisation.model();
        localisation.tracking.redo(&model);
        Ok(localisation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{Pose, SonarScan};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_restored_state_gives_the_same_answers(cut in 0..60u64, xs in proptest::collection::vec(-5.0..5.0f64, 60)) {
            let mut whole = Localisation::new(Parameters::default()).unwrap();
            let scan = |k: u64| SonarScan::new(Pose::new(xs[k as usize], 0.0, 0.0), &[], false);
            (0..cut).for_each(|k| { whole.step(k, k * 100_000_000, &scan(k)); });
            let mut restored = Localisation::from_bytes(Parameters::default(), &whole.to_bytes()).unwrap();
            for k in cut..60 {
                prop_assert_eq!(restored.step(k, k * 100_000_000, &scan(k)), whole.step(k, k * 100_000_000, &scan(k)));
            }
            prop_assert_eq!(restored.to_bytes(), whole.to_bytes());
            prop_assert_eq!(restored.finish(), whole.finish());
        }
    }

    #[test]
    fn another_version_and_cut_bytes_are_refused() {
        let error = |bytes: &[u8]| Localisation::from_bytes(Parameters::default(), bytes).unwrap_err();
        let bytes = Localisation::new(Parameters::default()).unwrap().to_bytes();
        let mut other = bytes.clone();
        other[0] ^= 1;
        assert!(matches!(error(&other), StateError::Bytes(DecodeError::Version { .. })));
        assert!(matches!(error(&bytes[..bytes.len() - 1]), StateError::Bytes(DecodeError::Damaged(_))));
    }
}
