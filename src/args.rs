//! Arguments that several subcommands have.

use crate::exit::BadInput;
use clap::Args;
use std::ffi::OsString;
use std::fmt::{Display, Formatter};
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

#[derive(Debug, Clone, Args)]
pub(crate) struct RunOptions {
    /// Folder for the map and the log; it is created if missing
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Speed relative to real time, from 0.01 to 100. The default is 1; for the demo it is 5, or 3 with --open
    #[arg(long, value_name = "N", value_parser = speed)]
    pub(crate) speed: Option<f64>,
    /// Open the live page in a browser
    #[arg(long)]
    pub(crate) open: bool,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct Which {
    /// Name of the deployment; required if several are running
    #[arg(long, value_name = "NAME")]
    pub(crate) deployment: Option<String>,
}

/// Whole numbers from one to another, both included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct NumberRange {
    pub(crate) first: u64,
    pub(crate) last: u64,
}

impl NumberRange {
    /// The numbers in ascending order.
    pub(crate) fn numbers(self) -> RangeInclusive<u64> {
        self.first..=self.last
    }
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

/// Fails for an argument that begins with `~/`, as in `--out=~/maps`: shells do not expand it there, and a folder named `~` would be
/// created.
pub(crate) fn check_tilde(arguments: impl Iterator<Item = OsString>) -> Result<(), BadInput> {
    for argument in arguments {
        let text = argument.to_string_lossy();
        let value = text.split_once('=').filter(|(option, _)| option.starts_with("--")).map_or(&*text, |(_, value)| value);
        if value.starts_with("~/") || value == "~" {
            return Err(BadInput(format!("{text}: the shell has not expanded ~: put a space before it, or the name of the folder")));
        }
    }
    Ok(())
}

/// A time in seconds.
pub(crate) fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    seconds.ok_or_else(|| "expected seconds, from 0 on".to_owned())
}

fn speed(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(speed) if (0.01..=100.0).contains(&speed) => Ok(speed),
        _ => Err("expected a number from 0.01 to 100".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_speed_lies_between_0_01_and_100() {
        assert_eq!(speed("2.5"), Ok(2.5));
        for wrong in ["", "0", "-1", "nan", "inf", "1000", "fast"] {
            assert!(speed(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_tilde_that_no_shell_expanded_is_refused() {
        let refused = |words: &[&str]| check_tilde(words.iter().map(OsString::from)).is_err();
        for words in [&["run", "--out=~/x"][..], &["run", "~/x.toml"], &["map", "--out", "~"]] {
            assert!(refused(words), "{words:?}");
        }
        for words in [&["run", "/home/me/x.toml"][..], &["run", "./~/x.toml"], &["run", "x~.toml"], &["inject", "--seed=1"]] {
            assert!(!refused(words), "{words:?}");
        }
    }

    #[test]
    fn a_range_is_ascending() {
        assert_eq!("30..119".parse(), Ok(NumberRange { first: 30, last: 119 }));
        for wrong in ["", "30", "..", "30..", "..119", "119..30", "-1..4", "a..b", "1..2..3"] {
            assert!(wrong.parse::<NumberRange>().is_err(), "{wrong}");
        }
    }
}
