//! `stillmap log`: logs at a glance, repaired, imported.

use crate::cli::{ImportFormat, LogCommand};
use crate::output;
use std::path::{Path, PathBuf};

/// Carries out a `log` command; the exit code.
pub(crate) fn log(command: &LogCommand) -> anyhow::Result<u8> {
    match command {
        LogCommand::Info { log } => output::write(&drivelog::info(log)?.to_string())?,
        LogCommand::Recover { log, out } => recover(log, out.clone().unwrap_or_else(|| recovered_name(log)))?,
        LogCommand::Import { format: ImportFormat::Robond, from, out } => {
            let imported = drivelog::import_robond(from, out)?;
            output::line(&format!("{}: {} scans", out.display(), imported.scans))?;
        }
    }
    Ok(0)
}

fn recover(log: &Path, out: PathBuf) -> anyhow::Result<()> {
    let recovered = drivelog::recover(log, &out)?;
    for damage in &recovered.damages {
        output::line(&format!("damage    {damage}"))?;
    }
    Ok(output::line(&format!("{}: {} messages, {} bytes", out.display(), recovered.messages, recovered.bytes))?)
}

/// Beside the damaged log.
fn recovered_name(log: &Path) -> PathBuf {
    let stem = log.file_stem().unwrap_or_default().to_string_lossy();
    log.with_file_name(format!("{stem}-recovered.mcap"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recovered_log_lies_beside_the_damaged_one() {
        assert_eq!(recovered_name(Path::new("logs/drive.mcap")), Path::new("logs/drive-recovered.mcap"));
    }
}
