//! The command line.

use clap::{Args, Parser, Subcommand, ValueEnum};
use settings::{FaultKind, FaultLength, FaultPeriod, FaultRate, Name, OutOfRange, RoutedService};
use std::fmt::{Display, Formatter};
use std::path::PathBuf;
use std::str::FromStr;

/// Maps what stands still, from a robot that drives among people.
#[derive(Debug, Parser)]
#[command(name = "stillmap", version, arg_required_else_help = true, after_help = AFTER_HELP)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

const AFTER_HELP: &str = "\
Exit codes: 0 all went well; 1 stillmap itself could not go on; 2 a file or an argument cannot be used; \
3 the run ended, but a process had failed for good; 130 everything was killed on request.
Environment: STILLMAP_LOG=debug (or mapping=debug,…) tells more; STILLMAP_RUNTIME_DIR holds running deployments.";

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Runs the deployment that a settings file describes, until Ctrl-C or its end
    Run {
        /// The settings file
        #[arg(value_name = "FILE")]
        settings: PathBuf,
        /// Begins a new map; without it a robot's last run goes on. What there was is kept beside `state` in the folder of outputs
        #[arg(long)]
        fresh: bool,
        #[command(flatten)]
        options: RunOptions,
    },
    /// Drives a simulated robot through a hall with people in it, and maps the hall
    Demo {
        #[command(flatten)]
        options: RunOptions,
        /// Another world than the built-in hall
        #[arg(long, value_name = "FILE")]
        world: Option<PathBuf>,
    },
    /// Makes the map again from the log of a drive
    Replay {
        /// The log
        #[arg(value_name = "LOG")]
        log: PathBuf,
        /// As fast as the machine goes and the same every time, or at the pace of the drive
        #[arg(long, value_enum, default_value_t = Pace::Lockstep)]
        pace: Pace,
        #[command(flatten)]
        options: RunOptions,
    },
    /// Tells how the processes of a running deployment are
    Status {
        /// As JSON
        #[arg(long)]
        json: bool,
        #[command(flatten)]
        which: Which,
    },
    /// Shows the processes of a running deployment from second to second
    Top {
        #[command(flatten)]
        which: Which,
    },
    /// Makes the paper's figures with the code that maps
    Figures {
        /// Folder for the figures; made when it is not there
        #[arg(long, value_name = "DIR", default_value = "figures-out")]
        out: PathBuf,
    },
    /// Writes the map of a running deployment as it is now
    Map {
        /// Folder for the map; made when it is not there
        #[arg(long, value_name = "DIR", default_value = "map-out")]
        out: PathBuf,
        #[command(flatten)]
        which: Which,
    },
    /// Looks at the cameras of this computer
    #[command(subcommand)]
    Camera(CameraCommand),
    /// Looks at a robot on a serial port
    #[command(subcommand)]
    Pioneer(PioneerCommand),
    /// Disturbs a running deployment on purpose: messages of a service, or a process
    Inject(InjectOptions),
    /// Tells how good results are, against the truth
    Evaluate(EvaluateOptions),
    /// Looks at, repairs or imports logs
    #[command(subcommand)]
    Log(LogCommand),
    /// Checks a settings file, or prints what settings there are
    #[command(group = clap::ArgGroup::new("what").required(true))]
    Check {
        /// The settings file
        #[arg(value_name = "FILE", group = "what")]
        settings: Option<PathBuf>,
        /// Prints the JSON schema of settings files
        #[arg(long, group = "what")]
        schema: bool,
        /// Prints the reference of all settings
        #[arg(long, group = "what")]
        reference: bool,
    },
    /// Runs one process of a deployment; its supervisor does this
    #[command(hide = true)]
    Process {
        #[arg(value_name = "KIND")]
        kind: String,
    },
    /// Cleans up after a killed supervisor; the supervisor starts it
    #[command(hide = true)]
    Guard {
        #[arg(value_name = "DIR")]
        directory: PathBuf,
    },
}

#[derive(Debug, Clone, Args)]
pub(crate) struct RunOptions {
    /// Folder for map and log; made when it is not there
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Times faster than real time, 0.01 to 100; 1 unless it is given, for the demo 5, or 3 with `--open`
    #[arg(long, value_name = "N", value_parser = speed)]
    pub(crate) speed: Option<f64>,
    /// Opens the live page in a browser
    #[arg(long)]
    pub(crate) open: bool,
}

