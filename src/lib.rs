//! The `stillmap` command, and the [processes](process) that a deployment is made of.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

mod camera;
mod check;
mod cli;
mod demo;
mod drive;
mod evaluate;
mod exit;
mod figures;
mod inject;
mod log;
mod logging;
mod map;
mod output;
mod page;
mod pioneer;
pub mod process;
mod progress;
mod replay;
mod status;
mod top;

use clap::Parser;
use cli::{Cli, Command};
use indicatif::MultiProgress;
use settings::BuiltIn;
use std::io::Write;
use std::process::ExitCode;
use supervisor::Options;

/// Runs the command that the arguments of this process name; the exit code is what the process ends with.
#[must_use]
pub fn main() -> ExitCode {
    let command = Cli::parse().command;
    // What a process says goes to its supervisor; everything else goes to people.
    let is_process = matches!(command, Command::Process { .. });
    let bars = MultiProgress::new();
    let result = if is_process { logging::to_the_supervisor() } else { logging::to_people(bars.clone()) };
    match result.and_then(|()| carry_out(command, &bars)) {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            if is_process {
                tracing::error!("{error}");
            } else {
                // Nowhere is left to complain of standard error.
                let _ = writeln!(std::io::stderr(), "error: {error}");
            }
            ExitCode::from(exit::code(&error))
        }
    }
}

fn carry_out(command: Command, bars: &MultiProgress) -> anyhow::Result<u8> {
    match command {
        Command::Run { settings, fresh, options } => run(&settings, fresh, &options, bars),
        Command::Demo { options, world } => demo::demo(&options, world.as_deref(), bars),
        Command::Replay { log, pace, options } => replay::replay(&log, pace, &options, bars),
        Command::Status { json, which } => status::status(json, &which),
        Command::Top { which } => top::top(&which),
        Command::Figures { out } => figures::figures(&out),
        Command::Map { out, which } => map::map(&out, &which),
        Command::Camera(command) => camera::camera(&command),
        Command::Pioneer(command) => pioneer::pioneer(&command),
        Command::Inject(options) => inject::inject(&options),
        Command::Evaluate(command) => evaluate::evaluate(&command, bars),
        Command::Log(command) => log::log(&command),
        Command::Check { settings: Some(settings), .. } => check::check(&settings),
        Command::Check { schema: true, .. } => print(&settings::schema()),
        Command::Check { .. } => print(&settings::reference()),
        Command::Process { kind } => process::process(&kind),
        Command::Guard { directory } => {
            supervisor::guard(&directory)?;
            Ok(0)
        }
    }
}

fn run(path: &std::path::Path, fresh: bool, options: &cli::RunOptions, bars: &MultiProgress) -> anyhow::Result<u8> {
    let mut settings = check::read(path)?;
    drive::place_output(&mut settings, options)?;
    tracing::info!("deployment {}: Ctrl-C ends it, and the map is written", settings.name);
    // A simulated robot and a log begin at their beginning each time; a real robot is where it was.
    let begins_anew = settings.runs(BuiltIn::Simulator) || settings.runs(BuiltIn::Playback);
    let state = (!begins_anew).then(|| settings.out.join("state"));
    let run = Options { state, fresh, ..drive::once(options.speed.unwrap_or(1.0))? };
    drive::drive(&settings, &run, options.open, bars)
}

fn print(text: &str) -> anyhow::Result<u8> {
    output::write(text)?;
    Ok(0)
}
