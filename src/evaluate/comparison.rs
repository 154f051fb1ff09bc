//! The picture of a scored drive.

use evaluate::Trial;
use std::path::{Path, PathBuf};

/// Writes `comparison.png`; its path.
pub(super) fn write_comparison(folder: &Path, trial: &Trial) -> anyhow::Result<PathBuf> {
    let mut paths = mapping::write_files(folder, &[trial.map.comparison()?])?;
    Ok(paths.pop().unwrap_or_else(|| folder.to_owned()))
}
