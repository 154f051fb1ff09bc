//! The algorithms of a deployment, to be run without it.

use crate::process;
use evaluate::Chain;
use settings::{BuiltIn, Settings};

/// STD, FTI, localisation and the mapper of a deployment with these settings.
pub(super) fn chain(settings: &Settings) -> Chain {
    Chain {
        std: process::std::parameters(settings),
        fti: process::fti::parameters(settings, 1.0),
        mapping: process::mapping::parameters(settings, 1.0),
        localisation: settings.runs(BuiltIn::Localisation).then(|| process::localisation::parameters(settings)),
    }
}
