//! `stillmap map`: the current map of a running deployment.

use crate::args::Which;
use crate::drive::lock_folder;
use crate::running::choose;
use crate::{exit, output};
use bus::{Reader, Received, RunningDomain};
use clap::Args;
use mapping::export::{MapCopy, MapFiles};
use messages::{MapTile, Payload, WayChunk};
use runtime::Observer;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Arguments of `stillmap map`.
#[derive(Debug, Args)]
pub(crate) struct MapArgs {
    /// Folder for the map; it is created if missing
    #[arg(long, value_name = "DIR", default_value = "map-out")]
    out: PathBuf,
    #[command(flatten)]
    which: Which,
}

/// How long to wait for the next piece of the map.
const PATIENCE: Duration = Duration::from_secs(5);

/// Collects the map that mapping publishes to new readers, and writes it; the exit code.
pub(crate) fn map(args: &MapArgs) -> anyhow::Result<u8> {
    let domain = choose(&args.which)?;
    let out = lock_folder(&args.out)?;
    let MapFiles { files, left_out } = collect(&domain)?.files()?;
    for path in mapping::write_files(out.path(), &files)? {
        output::line(&path.display().to_string())?;
    }
    for lack in &left_out {
        tracing::warn!("{lack}");
    }
    Ok(if left_out.is_empty() { exit::SUCCESS } else { exit::INCOMPLETE })
}

fn collect(domain: &RunningDomain) -> anyhow::Result<MapCopy> {
    let mut tool = Observer::join(domain)?;
    let mut tiles = tool.reader::<MapTile>()?;
    let mut way = tool.reader::<WayChunk>()?;
    let mut copy = MapCopy::default();
    let mut last_piece = Instant::now();
    while !copy.is_whole() {
        let taken = take(&mut tiles, |tile| copy.take_tile(tile))? + take(&mut way, |chunk| copy.take_way(chunk))?;
        if taken > 0 {
            last_piece = Instant::now();
        } else if last_piece.elapsed() > PATIENCE {
            let (held, expected) = copy.progress();
            anyhow::ensure!(expected > 0, "deployment {} has no map yet", domain.name());
            anyhow::bail!("mapping of {} sent nothing more after {held} of {expected} tiles", domain.name());
        }
        tool.wait(Duration::from_millis(100))?;
    }
    Ok(copy)
}

/// Takes everything that waits; the number of messages.
fn take<T: Payload>(reader: &mut Reader<T>, mut each: impl FnMut(&T)) -> anyhow::Result<usize> {
    let mut taken = 0;
    while let Some(received) = reader.take()? {
        if let Received::Message(message) = received {
            each(&message);
            taken += 1;
        }
    }
    Ok(taken)
}
