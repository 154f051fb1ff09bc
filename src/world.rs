//! `stillmap world`: random worlds for the simulator.

use crate::exit::BadInput;
use crate::output;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `stillmap world`.
#[derive(Debug, Args)]
pub(crate) struct WorldArgs {
    /// Seed of the building, the robot's path and the walkers
    #[arg(long, value_name = "SEED")]
    random: u64,
    /// World file to write; an existing file is replaced. The default is to print the world
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Writes or prints the random world of a seed.
pub(crate) fn world(args: &WorldArgs) -> anyhow::Result<()> {
    let text = random(args.random)?;
    match &args.out {
        Some(path) => std::fs::write(path, text).map_err(|error| BadInput(format!("{}: cannot be written: {error}", path.display())))?,
        None => output::write(&text)?,
    }
    Ok(())
}

/// The text of the random world of a seed.
pub(crate) fn random(seed: u64) -> anyhow::Result<String> {
    let text = world_file::random_world(seed);
    Ok(text.ok_or_else(|| BadInput(format!("no building of seed {seed} has room for a drive: choose another seed")))?)
}
