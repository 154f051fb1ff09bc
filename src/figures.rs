//! `stillmap figures`: the figures of the paper, drawn by the code that runs in a deployment.

use crate::drive::lock_folder;
use crate::exit::BadInput;
use crate::output;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `stillmap figures`.
#[derive(Debug, Args)]
pub(crate) struct FiguresArgs {
    /// Folder for the figures; it is created if missing
    #[arg(long, value_name = "DIR", default_value = "figures-out")]
    out: PathBuf,
}

/// Draws every figure and writes it.
pub(crate) fn figures(args: &FiguresArgs) -> anyhow::Result<()> {
    let FiguresArgs { out } = args;
    let _locked = lock_folder(out)?;
    for figure in ::figures::all() {
        let figure = figure?;
        let path = out.join(figure.name);
        std::fs::write(&path, figure.svg).map_err(|error| BadInput(format!("{}: cannot be written: {error}", path.display())))?;
        output::line(&format!("{}  {}", path.display(), figure.title))?;
    }
    Ok(())
}
