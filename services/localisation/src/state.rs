//! The whole state as bytes, so that a restarted process resumes where it stopped.

use std::borrow::Cow;

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};
use state::{DecodeError, decode, encode};

use crate::horizon::Horizon;
use crate::localisation::Localisation;
use crate::parameters::{Parameters, ParametersError};

/// Bytes that are no state of this version.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StateError {
    /// They are of another version or damaged.
    #[error(transparent)]
    Bytes(#[from] DecodeError),
    /// The parameters it is restored with.
    #[error(transparent)]
    Parameters(#[from] ParametersError),
}

#[derive(Serialize, Deserialize, Schema)]
struct State<'a> {
    horizon: Cow<'a, Horizon<[f64; 3]>>,
}

impl Localisation {
    /// The whole state.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        encode(&State { horizon: Cow::Borrowed(&self.horizon) }, Vec::new())
    }

    /// A service that resumes from a state.
    ///
    /// # Errors
    /// Bytes of another version or damaged ones; parameters out of range.
    pub fn from_bytes(parameters: Parameters, bytes: &[u8]) -> Result<Self, StateError> {
        let state: State<'_> = decode(bytes)?;
        let mut localisation = Self::new(parameters)?;
        localisation.horizon = state.horizon.into_owned();
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
