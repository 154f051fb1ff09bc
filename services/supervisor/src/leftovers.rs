//! Processes that a child started and that left its process group, and ended processes that no process waits for.
//!
//! A signal to a child's group does not reach what has a session of its own, as daemons and terminals do. They still carry the
//! environment of the child: the run, the domain and the process it was started as.

use rustix::process::{Pid, Signal, WaitOptions, getpid, getuid, kill_process, waitpid};
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// Variables of the environment that [`bus::Membership`] gives a child.
pub(crate) const DOMAIN: &str = "STILLMAP_DOMAIN";
pub(crate) const PROCESS: &str = "STILLMAP_PROCESS";
/// Rounds of looking and killing. A process may start others between the look and the kill; one that does so this often is
/// replaced faster than it is killed, and left.
const ROUNDS: u32 = 10;

/// What a process inherits of the child that started it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Origin<'a> {
    /// The folder of the domain.
    pub(crate) domain: &'a Path,
    /// The process of the deployment; any when not given.
    pub(crate) process: Option<&'a str>,
}

/// Kills every process of this origin but this one.
pub(crate) fn kill_descendants(origin: Origin<'_>) {
    let wanted = wanted(origin);
    for _ in 0..ROUNDS {
        let (mut killed, mut unknown) = (false, false);
        for (pid, environment) in others() {
            if has_all(&environment, &wanted) {
                // It may have ended meanwhile; its number is not given to another so soon.
                let _ = kill_process(pid, Signal::KILL);
                killed = true;
            }
            unknown |= environment.is_empty();
        }
        if !killed && !unknown {
            return;
        }
    }
}

/// Living processes of this user but this one, with their environments. That of a process that is just executing a program is empty
/// until its memory is set up.
fn others() -> impl Iterator<Item = (Pid, Vec<u8>)> {
    let uid = getuid().as_raw();
    let entries = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    entries.filter_map(move |entry| {
        let pid = Pid::from_raw(entry.file_name().to_str()?.parse().ok()?)?;
        let is_ours = pid != getpid() && entry.metadata().is_ok_and(|found| found.uid() == uid);
        // Processes that have ended, and threads of the kernel, execute nothing.
        let is_alive = is_ours && std::fs::read_link(entry.path().join("exe")).is_ok();
        Some((pid, is_alive.then(|| std::fs::read(entry.path().join("environ")).ok()).flatten()?))
    })
}

fn wanted(origin: Origin<'_>) -> Vec<Vec<u8>> {
    let variable = |name: &str, value: &[u8]| [name.as_bytes(), b"=", value].concat();
    let domain = variable(DOMAIN, origin.domain.as_os_str().as_encoded_bytes());
    let process = origin.process.map(|process| variable(PROCESS, process.as_bytes()));
    std::iter::once(domain).chain(process).collect()
}

/// Whether an environment, as `/proc/<pid>/environ` has it, holds all of these variables.
fn has_all(environment: &[u8], wanted: &[Vec<u8>]) -> bool {
    wanted.iter().all(|variable| environment.split(|byte| *byte == 0).any(|found| found == variable.as_slice()))
}

/// Waits for children that ended and are none of `known`. The first process of a container, and of nothing else, is given those
/// whose parents have ended.
pub(crate) fn reap_strangers(known: impl Fn(u32) -> bool) {
    let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let lists = tasks.filter_map(|task| std::fs::read_to_string(task.path().join("children")).ok());
    let children: Vec<i32> =
        lists.flat_map(|list| list.split_ascii_whitespace().filter_map(|pid| pid.parse().ok()).collect::<Vec<_>>()).collect();
    for pid in children.into_iter().filter_map(Pid::from_raw) {
        if !u32::try_from(pid.as_raw_pid()).is_ok_and(&known) {
            // Still running, or gone: either is no matter of ours.
            let _ = waitpid(Some(pid), WaitOptions::NOHANG);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_whole_origin_counts() {
        let origin = |process| wanted(Origin { domain: Path::new("/run/stillmap/demo"), process });
        let environment = b"HOME=/root\0STILLMAP_DOMAIN=/run/stillmap/demo\0STILLMAP_PROCESS=std\0";
        assert!(has_all(environment, &origin(None)));
        assert!(has_all(environment, &origin(Some("std"))));
        assert!(!has_all(environment, &origin(Some("fti"))));
        assert!(!has_all(b"STILLMAP_DOMAIN=/run/stillmap/demo-2\0", &origin(None)), "another deployment");
        assert!(!has_all(b"", &origin(None)));
    }
}
