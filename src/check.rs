//! `stillmap check`: settings before they are used.

use crate::output;
use settings::{BuiltIn, Settings};
use std::path::Path;

/// Reads a settings file and whatever it names, and says what it describes.
pub(crate) fn check(path: &Path) -> anyhow::Result<u8> {
    let settings = read(path)?;
    let processes = settings.process.iter().map(|process| process.name.to_string()).collect::<Vec<_>>().join(", ");
    output::line(&format!("{}: fine: deployment {} of {processes}", path.display(), settings.name))?;
    Ok(0)
}

/// Reads settings, and refuses now what a process would refuse later.
pub(crate) fn read(path: &Path) -> anyhow::Result<Settings> {
    let settings = Settings::read(path)?;
    check_files(&settings)?;
    Ok(settings)
}

/// The files that settings name.
pub(crate) fn check_files(settings: &Settings) -> anyhow::Result<()> {
    if settings.runs(BuiltIn::Simulator) {
        simulator::read_world(&settings.simulator.world)?;
    }
    Ok(())
}
