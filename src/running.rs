//! The deployments that are running on this computer.

use crate::args::Which;
use crate::exit::BadInput;
use bus::RunningDomain;

/// The deployment that the arguments name, or the only one that is running.
pub(crate) fn choose(which: &Which) -> anyhow::Result<RunningDomain> {
    let mut running = RunningDomain::all()?;
    let names = running.iter().map(RunningDomain::name).collect::<Vec<_>>().join(", ");
    if let Some(wanted) = &which.deployment {
        let found = running.into_iter().find(|domain| domain.name() == wanted);
        let running = if names.is_empty() { "none is".to_owned() } else { format!("{names}: these are") };
        return found.ok_or_else(|| BadInput(format!("deployment {wanted} is not running ({running})")).into());
    }
    match running.len() {
        0 => Err(BadInput("no deployment is running".to_owned()).into()),
        1 => Ok(running.swap_remove(0)),
        _ => Err(BadInput(format!("several deployments are running: --deployment {}", names.replace(", ", " or "))).into()),
    }
}