#[derive(Debug, Clone, Args)]
#[command(group = clap::ArgGroup::new("whom"))]
pub(crate) struct InjectOptions {
    /// To a service: drop, delay, duplicate, reorder, corrupt, stall, burst or clock; to a process: kill, stop, slow or disk; to the computer: memory
    #[arg(value_name = "KIND", value_parser = kind)]
    pub(crate) kind: FaultKind,
    /// The service, for example robot/scan; it has to go through an injector
    #[arg(long, value_name = "NAME", group = "whom", value_parser = service)]
    pub(crate) service: Option<RoutedService>,
    /// The process
    #[arg(long, value_name = "NAME", group = "whom", value_parser = process_name)]
    pub(crate) process: Option<Name>,
    /// Share of messages that are hit, or of time that a slowed process stands
    #[arg(long, value_name = "SHARE", default_value = "1", value_parser = within::<FaultRate>, allow_negative_numbers = true)]
    pub(crate) rate: FaultRate,
    /// How long, s
    #[arg(long = "for", value_name = "S", default_value = "10", value_parser = within::<FaultLength>, allow_negative_numbers = true)]
    pub(crate) for_s: FaultLength,
    /// By how much it delays or a clock is set, how often a burst comes or a kill, s
    #[arg(long = "by", value_name = "S", value_parser = within::<FaultPeriod>, allow_negative_numbers = true)]
    pub(crate) by_s: Option<FaultPeriod>,
    /// Another seed hits other messages
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    pub(crate) seed: u32,
    #[command(flatten)]
    pub(crate) which: Which,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct Which {
    /// Name of the deployment; needed when several are running
    #[arg(long, value_name = "NAME")]
    pub(crate) deployment: Option<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Pace {
    /// As fast as every process can follow; nothing is dropped
    Lockstep,
    /// At the pace of the drive, times `--speed`
    Live,
}

#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub(crate) struct EvaluateOptions {
    #[command(subcommand)]
    pub(crate) command: Option<EvaluateCommand>,
    #[command(flatten)]
    pub(crate) drives: DriveOptions,
}

#[derive(Debug, Clone, Args)]
#[command(group = clap::ArgGroup::new("drives").required(true))]
pub(crate) struct DriveOptions {
    /// A simulated drive: its log, or the folder that holds it
    #[arg(value_name = "RUN", group = "drives")]
    pub(crate) run: Option<PathBuf>,
    /// Worlds to drive through in this process, without a bus: every seed with every number of walkers
    #[arg(long, value_name = "FILE", group = "drives", num_args = 1..)]
    pub(crate) world: Vec<PathBuf>,
    /// Seeds of noise and of when and where the walkers walk
    #[arg(long, value_name = "FIRST..LAST", default_value = "1..2", requires = "world")]
    pub(crate) seeds: NumberRange,
    /// Numbers of walkers; those of the file when not given
    #[arg(long, value_name = "N,N", value_delimiter = ',', requires = "world")]
    pub(crate) walkers: Vec<u32>,
    /// Everyone stands for so long on his way, at each of its places but the last; as the file says when not given
    #[arg(long, value_name = "SECONDS", value_parser = standing, requires = "world")]
    pub(crate) stand: Option<f64>,
    /// What decides about readings
    #[arg(long, value_enum, default_value_t = Rule::Full, requires = "world")]
    pub(crate) rule: Rule,
    /// So many times the usual errors of the camera's calibration
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = factor, requires = "world")]
    pub(crate) errors: f64,
    /// A settings file whose sections to go by in the worlds; those of the demo when not given
    #[arg(long, value_name = "FILE", requires = "world")]
    pub(crate) settings: Option<PathBuf>,
    /// Folder for a picture of each drive: every reading beside what is left; made when it is not there
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// As JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// What decides about readings in a sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Rule {
    /// As the settings say, by sonars and camera
    Full,
    /// The same without a camera
    Sonar,
    /// The paper as printed, with a camera that makes no mistakes
    Paper,
}

