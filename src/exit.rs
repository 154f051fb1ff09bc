//! What an exit code says, and which error gives which.

use bus::{BusError, EXIT_BROKEN_DOMAIN};
use supervisor::EXIT_BAD_INPUT;

/// A file or argument that cannot be used; one line.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct BadInput(pub(crate) String);

/// The exit code for an error: 2 when the input is to blame, that of a broken domain, or else 1.
pub(crate) fn code(error: &anyhow::Error) -> u8 {
    let broken = |error: &(dyn std::error::Error + 'static)| error.downcast_ref::<BusError>().is_some_and(BusError::is_broken_domain);
    if error.chain().any(blames_input) {
        EXIT_BAD_INPUT
    } else if error.chain().any(broken) {
        EXIT_BROKEN_DOMAIN
    } else {
        1
    }
}

fn blames_input(error: &(dyn std::error::Error + 'static)) -> bool {
    error.is::<BadInput>()
        || error.is::<settings::SettingsError>()
        || error.is::<drivelog::LogError>()
        || error.is::<mapping::ParametersError>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cause_decides_however_deep_it_lies() {
        let refused = settings::Settings::parse("a.toml", "name = 1").unwrap_err();
        let step: bus::StepError = Box::new(refused);
        assert_eq!(code(&anyhow::Error::new(bus::RunError::Step(step))), 2);
        assert_eq!(code(&anyhow::Error::new(BadInput("no".to_owned()))), 2);
        let broken = BusError::BrokenDomain { service: "robot/scan", detail: String::new() };
        assert_eq!(code(&anyhow::Error::new(bus::RunError::Bus(broken))), EXIT_BROKEN_DOMAIN);
        assert_eq!(code(&anyhow::anyhow!("anything")), 1);
    }
}
