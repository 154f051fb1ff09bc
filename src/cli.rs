//! The command line: the subcommands and how each is carried out.

use crate::args::Which;
use crate::camera::{self, CameraCommand};
use crate::check::{self, CheckArgs};
use crate::demo::{self, DemoArgs};
use crate::doctor::{self, DoctorArgs};
use crate::evaluate::{self, EvaluateArgs};
use crate::figures::{self, FiguresArgs};
use crate::generate::{self, CompletionsArgs, ManArgs};
use crate::inject::{self, InjectArgs};
use crate::log::{self, LogCommand};
use crate::logs::{self, LogsArgs};
use crate::map::{self, MapArgs};
use crate::pioneer::{self, PioneerCommand};
use crate::replay::{self, ReplayArgs};
use crate::restart::{self, RestartArgs};
use crate::run::{self, RunArgs};
use crate::status::{self, StatusArgs};
use crate::topic::{self, TopicCommand};
use crate::world::{self, WorldArgs};
use crate::{exit, list, process, stop, top};
use clap::{CommandFactory, Parser, Subcommand};
use indicatif::MultiProgress;
use std::path::PathBuf;

/// Builds a map of what stands still, with a robot that drives among people
#[derive(Debug, Parser)]
#[command(name = "stillmap", version, arg_required_else_help = true, max_term_width = 100, after_help = format!("{}\n\n{ENVIRONMENT}", exit::HELP))]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

const ENVIRONMENT: &str = "\
Environment:
  STILLMAP_LOG          Level of log lines: error, warn, info, debug or trace; or a list of levels
                        by module, such as info,mapping=debug.
  STILLMAP_RUNTIME_DIR  Folder of the running deployments.
  NO_COLOR              If not empty, no text is coloured.";

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Runs the deployment of a settings file until it ends or is interrupted with Ctrl-C
    Run(RunArgs),
    /// Runs the built-in demo: a simulated robot maps a hall in which people walk
    Demo(DemoArgs),
    /// Replays the log of a drive and builds its map again
    Replay(ReplayArgs),
    /// Lists the running deployments
    List,
    /// Prints the state of every process of the running deployments
    Status(StatusArgs),
    /// Shows a table of the processes of a running deployment that is updated every second
    Top(Which),
    /// Prints the last log lines of a running deployment
    Logs(LogsArgs),
    /// Restarts a process of a running deployment from its checkpoint
    Restart(RestartArgs),
    /// Ends a running deployment in order and waits until its map is written
    Stop(Which),
    /// Lists the topics of a deployment, or prints messages or rates of one in a running deployment
    #[command(subcommand)]
    Topic(TopicCommand),
    /// Draws the figures of the paper with the code that runs in a deployment
    Figures(FiguresArgs),
    /// Writes the current map of a running deployment to files
    Map(MapArgs),
    /// Lists the cameras of this computer, or takes a picture with one
    #[command(subcommand)]
    Camera(CameraCommand),
    /// Identifies a robot at a serial port
    #[command(subcommand)]
    Pioneer(PioneerCommand),
    /// Injects a fault into a running deployment
    Inject(InjectArgs),
    /// Scores results against the truth: the maps of simulated drives, or camera masks
    Evaluate(EvaluateArgs),
    /// Describes, cuts, merges, recovers, imports or exports logs
    #[command(subcommand)]
    Log(LogCommand),
    /// Makes a random world for the simulator
    World(WorldArgs),
    /// Checks a settings file or a world, or prints the reference of all settings or of the messages on the bus
    Check(CheckArgs),
    /// Checks whether this computer can run a deployment, and names remedies
    Doctor(DoctorArgs),
    /// Prints the completions of a shell
    Completions(CompletionsArgs),
    /// Writes the manual pages
    Man(ManArgs),
    /// Runs one process of a deployment; the supervisor starts it
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

impl Command {
    /// Whether it is a process of a deployment, whose log lines go to its supervisor.
    pub(crate) fn is_process(&self) -> bool {
        matches!(self, Self::Process { .. })
    }

    /// Carries it out; the exit code.
    pub(crate) fn carry_out(&self, bars: &MultiProgress) -> anyhow::Result<u8> {
        match self {
            Self::Run(args) => return run::run(args, bars),
            Self::Demo(args) => return demo::demo(args, bars),
            Self::Replay(args) => return replay::replay(args, bars),
            Self::List => return list::list(),
            Self::Status(args) => return status::status(args),
            Self::Map(args) => return map::map(args),
            Self::Logs(args) => logs::logs(args)?,
            Self::Restart(args) => restart::restart(args)?,
            Self::Stop(which) => stop::stop(which)?,
            Self::Top(which) => top::top(which)?,
            Self::Topic(command) => topic::topic(command)?,
            Self::Figures(args) => figures::figures(args)?,
            Self::Camera(command) => camera::camera(command)?,
            Self::Pioneer(command) => pioneer::pioneer(command)?,
            Self::Inject(args) => inject::inject(args)?,
            Self::Evaluate(args) => evaluate::evaluate(args, bars)?,
            Self::Log(command) => return log::log(command),
            Self::World(args) => world::world(args)?,
            Self::Check(args) => check::check(args)?,
            Self::Doctor(args) => return doctor::doctor(args),
            Self::Completions(args) => generate::completions(args, Cli::command())?,
            Self::Man(args) => generate::man(args, Cli::command())?,
            Self::Process { kind } => process::process(kind)?,
            Self::Guard { directory } => supervisor::guard(directory)?,
        }
        Ok(exit::SUCCESS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_sound() {
        Cli::command().debug_assert();
    }

    #[test]
    fn a_number_below_zero_is_refused_for_what_it_is() {
        for option in ["--rate", "--for", "--by", "--seed"] {
            let error = Cli::try_parse_from(["stillmap", "inject", "drop", option, "-5"]).unwrap_err().to_string();
            assert!(error.contains(option) && error.contains("-5") && !error.contains("unexpected argument"), "{error}");
        }
    }
}
