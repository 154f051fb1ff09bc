//! A run, from the preparation of its output folder to the summary at its end.

use crate::args::RunOptions;
use crate::exit::BadInput;
use crate::page::Page;
use crate::process::mapping::DOUBTFUL_POSES;
use crate::progress::{self, Progress};
use crate::{exit, output};
use indicatif::MultiProgress;
use messages::{DeploymentStatus, MapSummary};
use settings::{BuiltIn, Name, Settings};
use std::path::Path;
use std::time::Instant;
use supervisor::{Options, Outcome, Report};

/// Applies the output folder of the command line and creates it.
pub(crate) fn place_output(settings: &mut Settings, options: &RunOptions) -> anyhow::Result<()> {
    if let Some(out) = &options.out {
        settings.out.clone_from(out);
    }
    settings.out = std::path::absolute(&settings.out)?;
    make_folder(&settings.out)?;
    check_writable(&settings.out)
}

/// Fails for a folder in which no file can be created, before the run starts. A full disk is accepted: it may have space later.
fn check_writable(folder: &Path) -> anyhow::Result<()> {
    let probe = folder.join(format!(".{}.probe", std::process::id()));
    let written = std::fs::File::create(&probe);
    let _ = std::fs::remove_file(&probe);
    match written {
        Err(error) if error.kind() != std::io::ErrorKind::StorageFull => {
            Err(BadInput(format!("{}: cannot write into this folder: {error}", folder.display())).into())
        }
        Ok(_) | Err(_) => Ok(()),
    }
}

/// A name that no other run on this computer has, so that concurrent runs are independent.
pub(crate) fn unique_name(what: &str) -> anyhow::Result<Name> {
    Ok(Name::try_from(format!("{what}-{}", std::process::id()))?)
}

/// Creates a folder for outputs.
pub(crate) fn make_folder(folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).map_err(|error| BadInput(format!("{}: cannot create this folder: {error}", folder.display())).into())
}

/// Options for a run whose state is not resumed later.
pub(crate) fn once(speed: f64) -> anyhow::Result<Options> {
    Ok(Options { speed, executable: std::env::current_exe()?, state: None, fresh: false })
}

/// Runs a deployment and prints its summary; the exit code. With `open` a browser shows the page.
pub(crate) fn drive(settings: &Settings, options: &Options, open: bool, bars: &MultiProgress) -> anyhow::Result<u8> {
    let started = Instant::now();
    let mut progress = Progress::new(bars);
    let mut page = Page::of(settings, open);
    let mut doubtful_poses = 0;
    let result = supervisor::run(settings, options, &mut |report| {
        if let Report::Status(status) = report {
            doubtful_poses = doubtful_poses.max(count(status, DOUBTFUL_POSES));
            progress.show(status);
            page.update(status);
        }
    });
    progress.end();
    let outcome = result?;
    summarize(settings, &outcome, started.elapsed().as_secs_f64())?;
    if doubtful_poses > 0 {
        let gaps = if doubtful_poses == 1 { "1 gap".to_owned() } else { format!("{doubtful_poses} gaps") };
        output::line(&format!("poses      DOUBTFUL after {gaps}: the map may be shifted from there on"))?;
    }
    Ok(outcome.exit_code())
}

/// The sum of the processes' counters of this name.
fn count(status: &DeploymentStatus, name: &str) -> u64 {
    let processes = status.processes.iter().take(status.count as usize);
    processes.filter_map(|process| progress::counter(process, name)).sum()
}

fn summarize(settings: &Settings, outcome: &Outcome, wall_s: f64) -> anyhow::Result<()> {
    for (process, cause) in outcome.failures() {
        output::line(&format!("failed     {process}: {cause}"))?;
    }
    if outcome.exit_code() == exit::BAD_INPUT {
        return Ok(());
    }
    let restarted: Vec<String> = outcome
        .processes
        .iter()
        .filter(|process| process.restarts > 0)
        .map(|process| match process.restarts {
            1 => format!("{} once", process.name),
            times => format!("{} {times} times", process.name),
        })
        .collect();
    if !restarted.is_empty() {
        output::line(&format!("restarted  {}", restarted.join(", ")))?;
    }
    if settings.runs(BuiltIn::Recorder) {
        output::line(&format!("log        {}", settings.out.join(settings.recorder.file.as_str()).display()))?;
    }
    match &outcome.map {
        Some(map) => summarize_map(&settings.out, map, wall_s),
        None if settings.runs(BuiltIn::Mapping) => Ok(output::line("map        not finished")?),
        None => Ok(()),
    }
}

fn summarize_map(out: &Path, map: &MapSummary, wall_s: f64) -> anyhow::Result<()> {
    output::line(&format!("map        {}", out.join("map.png").display()))?;
    output::line(&format!("           {} with map.pgm, for ROS map_server and nav2", out.join("map.yaml").display()))?;
    output::line(&format!("figures    {} scans with {} readings over {:.1} m, in {:.1} s", map.scans, map.readings, map.way_m, wall_s))?;
    if map.withheld > 0 || map.undecided > 0 {
        output::line(&format!("verdicts   {} readings withheld, {} undecided", map.withheld, map.undecided))?;
    }
    Ok(output::line(&format!("map sha256 {}", hex(&map.sha256)))?)
}

/// Bytes as hexadecimal digits.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
