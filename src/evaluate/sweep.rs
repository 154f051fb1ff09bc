//! Simulates and scores drives through worlds, for seeds and numbers of walkers, on all processors.

use super::chain::chain;
use super::comparison::write_comparison;
use super::report::{Report, Row};
use crate::args::NumberRange;
use crate::exit::BadInput;
use crate::process::simulator::optics;
use crate::process::{robot, sbs};
use crate::{built_in, progress, world};
use clap::{Args, ValueEnum};
use evaluate::{CameraSetup, Driven, Setup, Variation, in_parallel, read_world};
use indicatif::MultiProgress;
use settings::{Action, BuiltIn, Cue, FtiMethod, MovingCell, Process, Settings};
use simulator::CalibrationError;
use simulator::camera::Flaws;
use simulator::quantity::{ErrorShare, HeadingWander};
use simulator::world::OdometryError;
use std::path::{Path, PathBuf};

#[derive(Debug, Clone, Args)]
#[command(group = clap::ArgGroup::new("drives").required(true))]
pub(crate) struct DriveArgs {
    /// A simulated drive: its log, or the folder of the log
    #[arg(value_name = "RUN", group = "drives")]
    pub(crate) run: Option<PathBuf>,
    /// Run the filter again on the recorded scans and pictures, instead of scoring the recorded verdicts
    #[arg(long, conflicts_with_all = ["world", "random"])]
    pub(crate) replay: bool,
    /// Simulated worlds to drive through, each with every seed and every number of walkers.
    ///
    /// All drives run in this process, without a deployment: the camera's pictures are rendered and background subtraction runs on them.
    /// The rendered camera differs from that of the settings by the errors of a mounting with a tape measure.
    #[arg(long, value_name = "FILE", group = "drives", num_args = 1..)]
    pub(crate) world: Vec<PathBuf>,
    /// Random worlds to drive through, as of `stillmap world`; the seed of a world is that of its drive
    #[arg(long, value_name = "FIRST..LAST", group = "drives")]
    pub(crate) random: Option<NumberRange>,
    /// Seeds of the noise and of the walkers' paths
    #[arg(long, value_name = "FIRST..LAST", default_value = "1..2", requires = "world")]
    pub(crate) seeds: NumberRange,
    /// Numbers of walkers. The default is the number in the world file
    #[arg(long, value_name = "N,N", value_delimiter = ',', conflicts_with = "run")]
    pub(crate) walkers: Vec<u32>,
    /// Time that each walker stands at each waypoint but the last, in seconds. The default is the time in the world file
    #[arg(long, value_name = "SECONDS", value_parser = standing, conflicts_with = "run")]
    pub(crate) stand: Option<f64>,
    /// Method that decides which readings enter the map
    #[arg(long, value_enum, default_value_t = Method::Settings, conflicts_with = "run")]
    pub(crate) method: Method,
    /// Drive with sonars only
    #[arg(long, conflicts_with = "run")]
    pub(crate) no_camera: bool,
    /// Give the robot's odometry these errors, and run localisation. The map is scored by localisation's final poses, and a second
    /// table scores localisation
    #[arg(long, value_enum, value_name = "ERRORS", conflicts_with = "run")]
    pub(crate) odometry: Option<Odometry>,
    /// Settings file for robot, sensors, filter and map. The default is that of the demo
    #[arg(long, value_name = "FILE", conflicts_with = "run")]
    pub(crate) settings: Option<PathBuf>,
    /// Folder for a picture of each drive with the unfiltered map, the filtered map and the walkers' paths; it is created if missing
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Print JSON instead of a table
    #[arg(long)]
    pub(crate) json: bool,
}

/// Name of random worlds in the table.
const RANDOM: &str = "random";

/// Method of a sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Method {
    /// The method of the settings
    Settings,
    /// The method of the paper as printed
    Paper,
}

/// Errors of odometry, as of a Pioneer with tyres that are worn and not calibrated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Odometry {
    /// Those of the world file
    File,
    /// None
    Exact,
    /// Distances 2 % too long, turns 4 % too large, a heading that wanders by 1.5°/√m
    D15,
    /// The same with a heading that wanders by 3°/√m
    D30,
}

impl Odometry {
    /// The errors; `None` for those of the file.
    fn error(self) -> Option<OdometryError> {
        let drifting = |wander_deg| {
            Some(OdometryError {
                distance_share: ErrorShare::new(0.02)?,
                turn_share: ErrorShare::new(0.04)?,
                wander_deg: HeadingWander::new(wander_deg)?,
            })
        };
        match self {
            Self::File => None,
            Self::Exact => Some(OdometryError::default()),
            Self::D15 => drifting(1.5),
            Self::D30 => drifting(3.0),
        }
    }
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
    world: Source<'a>,
    seed: u64,
    /// `None` for the walkers of the file.
    walkers: Option<u32>,
}

