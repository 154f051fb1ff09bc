//! A run, from the preparation of its output folder to the summary at its end.

use crate::args::RunOptions;
use crate::exit::BadInput;
use crate::page::Page;
use crate::progress::Progress;
use crate::shortfall::Shortfall;
use crate::{exit, output};
use indicatif::MultiProgress;
use messages::MapSummary;
use settings::{BuiltIn, Name, Settings};
use std::path::Path;
use std::time::Instant;
use supervisor::{Ending, Options, Outcome, OutputFolder, Report};

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
fn make_folder(folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).map_err(|error| BadInput(format!("{}: cannot create this folder: {error}", folder.display())).into())
}

/// Creates a folder for outputs and keeps other runs from writing into it.
pub(crate) fn lock_folder(folder: &Path) -> anyhow::Result<OutputFolder> {
    make_folder(folder)?;
    Ok(OutputFolder::lock(folder)?)
}

/// Options for a run whose state is not resumed later.
pub(crate) fn once(speed: f64) -> anyhow::Result<Options> {
    // Restarts run the same file as the supervisor, even after another one has replaced it under its name.
    Ok(Options { speed, executable: "/proc/self/exe".into(), state: None, fresh: false, files: Vec::new() })
}

/// A run that has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Driven {
    /// The exit code that says what came of it.
    pub(crate) exit_code: u8,
    /// It came to its end by itself, and no process failed.
    pub(crate) is_complete: bool,
}

/// Runs a deployment and prints its summary. With `open` a browser shows the page.
pub(crate) fn drive(settings: &Settings, options: &Options, open: bool, bars: &MultiProgress) -> anyhow::Result<Driven> {
    let started = Instant::now();
    let mut progress = Progress::new(bars);
    let mut page = Page::of(settings, open);
    let mut shortfall = Shortfall::default();
    let result = supervisor::run(settings, options, &mut |report| {
        if let Report::Status(status) = report {
            shortfall.note(status);
            progress.show(status);
            page.update(status);
        }
    });
    progress.end();
    let outcome = result?;
    print(&summary(settings, &outcome, &shortfall, started.elapsed().as_secs_f64()));
    let exit_code = match outcome.exit_code() {
        exit::SUCCESS if shortfall.is_incomplete() => exit::INCOMPLETE,
        code => code,
    };
    Ok(Driven { exit_code, is_complete: outcome.ending == Ending::Complete && outcome.exit_code() == exit::SUCCESS })
}

/// Prints lines about a run that has ended. The exit code does not depend on whether they could be written.
pub(crate) fn print(lines: &[String]) {
    if let Err(error) = lines.iter().try_for_each(|line| output::line(line)) {
        tracing::warn!("{error}");
    }
}

fn summary(settings: &Settings, outcome: &Outcome, shortfall: &Shortfall, wall_s: f64) -> Vec<String> {
    let mut lines: Vec<String> = outcome.failures().map(|(process, cause)| format!("failed     {process}: {cause}")).collect();
    if outcome.exit_code() == exit::BAD_INPUT {
        return lines;
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
        lines.push(format!("restarted  {}", restarted.join(", ")));
    }
    if settings.runs(BuiltIn::Recorder) {
        lines.push(format!("log        {}", settings.out.join(settings.recorder.file.as_str()).display()));
    }
    match &outcome.map {
        Some(map) => lines.extend(map_summary(&settings.out, map, wall_s)),
        None if settings.runs(BuiltIn::Mapping) => lines.push("map        not finished".to_owned()),
        None => {}
    }
    lines.extend(shortfall.lines());
    lines
}

fn map_summary(out: &Path, map: &MapSummary, wall_s: f64) -> Vec<String> {
    let mut lines = vec![
        format!("map        {}", out.join("map.png").display()),
        format!("           {} with map.pgm, for ROS map_server and nav2", out.join("map.yaml").display()),
        format!("figures    {} scans with {} readings over {:.1} m, in {:.1} s", map.scans, map.readings, map.way_m, wall_s),
    ];
    if map.withheld > 0 || map.undecided > 0 {
        lines.push(format!("verdicts   {} readings withheld, {} undecided", map.withheld, map.undecided));
    }
    lines.push(format!("map sha256 {}", hex(&map.sha256)));
    lines
}

/// Bytes as hexadecimal digits.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
