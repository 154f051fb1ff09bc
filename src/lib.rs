//! The `stillmap` command, and the [processes](process) that a deployment is made of.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

mod args;
mod built_in;
mod camera;
mod check;
mod cli;
mod demo;
mod doctor;
mod drive;
mod evaluate;
mod exit;
mod figures;
mod generate;
mod inject;
mod keys;
mod list;
mod log;
mod logging;
mod logs;
mod map;
mod observed;
mod output;
mod page;
mod pioneer;
pub mod process;
mod progress;
mod replay;
mod restart;
mod run;
mod running;
mod shortfall;
mod stack;
mod status;
mod status_json;
mod stop;
mod terminal;
mod top;
mod topic;
mod world;

use clap::Parser;
use cli::Cli;
use std::process::ExitCode;

/// Runs the command that the arguments of this process name; the exit code is what the process ends with.
#[must_use]
pub fn main() -> ExitCode {
    // The kernel names a process after the file that it runs, which is `exe` where its supervisor started it. Only lists show the name.
    let _ = rustix::thread::set_name(c"stillmap");
    stack::with_enough(parse_and_carry_out)
}

fn parse_and_carry_out() -> ExitCode {
    let command = Cli::parse().command;
    let bars = terminal::bars();
    let result = if command.is_process() { logging::for_supervisor() } else { logging::for_people(bars.clone()) };
    let arguments = || args::check_tilde(std::env::args_os().skip(1)).map_err(anyhow::Error::from);
    let code = match result.and_then(|()| arguments()).and_then(|()| command.carry_out(&bars)) {
        Ok(code) => code,
        Err(error) => {
            if command.is_process() {
                tracing::error!("{error}");
            } else {
                terminal::screen().push(format!("error: {}\n", messages::printable(&error.to_string())).as_bytes());
            }
            exit::code(&error)
        }
    };
    terminal::flush();
    ExitCode::from(code)
}
