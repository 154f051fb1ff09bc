//! The `stillmap` command, and the [processes](process) that a deployment is made of.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

mod args;
mod built_in;
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
mod run;
mod running;
mod status;
mod top;

use clap::Parser;
use cli::Cli;
use indicatif::MultiProgress;
use std::io::Write;
use std::process::ExitCode;

/// Runs the command that the arguments of this process name; the exit code is what the process ends with.
#[must_use]
pub fn main() -> ExitCode {
    let command = Cli::parse().command;
    let bars = MultiProgress::new();
    let result = if command.is_process() { logging::for_supervisor() } else { logging::for_people(bars.clone()) };
    match result.and_then(|()| command.carry_out(&bars)) {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            if command.is_process() {
                tracing::error!("{error}");
            } else {
                // If standard error cannot be written to, the error is lost.
                let _ = writeln!(std::io::stderr(), "error: {error}");
            }
            ExitCode::from(exit::code(&error))
        }
    }
}
