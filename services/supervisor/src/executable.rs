//! The executable that runs the supervisor, its guard and the built-in processes.

use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;

/// The command of this executable, under the name that it was started by.
pub(crate) fn own_command(executable: &Path) -> Command {
    let mut command = Command::new(executable);
    if let Some(name) = std::env::args_os().next() {
        command.arg0(name);
    }
    command
}
