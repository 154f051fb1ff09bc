//! The command line: the subcommands and how each is carried out.

use crate::args::Which;
use crate::camera::{self, CameraCommand};
use crate::check::{self, CheckArgs};
use crate::demo::{self, DemoArgs};
use crate::evaluate::{self, EvaluateArgs};
use crate::figures::{self, FiguresArgs};
use crate::inject::{self, InjectArgs};
use crate::log::{self, LogCommand};
use crate::map::{self, MapArgs};
use crate::pioneer::{self, PioneerCommand};
use crate::replay::{self, ReplayArgs};
use crate::run::{self, RunArgs};
use crate::status::{self, StatusArgs};
use crate::{exit, process, top};
use clap::{Parser, Subcommand};
use indicatif::MultiProgress;
use std::path::PathBuf;

/// Maps what stands still, from a robot that drives among people.
#[derive(Debug, Parser)]
#[command(name = "stillmap", version, arg_required_else_help = true, after_help = format!("{}\n\n{ENVIRONMENT}", exit::HELP))]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

const ENVIRONMENT: &str = "\
Environment:
  STILLMAP_LOG          Level of log lines: error, warn, info, debug or trace, or one for each module, as in info,mapping=debug.
  STILLMAP_RUNTIME_DIR  Folder of the running deployments.";

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Runs the deployment that a settings file describes, until Ctrl-C or its end
    Run(RunArgs),
    /// Drives a simulated robot through a hall with people in it, and maps the hall
    Demo(DemoArgs),
    /// Makes the map again from the log of a drive
    Replay(ReplayArgs),
    /// Tells how the processes of a running deployment are
    Status(StatusArgs),
    /// Shows the processes of a running deployment from second to second
    Top(Which),
    /// Makes the paper's figures with the code that maps
    Figures(FiguresArgs),
    /// Writes the map of a running deployment as it is now
    Map(MapArgs),
    /// Looks at the cameras of this computer
    #[command(subcommand)]
    Camera(CameraCommand),
    /// Looks at a robot on a serial port
    #[command(subcommand)]
    Pioneer(PioneerCommand),
    /// Disturbs a running deployment on purpose: messages of a service, or a process
    Inject(InjectArgs),
    /// Tells how good results are, against the truth
    Evaluate(EvaluateArgs),
    /// Looks at, repairs or imports logs
    #[command(subcommand)]
    Log(LogCommand),
    /// Checks a settings file, or prints what settings there are
    Check(CheckArgs),
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
            Self::Status(args) => return status::status(args),
            Self::Top(which) => top::top(which)?,
            Self::Figures(args) => figures::figures(args)?,
            Self::Map(args) => map::map(args)?,
            Self::Camera(command) => camera::camera(command)?,
            Self::Pioneer(command) => pioneer::pioneer(command)?,
            Self::Inject(args) => inject::inject(args)?,
            Self::Evaluate(args) => evaluate::evaluate(args, bars)?,
            Self::Log(command) => log::log(command)?,
            Self::Check(args) => check::check(args)?,
            Self::Process { kind } => process::process(kind)?,
            Self::Guard { directory } => supervisor::guard(directory)?,
        }
        Ok(exit::SUCCESS)
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
    fn a_number_below_zero_is_refused_for_what_it_is() {
        for option in ["--rate", "--for", "--by", "--seed"] {
            let error = Cli::try_parse_from(["stillmap", "inject", "drop", option, "-5"]).unwrap_err().to_string();
            assert!(error.contains(option) && error.contains("-5") && !error.contains("unexpected argument"), "{error}");
        }
    }
}
