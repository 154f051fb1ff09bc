//! `stillmap check`: settings before they are used.

use crate::output;
use clap::Args;
use settings::{BuiltIn, Settings};
use std::path::{Path, PathBuf};

/// Arguments of `stillmap check`.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("what").required(true))]
pub(crate) struct CheckArgs {
    /// The settings file
    #[arg(value_name = "FILE", group = "what")]
    settings: Option<PathBuf>,
    /// Print the JSON schema of settings files
    #[arg(long, group = "what")]
    schema: bool,
    /// Print the reference of all settings
    #[arg(long, group = "what")]
    reference: bool,
}

/// Checks a settings file, or prints the schema or the reference of all settings.
pub(crate) fn check(args: &CheckArgs) -> anyhow::Result<()> {
    match args {
        CheckArgs { settings: Some(settings), .. } => check_file(settings)?,
        CheckArgs { schema: true, .. } => output::write(&settings::schema())?,
        CheckArgs { .. } => output::write(&settings::reference())?,
    }
    Ok(())
}

/// Checks a settings file with the files that it names, and prints its processes.
fn check_file(path: &Path) -> anyhow::Result<()> {
    let settings = read(path)?;
    let processes = settings.process.iter().map(|process| process.name.to_string()).collect::<Vec<_>>().join(", ");
    output::line(&format!("{}: valid: deployment {} with the processes {processes}", path.display(), settings.name))?;
    Ok(())
}

/// Reads settings and checks what their processes would check later.
pub(crate) fn read(path: &Path) -> anyhow::Result<Settings> {
    let settings = Settings::read(path)?;
    check_files(&settings)?;
    Ok(settings)
}

/// Checks the files that settings name.
pub(crate) fn check_files(settings: &Settings) -> anyhow::Result<()> {
    if settings.runs(BuiltIn::Simulator) {
        simulator::read_world(&settings.simulator.world)?;
    }
    Ok(())
}
