//! `stillmap figures`: the paper's figures from this project's own code.

use crate::drive::make_folder;
use crate::exit::BadInput;
use crate::output;
use std::path::Path;

/// Makes every figure and writes it; the exit code.
pub(crate) fn figures(out: &Path) -> anyhow::Result<u8> {
    make_folder(out)?;
    for figure in ::figures::all() {
        let figure = figure?;
        let path = out.join(figure.name);
        std::fs::write(&path, figure.svg).map_err(|error| BadInput(format!("{}: cannot be written: {error}", path.display())))?;
        output::line(&format!("{}  {}", path.display(), figure.title))?;
    }
    Ok(0)
}
