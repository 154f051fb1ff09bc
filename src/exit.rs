//! The exit codes of the command. Every subcommand ends with one of these, and every error is turned into one here.
//!
//! | code | constant | meaning |
//! | --- | --- | --- |
//! | 0 | [`SUCCESS`] | Everything that was asked for is done. A run ended by itself, or stopped in order when it was asked to. |
//! | 1 | [`FAILURE`] | stillmap itself failed, or a deployment did not answer. |
//! | 2 | [`BAD_INPUT`] | An argument, or a file that it names, is invalid; `check`: a program or device that the settings name is missing. |
//! | 3 | [`INCOMPLETE`] | `run`, `demo`, `replay`, `status`: a process failed for good or had to be killed. `run`, `demo`, `replay`, `map`: the map is too large for one picture, and a part of it is not drawn. `run`, `demo`: messages were not recorded, or a part of the log was removed, moved or truncated. `replay`: a part of the log is missing. `log info`: the log is damaged, or parts, scans or pictures of it are missing. `doctor`: a run is not possible. |
//! | 4 | [`NOT_RUNNING`] | No deployment is running, or none of the given name. |
//! | 70 | [`BROKEN_DOMAIN`] | The shared memory of the deployment is damaged. The supervisor creates it anew on this code. |
//! | 130 | | The second request to stop killed every process. |
//!
//! The codes of a run, 0 to 3 and 130, are those of [`supervisor::Outcome::exit_code`].

use bus::BusError;

/// Everything that was asked for is done.
pub(crate) const SUCCESS: u8 = 0;
/// stillmap itself failed.
pub(crate) const FAILURE: u8 = 1;
/// An argument, or a file that it names, is invalid.
pub(crate) const BAD_INPUT: u8 = supervisor::EXIT_BAD_INPUT;
/// A process failed for good, or a result is incomplete.
pub(crate) const INCOMPLETE: u8 = supervisor::EXIT_INCOMPLETE;
/// No deployment is running, or none of the given name.
pub(crate) const NOT_RUNNING: u8 = 4;
/// The shared memory of the deployment is damaged.
pub(crate) const BROKEN_DOMAIN: u8 = bus::EXIT_BROKEN_DOMAIN;

/// The codes as `stillmap --help` lists them.
pub(crate) const HELP: &str = "\
Exit codes:
    0  Everything that was asked for is done.
    1  stillmap itself failed, or a deployment did not answer.
    2  An argument, or a file that it names, is invalid.
    3  A process failed for good or had to be killed, a map or log is incomplete,
       or `doctor` found a fault.
    4  No deployment is running, or none of the given name.
   70  The shared memory of the deployment is damaged.
  130  A second request to stop killed every process.";

/// An invalid file or argument, described in one line.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct BadInput(pub(crate) String);

/// A deployment that does not run, described in one line.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct NotRunning(pub(crate) String);

/// The exit code for an error. An invalid input anywhere in its chain of causes decides before a broken domain does.
pub(crate) fn code(error: &anyhow::Error) -> u8 {
    let broken = |error: &(dyn std::error::Error + 'static)| error.downcast_ref::<BusError>().is_some_and(BusError::is_broken_domain);
    if error.chain().any(blames_input) {
        BAD_INPUT
    } else if error.is::<NotRunning>() {
        NOT_RUNNING
    } else if error.chain().any(broken) {
        BROKEN_DOMAIN
    } else {
        FAILURE
    }
}

fn blames_input(error: &(dyn std::error::Error + 'static)) -> bool {
    error.is::<BadInput>()
        || error.is::<document::DocumentError>()
        || error.is::<drivelog::LogError>()
        || error.is::<ros2::BagError>()
        || error.is::<mapping::ParametersError>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn help_lists_every_code() {
        for code in [SUCCESS, FAILURE, BAD_INPUT, INCOMPLETE, NOT_RUNNING, BROKEN_DOMAIN, 130] {
            assert!(HELP.lines().any(|line| line.starts_with(&format!("{code:>5}  "))), "{code}");
        }
    }

    #[test]
    fn a_cause_decides_at_any_depth() {
        let refused = settings::Settings::parse("a.toml", "name = 1").unwrap_err();
        let step: runtime::StepError = Box::new(refused);
        assert_eq!(code(&anyhow::Error::new(runtime::RunError::Step(step))), 2);
        assert_eq!(code(&anyhow::Error::new(BadInput("no".to_owned()))), 2);
        assert_eq!(code(&anyhow::Error::new(NotRunning("no".to_owned()))), 4);
        let broken = BusError::BrokenDomain { service: "robot/scan", detail: String::new() };
        assert_eq!(code(&anyhow::Error::new(runtime::RunError::Bus(broken))), BROKEN_DOMAIN);
        assert_eq!(code(&anyhow::anyhow!("anything")), 1);
    }
}
