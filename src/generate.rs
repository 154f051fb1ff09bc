//! `stillmap completions` and `stillmap man`: files for shells and manuals, from the definition of the command line.

use crate::drive::lock_folder;
use crate::output;
use clap::{Args, Command};
use clap_complete::Shell;
use std::path::PathBuf;

/// Arguments of `stillmap completions`.
#[derive(Debug, Args)]
pub(crate) struct CompletionsArgs {
    /// The shell
    #[arg(value_name = "SHELL", value_enum)]
    shell: Shell,
}

/// Arguments of `stillmap man`.
#[derive(Debug, Args)]
pub(crate) struct ManArgs {
    /// Folder for the pages; it is created if missing
    #[arg(long, value_name = "DIR", default_value = "man")]
    out: PathBuf,
}

/// Prints the completions of a shell.
pub(crate) fn completions(args: &CompletionsArgs, mut command: Command) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, "stillmap", &mut script);
    output::write(&String::from_utf8(script)?)?;
    Ok(())
}

/// Writes a page for the command and one for each subcommand.
pub(crate) fn man(args: &ManArgs, command: Command) -> anyhow::Result<()> {
    let _locked = lock_folder(&args.out)?;
    clap_mangen::generate_to(command, &args.out)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::Cli;
    use clap::CommandFactory;

    #[test]
    fn every_visible_subcommand_has_a_page() {
        let folder = tempfile::tempdir().unwrap();
        man(&ManArgs { out: folder.path().to_owned() }, Cli::command()).unwrap();
        let visible =
            Cli::command().get_subcommands().filter(|it| !it.is_hide_set()).map(|it| it.get_name().to_owned()).collect::<Vec<_>>();
        assert!(visible.len() > 15);
        for name in visible {
            let page = std::fs::read_to_string(folder.path().join(format!("stillmap-{name}.1"))).unwrap();
            assert!(page.contains(".SH DESCRIPTION"), "{name}");
        }
        assert!(!folder.path().join("stillmap-guard.1").exists(), "what the supervisor starts has no page");
    }

    #[test]
    fn completions_know_the_subcommands() {
        for shell in [Shell::Bash, Shell::Zsh, Shell::Fish] {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "stillmap", &mut script);
            assert!(String::from_utf8(script).unwrap().contains("restart"), "{shell}");
        }
    }
}
