//! The deployments that are running on this computer.

use crate::args::Which;
use crate::exit::{BadInput, NotRunning};
use bus::RunningDomain;
use std::collections::BTreeSet;
use std::os::unix::fs::MetadataExt;

/// The deployment that the arguments name, or the only one that is running.
pub(crate) fn choose(which: &Which) -> anyhow::Result<RunningDomain> {
    let mut running = RunningDomain::all()?;
    let names = running.iter().map(RunningDomain::name).collect::<Vec<_>>().join(", ");
    if let Some(wanted) = &which.deployment {
        let found = running.into_iter().find(|domain| domain.name() == wanted);
        let running = if names.is_empty() { "none is".to_owned() } else { format!("{names}: these are") };
        return found.ok_or_else(|| NotRunning(format!("deployment {wanted} is not running ({running})")).into());
    }
    match running.len() {
        0 => Err(NotRunning(none_running()).into()),
        1 => Ok(running.swap_remove(0)),
        _ => Err(BadInput(format!("several deployments are running: --deployment {}", names.replace(", ", " or "))).into()),
    }
}

/// A line that no deployment of this user is running. Shared memory shows the deployments of other users and of other runtime folders,
/// and what killed ones left.
pub(crate) fn none_running() -> String {
    let entries = std::fs::read_dir("/dev/shm").into_iter().flatten().flatten();
    let ours = entries.filter(|entry| entry.file_name().as_encoded_bytes().starts_with(b"stillmap_"));
    let owners: BTreeSet<u32> = ours.filter_map(|entry| Some(entry.metadata().ok()?.uid())).collect();
    let user = rustix::process::getuid().as_raw();
    let hints = owners.into_iter().map(|owner| match owner == user {
        true => "; there is shared memory of one with another STILLMAP_RUNTIME_DIR or XDG_RUNTIME_DIR".to_owned(),
        false => format!("; there is shared memory of one of user {}: only that user has access", user_name(owner)),
    });
    let folder = RunningDomain::folder().map_or_else(|error| error.to_string(), |folder| folder.display().to_string());
    std::iter::once(format!("no deployment of user {} is running in {folder}", user_name(user))).chain(hints).collect()
}

/// The name of a user, or else the number.
pub(crate) fn user_name(uid: u32) -> String {
    let passwd = std::fs::read_to_string("/etc/passwd").unwrap_or_default();
    let mut entries = passwd.lines().map(|line| line.split(':').collect::<Vec<_>>());
    let entry = entries.find(|fields| fields.get(2).and_then(|field| field.parse().ok()) == Some(uid));
    entry.and_then(|fields| Some((*fields.first()?).to_owned())).unwrap_or_else(|| uid.to_string())
}