#[derive(Debug, Subcommand)]
pub(crate) enum CameraCommand {
    /// Tells which cameras there are, and what formats, sizes and controls they have
    List {
        /// Only this one
        #[arg(value_name = "DEVICE")]
        device: Option<PathBuf>,
        /// Selects one of its inputs first, counted from 0
        #[arg(long, value_name = "N", requires = "device")]
        input: Option<u32>,
    },
    /// Takes a picture
    Snapshot {
        /// The camera, such as /dev/video0
        #[arg(value_name = "DEVICE")]
        device: PathBuf,
        /// The picture's file
        #[arg(long, value_name = "FILE.png")]
        out: PathBuf,
        /// Its size
        #[arg(long, value_name = "WxH", default_value = "160x120", value_parser = size)]
        size: (u32, u32),
        /// One of the camera's inputs, counted from 0; the one that is selected when not given
        #[arg(long, value_name = "N")]
        input: Option<u32>,
    },
}

#[derive(Debug, Subcommand)]
pub(crate) enum PioneerCommand {
    /// Tells what answers on a port: who, at which speed, which sonars fire. Nothing moves
    Probe {
        /// The port, such as /dev/ttyUSB0
        #[arg(value_name = "PORT")]
        port: PathBuf,
    },
}

#[derive(Debug, Subcommand)]
pub(crate) enum EvaluateCommand {
    /// Scores what moves in a camera's pictures: finds it and compares it with the truth, pixel by pixel
    Camera(CameraOptions),
}

#[derive(Debug, Clone, Args)]
pub(crate) struct CameraOptions {
    /// The pictures: YUV4MPEG2, 8 bits, 80 × 60 to 640 × 480
    #[arg(value_name = "FRAMES.y4m")]
    pub(crate) frames_file: PathBuf,
    /// The truth: 0 still, 50 shadow, 85 and 170 not scored, 255 moving
    #[arg(value_name = "LABELS.y4m")]
    pub(crate) labels_file: PathBuf,
    /// As JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// Folder for pictures and a log of frame, mask and truth of each scored frame; made when it is not there
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Frames that are scored, counted from 0
    #[arg(long, value_name = "FIRST..LAST", default_value = "30..119")]
    pub(crate) frames: NumberRange,
    /// Row of the horizon as a share of the height: shadow is looked for below it; 0 for a camera that looks down, 1 for no shadow
    #[arg(long, value_name = "SHARE", default_value_t = 0.5, value_parser = share)]
    pub(crate) horizon: f32,
    /// How the camera's own motion is found
    #[arg(long, value_enum, default_value_t = Compensation::Direct)]
    pub(crate) compensation: Compensation,
}

/// Whole numbers from one to another, both included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct NumberRange {
    pub(crate) first: u64,
    pub(crate) last: u64,
}

impl FromStr for NumberRange {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let parsed = || {
            let (first, last) = text.split_once("..")?;
            Some(Self { first: first.parse().ok()?, last: last.parse().ok()? })
        };
        parsed().filter(|range| range.first <= range.last).ok_or("expected two whole numbers as in 30..119, the smaller one first")
    }
}

impl Display for NumberRange {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} to {}", self.first, self.last)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Compensation {
    /// From all pixels at once, by robust Gauss–Newton
    Direct,
    /// From landmarks, by iterative closest point
    Icp,
}

impl From<Compensation> for sbs::Method {
    fn from(compensation: Compensation) -> Self {
        match compensation {
            Compensation::Direct => Self::Direct,
            Compensation::Icp => Self::Icp,
        }
    }
}

#[derive(Debug, Subcommand)]
pub(crate) enum LogCommand {
    /// Tells what a log holds
    Info {
        /// The log
        #[arg(value_name = "FILE")]
        log: PathBuf,
    },
    /// Writes what can be read of a damaged log into a new one
    Recover {
        /// The damaged log
        #[arg(value_name = "FILE")]
        log: PathBuf,
        /// The new log; FILE with `-recovered` before its extension when not given
        #[arg(long, value_name = "LOG")]
        out: Option<PathBuf>,
    },
    /// Makes a log from recordings of other software
    Import {
        /// What DIR holds
        #[arg(long, value_enum)]
        format: ImportFormat,
        /// Folder of the recording
        #[arg(value_name = "DIR")]
        from: PathBuf,
        /// The log to write
        #[arg(long, value_name = "LOG")]
        out: PathBuf,
    },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ImportFormat {
    /// The occupancy grid exercise of RoboND: measurement.txt and poses.txt
    Robond,
}

fn size(text: &str) -> Result<(u32, u32), String> {
    let numbers = text.split_once('x').and_then(|(width, height)| width.parse().ok().zip(height.parse().ok()));
    let sound = |&(width, height): &(u32, u32)| (1..=8192).contains(&width) && (1..=8192).contains(&height);
    numbers.filter(sound).ok_or_else(|| "expected WIDTHxHEIGHT in pixels, such as 160x120".to_owned())
}

fn speed(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(speed) if (0.01..=100.0).contains(&speed) => Ok(speed),
        _ => Err("expected a number from 0.01 to 100".to_owned()),
    }
}

