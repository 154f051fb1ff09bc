//! `stillmap demo`: the built-in deployment, so that the one file of the command is enough.

use crate::cli::RunOptions;
use crate::drive::{drive, once, place_output};
use crate::evaluate::conclude;
use crate::exit::BadInput;
use crate::output;
use indicatif::MultiProgress;
use settings::{BuiltIn, Name, Settings};
use std::path::{Path, PathBuf};

pub(crate) const SETTINGS: &str = include_str!("../config/demo.toml");
const WORLD: &str = include_str!("../config/worlds/hall.toml");
/// Fast enough not to bore, slow enough to look at.
const SPEED: f64 = 5.0;
/// The same for somebody who watches the live page.
const WATCHED_SPEED: f64 = 3.0;

/// Drives the simulated robot through the built-in world or another; the exit code.
pub(crate) fn demo(options: &RunOptions, world: Option<&Path>, bars: &MultiProgress) -> anyhow::Result<u8> {
    let mut settings = Settings::parse("demo.toml", SETTINGS)?;
    settings.name = unique_name("demo")?;
    settings.out = PathBuf::from("demo-out");
    place_output(&mut settings, options)?;
    settings.simulator.world = match world {
        Some(path) => std::path::absolute(path)?,
        None => unpack_world(&settings.out)?,
    };
    crate::check::check_files(&settings)?;
    let speed = options.speed.unwrap_or(if options.open { WATCHED_SPEED } else { SPEED });
    tracing::info!("a simulated Pioneer 1 drives through a hall with people in it, {speed} times faster than a real one");
    tracing::info!("each process is watched and restarted: `stillmap status` shows them, kill -9 any of them and see");
    let code = drive(&settings, &once(speed)?, options.open, bars)?;
    if code == 0 && settings.runs(BuiltIn::Recorder) {
        let log = settings.out.join(settings.recorder.file.as_str());
        match conclude(&settings.out, &log) {
            Ok(figures) => {
                output::line(&format!("ghosts     {figures}"))?;
                output::line(&format!("           {}", settings.out.join("comparison.png").display()))?;
            }
            Err(error) => tracing::warn!("the map cannot be judged: {error}"),
        }
    }
    Ok(code)
}

/// A name that no other run on this machine has: runs side by side never meet.
pub(crate) fn unique_name(what: &str) -> anyhow::Result<Name> {
    Ok(Name::try_from(format!("{what}-{}", std::process::id()))?)
}

fn unpack_world(folder: &Path) -> anyhow::Result<PathBuf> {
    let path = folder.join("world.toml");
    std::fs::write(&path, WORLD).map_err(|error| BadInput(format!("{}: cannot be written: {error}", path.display())))?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_built_in_can_be_used() {
        Settings::parse("demo.toml", SETTINGS).unwrap();
        simulator::World::parse("hall.toml", WORLD).unwrap();
        assert_eq!(unique_name("demo").unwrap().as_str(), format!("demo-{}", std::process::id()));
    }
}
