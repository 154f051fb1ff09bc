//! Simulates and scores drives through worlds, for seeds and numbers of walkers, on all processors.

use super::chain::chain;
use super::comparison::write_comparison;
use super::report::{Report, Row};
use crate::args::NumberRange;
use crate::built_in;
use crate::exit::BadInput;
use crate::process::robot;
use crate::process::simulator::{failings as usual_failings, optics};
use clap::{Args, ValueEnum};
use evaluate::{Drive, Eyes, Trial, Variation, filter, read_world, reference};
use indicatif::{MultiProgress, ProgressBar};
use settings::{Action, BuiltIn, Cue, FtiMethod, MovingCell, Process, Settings};
use simulator::blobs::Failings;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

#[derive(Debug, Clone, Args)]
#[command(group = clap::ArgGroup::new("drives").required(true))]
pub(crate) struct DriveArgs {
    /// A simulated drive: its log, or the folder of the log
    #[arg(value_name = "RUN", group = "drives")]
    pub(crate) run: Option<PathBuf>,
    /// Simulated worlds to drive through, each with every seed and every number of walkers.
    ///
    /// All drives run in this process, without a deployment. The camera is not rendered: its motion is computed from the true positions
    /// of the walkers, with the errors that the settings give it.
    #[arg(long, value_name = "FILE", group = "drives", num_args = 1..)]
    pub(crate) world: Vec<PathBuf>,
    /// Seeds of the noise and of the walkers' paths
    #[arg(long, value_name = "FIRST..LAST", default_value = "1..2", requires = "world")]
    pub(crate) seeds: NumberRange,
    /// Numbers of walkers. The default is the number in the world file
    #[arg(long, value_name = "N,N", value_delimiter = ',', requires = "world")]
    pub(crate) walkers: Vec<u32>,
    /// Time that each walker stands at each waypoint but the last, in seconds. The default is the time in the world file
    #[arg(long, value_name = "SECONDS", value_parser = standing, requires = "world")]
    pub(crate) stand: Option<f64>,
    /// Method that decides which readings enter the map
    #[arg(long, value_enum, default_value_t = Rule::Full, requires = "world")]
    pub(crate) rule: Rule,
    /// Factor on the calibration errors of the camera, from 0 to 10
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = factor, requires = "world")]
    pub(crate) errors: f64,
    /// Settings file for robot, sensors, filter and map. The default is that of the demo
    #[arg(long, value_name = "FILE", requires = "world")]
    pub(crate) settings: Option<PathBuf>,
    /// Folder for a picture of each drive with the unfiltered map, the filtered map and the walkers' paths; it is created if missing
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Print JSON instead of a table
    #[arg(long)]
    pub(crate) json: bool,
}

/// Method of a sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Rule {
    /// The method of the settings, with sonars and camera
    Full,
    /// The method of the settings, with sonars only
    Sonar,
    /// The method of the paper as printed, with an error-free camera
    Paper,
}

/// A world with the text of its file.
struct World {
    name: String,
    text: String,
    /// It has no walkers.
    empty: bool,
}

/// A drive to simulate.
struct Task<'a> {
    name: &'a str,
    text: &'a str,
    seed: u64,
    /// `None` for the walkers of the file.
    walkers: Option<u32>,
}

/// Simulates and scores every drive, in the order of worlds, numbers of walkers and seeds.
pub(super) fn sweep(options: &DriveArgs, bars: &MultiProgress) -> anyhow::Result<Report> {
    let settings = drive_settings(options)?;
    let worlds = options.world.iter().map(|path| read(path)).collect::<anyhow::Result<Vec<_>>>()?;
    let walkers: Vec<Option<u32>> =
        if options.walkers.is_empty() { vec![None] } else { options.walkers.iter().copied().map(Some).collect() };
    let mut tasks = Vec::new();
    for World { name, text, empty } in &worlds {
        // A world without walkers shows the walls that the filter removes for nothing.
        let walkers = if *empty { &[Some(0)][..] } else { &walkers };
        for &walkers in walkers {
            tasks.extend((options.seeds.first..=options.seeds.last).map(|seed| Task { name, text, seed, walkers }));
        }
    }
    let bar = bars.add(ProgressBar::new(tasks.len() as u64));
    let result = in_parallel(&tasks, |task| {
        let row = drive(task, &settings, options)?;
        bar.inc(1);
        Ok(row)
    });
    bar.finish_and_clear();
    Ok(Report::of(result?))
}

