//! The limit of open files, raised as far as the system allows before the first process starts.

use crate::running::RunError;
use bus::needed_descriptors;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

/// As far as the limit is raised: programs that use select(2), or close every possible descriptor, suffer from more.
const ENOUGH: u64 = 4096;

/// Raises the limit of open files of this process, and of those that it starts. Fails if it stays too low for `processes` of them.
pub(crate) fn raise_open_files(processes: usize) -> Result<(), RunError> {
    let needed = needed_descriptors(processes);
    let found = getrlimit(Resource::Nofile);
    let raised = raised(found, needed);
    if raised != found.current {
        // Within the hard limit this is always allowed.
        let _ = setrlimit(Resource::Nofile, Rlimit { current: raised, ..found });
    }
    match getrlimit(Resource::Nofile).current {
        Some(limit) if limit < needed => Err(RunError::OpenFiles { limit, needed }),
        Some(_) | None => Ok(()),
    }
}

/// The new limit; `None` is none.
fn raised(found: Rlimit, needed: u64) -> Option<u64> {
    let wanted = found.current?.max(needed).max(ENOUGH);
    Some(found.maximum.map_or(wanted, |most| wanted.min(most)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_is_raised_within_the_hard_one_and_never_lowered() {
        let raised = |current, maximum| raised(Rlimit { current, maximum }, 300);
        assert_eq!(raised(Some(256), Some(1 << 20)), Some(ENOUGH));
        assert_eq!(raised(Some(256), None), Some(ENOUGH));
        assert_eq!(raised(Some(256), Some(280)), Some(280));
        assert_eq!(raised(Some(9000), Some(9000)), Some(9000));
        assert_eq!(raised(None, None), None);
    }
}