/// Where the world of a drive is from.
enum Source<'a> {
    File(&'a World),
    /// The random world of the drive's seed.
    Random,
}

/// Simulates and scores every drive, in the order of worlds, numbers of walkers and seeds.
pub(super) fn sweep(options: &DriveArgs, bars: &MultiProgress) -> anyhow::Result<Report> {
    let setup = setup(&drive_settings(options)?, options);
    let worlds = options.world.iter().map(|path| read(path)).collect::<anyhow::Result<Vec<_>>>()?;
    let walkers: Vec<Option<u32>> =
        if options.walkers.is_empty() { vec![None] } else { options.walkers.iter().copied().map(Some).collect() };
    let mut tasks = Vec::new();
    for world in &worlds {
        // A world without walkers shows the walls that the filter removes for nothing.
        let walkers = if world.empty { &[Some(0)][..] } else { &walkers };
        for &walkers in walkers {
            tasks.extend(options.seeds.numbers().map(|seed| Task { world: Source::File(world), seed, walkers }));
        }
    }
    for (seeds, &walkers) in options.random.iter().flat_map(|seeds| walkers.iter().map(move |walkers| (seeds, walkers))) {
        tasks.extend(seeds.numbers().map(|seed| Task { world: Source::Random, seed, walkers }));
    }
    let bar = progress::of_drives(bars, tasks.len() as u64);
    let rows = in_parallel(&tasks, |task| drive(task, &setup, options).inspect(|_| bar.inc(1)));
    bar.finish_and_clear();
    Ok(Report::of(rows?))
}

/// The settings of the drives.
fn drive_settings(options: &DriveArgs) -> anyhow::Result<Settings> {
    let mut settings = match &options.settings {
        Some(path) => Settings::read(path)?,
        None => Settings::parse("demo.toml", built_in::DEMO)?,
    };
    settings.pace = settings::Pace::Lockstep;
    settings.process.retain(|process| !process.runs(BuiltIn::Sbs) && !process.runs(BuiltIn::Simulator));
    if !options.no_camera {
        settings.process.push(Process::built_in(BuiltIn::Sbs));
    }
    if options.odometry.is_some() && !settings.runs(BuiltIn::Localisation) {
        settings.process.push(Process::built_in(BuiltIn::Localisation));
    }
    if options.method == Method::Paper {
        (settings.fti.method, settings.std.rule) = (FtiMethod::Paper, MovingCell::Paper);
        (settings.fti.paper.cue, settings.fti.paper.action) = (Cue::Paper, Action::Free);
    }
    Ok(settings)
}

fn read(path: &Path) -> anyhow::Result<World> {
    let name = path.display().to_string();
    let text = document::read_text(path)?;
    let empty = world_file::parse(&name, &text)?.walkers.is_empty();
    Ok(World { name, text, empty })
}

/// The deployment of these settings as a sweep runs it.
fn setup(settings: &Settings, options: &DriveArgs) -> Setup {
    let camera = CameraSetup {
        optics: optics(&settings.camera),
        calibration: CalibrationError::default(),
        flaws: Flaws::default(),
        sbs: sbs::parameters(settings),
    };
    Setup {
        body: robot::body(&settings.robot),
        range_limit_m: settings.robot.range_limit_m.get(),
        camera: (!options.no_camera).then_some(camera),
        chain: chain(settings),
    }
}

fn drive(task: &Task<'_>, setup: &Setup, options: &DriveArgs) -> anyhow::Result<Row> {
    let random;
    let (name, text) = match task.world {
        Source::File(World { name, text, .. }) => (name.as_str(), text.as_str()),
        Source::Random => {
            random = world::random(task.seed)?;
            (RANDOM, random.as_str())
        }
    };
    let variation = Variation { walkers: task.walkers.map(|walkers| walkers as usize), seed: task.seed, stand_s: options.stand };
    let mut world = read_world(text, variation).map_err(|error| BadInput(format!("{name}: {error}")))?;
    if let Some(error) = options.odometry.and_then(Odometry::error) {
        world.odometry = error;
    }
    let Driven { trial, localisation, .. } = setup.run(&world, task.seed)?;
    if let Some(folder) = &options.out {
        let stem = Path::new(name).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let walkers = task.walkers.map_or_else(String::new, |walkers| format!("-{walkers}-walkers"));
        write_comparison(&folder.join(format!("{stem}{walkers}-seed-{}", task.seed)), &trial)?;
    }
    Ok(Row::new(name.to_owned(), Some(task.seed), task.walkers, &trial).with(localisation))
}

fn standing(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (0.0..=3600.0).contains(&seconds) => Ok(seconds),
        _ => Err("expected 0 to 3600 s".to_owned()),
    }
}