fn kind(text: &str) -> Result<FaultKind, String> {
    FaultKind::ALL
        .into_iter()
        .find(|kind| kind.name() == text)
        .ok_or_else(|| format!("expected {}", one_of(FaultKind::ALL.map(FaultKind::name))))
}

fn service(text: &str) -> Result<RoutedService, String> {
    let all = RoutedService::ALL;
    all.into_iter().find(|service| service.name() == text).ok_or_else(|| format!("expected {}", one_of(all.map(RoutedService::name))))
}

fn one_of<const N: usize>(words: [&str; N]) -> String {
    words.split_last().map_or_else(String::new, |(last, others)| format!("{} or {last}", others.join(", ")))
}

fn process_name(text: &str) -> Result<Name, String> {
    Name::try_from(text.to_owned()).map_err(|error| error.to_string())
}

/// A number within the limits of its setting.
fn within<T: TryFrom<f64, Error = OutOfRange>>(text: &str) -> Result<T, String> {
    // What is no number is within no limits.
    let number = text.parse().unwrap_or(f64::NAN);
    T::try_from(number).map_err(|refused| format!("expected {}", refused.expected))
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

fn share(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(share) if (0.0..=1.0).contains(&share) => Ok(share),
        _ => Err("expected a number from 0 to 1".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_sound() {
        Cli::command().debug_assert();
    }

    #[test]
    fn a_size_is_two_numbers_of_pixels() {
        assert_eq!(size("160x120"), Ok((160, 120)));
        for wrong in ["", "160", "160x", "x120", "0x120", "160x9000", "160×120", "-1x2", "160x120x3"] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_speed_is_a_number_that_can_be_meant() {
        assert_eq!(speed("2.5"), Ok(2.5));
        for wrong in ["", "0", "-1", "nan", "inf", "1000", "fast"] {
            assert!(speed(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_fault_names_what_there_is_and_numbers_that_can_be_meant() {
        assert_eq!((kind("drop"), service("map/verdict")), (Ok(FaultKind::Drop), Ok(RoutedService::Verdict)));
        assert!(kind("Drop").unwrap_err().ends_with("slow, disk or memory"));
        assert_eq!(service("map/tile"), Err("expected robot/scan, motion/sonar, motion/camera or map/verdict".to_owned()));
        assert!(process_name("std").is_ok() && process_name("../std").is_err());
        assert_eq!(within::<FaultRate>("0.5").map(FaultRate::get), Ok(0.5));
        for wrong in ["", "-0.1", "1.1", "nan", "inf", "half"] {
            assert_eq!(within::<FaultRate>(wrong), Err("expected 0 to 1".to_owned()), "{wrong}");
        }
    }

    #[test]
    fn a_number_below_zero_is_refused_for_what_it_is() {
        for option in ["--rate", "--for", "--by", "--seed"] {
            let error = Cli::try_parse_from(["stillmap", "inject", "drop", option, "-5"]).unwrap_err().to_string();
            assert!(error.contains(option) && error.contains("-5") && !error.contains("unexpected argument"), "{error}");
        }
    }

    #[test]
    fn a_range_of_frames_runs_forwards() {
        assert_eq!("30..119".parse(), Ok(NumberRange { first: 30, last: 119 }));
        for wrong in ["", "30", "..", "30..", "..119", "119..30", "-1..4", "a..b", "1..2..3"] {
            assert!(wrong.parse::<NumberRange>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_share_lies_within_0_and_1() {
        assert_eq!(share("0.5"), Ok(0.5));
        for wrong in ["", "-0.1", "1.1", "nan", "half"] {
            assert!(share(wrong).is_err(), "{wrong}");
        }
    }
}