/// The settings of the drives.
fn drive_settings(options: &DriveArgs) -> anyhow::Result<Settings> {
    let mut settings = match &options.settings {
        Some(path) => Settings::read(path)?,
        None => Settings::parse("demo.toml", built_in::DEMO)?,
    };
    settings.pace = settings::Pace::Lockstep;
    // The camera of a sweep is made of the truth and takes the place of SBS.
    settings.process.retain(|process| !process.runs(BuiltIn::Sbs) && !process.runs(BuiltIn::Simulator));
    if options.rule != Rule::Sonar {
        settings.process.push(Process::built_in(BuiltIn::Sbs));
    }
    match options.rule {
        Rule::Full | Rule::Sonar => {}
        Rule::Paper => {
            (settings.fti.method, settings.std.rule) = (FtiMethod::Paper, MovingCell::Paper);
            (settings.fti.paper.cue, settings.fti.paper.action) = (Cue::Paper, Action::Free);
        }
    }
    Ok(settings)
}

fn read(path: &Path) -> anyhow::Result<World> {
    let name = path.display().to_string();
    let text = document::read_text(path)?;
    let empty = world_file::parse(&name, &text)?.walkers.is_empty();
    Ok(World { name, text, empty })
}

fn drive(task: &Task<'_>, settings: &Settings, options: &DriveArgs) -> anyhow::Result<Row> {
    let world = |walkers: Option<usize>| {
        read_world(task.text, Variation { walkers, seed: task.seed, stand_s: options.stand })
            .map_err(|error| BadInput(format!("{}: {error}", task.name)))
    };
    let (body, limit_m) = (robot::body(&settings.robot), settings.robot.range_limit_m.get());
    let eyes = Eyes { optics: optics(&settings.camera), failings: failings(settings, options) };
    let eyes = (options.rule != Rule::Sonar).then_some(&eyes);
    let drive = Drive::through(&world(task.walkers.map(|walkers| walkers as usize))?, &body, limit_m, eyes, task.seed);
    let empty = Drive::through(&world(Some(0))?, &body, limit_m, None, task.seed);
    let chain = chain(settings);
    let outcome = filter(&drive, &chain)?;
    let trial = Trial::judge(&drive, &outcome, Some(&reference(&empty, &chain.mapping)?), &chain)?;
    if let Some(folder) = &options.out {
        let stem = Path::new(task.name).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let walkers = task.walkers.map_or_else(String::new, |walkers| format!("-{walkers}-walkers"));
        write_comparison(&folder.join(format!("{stem}{walkers}-seed-{}", task.seed)), &trial)?;
    }
    Ok(Row::new(task.name.to_owned(), Some(task.seed), task.walkers, &trial))
}

/// The errors of the simulated background subtraction.
fn failings(settings: &Settings, options: &DriveArgs) -> Failings {
    let usual = usual_failings(&settings.simulator.camera.motion);
    if options.rule == Rule::Paper {
        return Failings::NONE;
    }
    Failings {
        focal_share: options.errors * usual.focal_share,
        horizon_px: options.errors * usual.horizon_px,
        height_m: options.errors * usual.height_m,
        ..usual
    }
}

/// Runs every task on as many threads as there are processors; the results in the order of the tasks, or the first error.
fn in_parallel<T: Sync, R: Send>(tasks: &[T], work: impl Fn(&T) -> anyhow::Result<R> + Sync) -> anyhow::Result<Vec<R>> {
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(usize, anyhow::Result<R>)>> = Mutex::new(Vec::new());
    let at_once = std::thread::available_parallelism().map_or(1, std::num::NonZero::get).min(tasks.len());
    std::thread::scope(|scope| {
        for _ in 0..at_once {
            scope.spawn(|| {
                while let Some((at, task)) = Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|at| Some((at, tasks.get(at)?))) {
                    let result = work(task);
                    done.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push((at, result));
                }
            });
        }
    });
    let mut done = done.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    done.sort_by_key(|(at, _)| *at);
    done.into_iter().map(|(_, result)| result).collect()
}

fn factor(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(factor) if (0.0..=10.0).contains(&factor) => Ok(factor),
        _ => Err("expected a number from 0 to 10".to_owned()),
    }
}

fn standing(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (0.0..=3600.0).contains(&seconds) => Ok(seconds),
        _ => Err("expected 0 to 3600 s".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_the_order_of_the_tasks() {
        let numbers: Vec<u64> = (0..100).collect();
        assert_eq!(in_parallel(&numbers, |number| Ok(number * number)).unwrap(), numbers.iter().map(|n| n * n).collect::<Vec<_>>());
        let error = in_parallel(&numbers, |number| if *number >= 50 { Err(anyhow::anyhow!("{number}")) } else { Ok(()) }).unwrap_err();
        assert_eq!(error.to_string(), "50");
    }
}
