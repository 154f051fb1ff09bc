//! `stillmap process KIND`: one process of a deployment. Its environment names the deployment.
//!
//! A module here is the wiring of one process: streams in, the algorithm's step, streams out.

mod camera;
pub mod fti;
pub mod localisation;
pub mod mapping;
pub(crate) mod pioneer;
pub(crate) mod playback;
pub mod sbs;
pub(crate) mod simulator;
pub mod std;

mod injector;
#[cfg(test)]
mod key_effects;
pub(crate) mod recorder;
pub mod robot;
mod viewer;
#[cfg(test)]
mod wiring_tests;

use crate::exit::BadInput;
use bus::Membership;
use runtime::Shell;
use settings::{BuiltIn, Settings};

/// Runs a built-in process to its end.
pub(crate) fn process(kind: &str) -> anyhow::Result<()> {
    let membership = Membership::from_env().map_err(|error| BadInput(error.to_string()))?;
    let settings = Settings::read_handed(membership.settings_path())?;
    let shell = Shell::join(membership)?;
    match built_in(kind)? {
        BuiltIn::Recorder => recorder::run(shell, &settings)?,
        BuiltIn::Mapping => mapping::run(shell, &settings)?,
        BuiltIn::Std => std::run(shell, &settings)?,
        BuiltIn::Sbs => sbs::run(shell, &settings)?,
        BuiltIn::Fti => fti::run(shell, &settings)?,
        BuiltIn::Localisation => localisation::run(shell, &settings)?,
        BuiltIn::Pioneer => pioneer::run(shell, &settings)?,
        BuiltIn::Camera => camera::run(shell, &settings)?,
        BuiltIn::Simulator => simulator::run(shell, &settings)?,
        BuiltIn::Playback => playback::run(shell, &settings)?,
        BuiltIn::Viewer => viewer::run(shell, &settings)?,
        BuiltIn::Injector => injector::run(shell, &settings)?,
    }
    Ok(())
}

fn built_in(word: &str) -> Result<BuiltIn, BadInput> {
    let words = BuiltIn::ALL.map(BuiltIn::word).join(", ");
    BuiltIn::ALL.into_iter().find(|kind| kind.word() == word).ok_or_else(|| BadInput(format!("process {word}: expected one of {words}")))
}
