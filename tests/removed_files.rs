//! Files of a running deployment that another program removes, as logind does at a user's last logout: the run restarts from its
//! checkpoints in new shared memory, and its map is that of its log.

use std::fs;

use crate::harness::processes::kill;
use crate::harness::replay::DRIVE;
use crate::harness::{Run, Sandbox, is_running};

#[derive(Debug, Clone, Copy)]
enum Removed {
    SharedMemory,
    RuntimeFolder,
    Both,
}

impl Removed {
    fn remove(self, sandbox: &Sandbox) {
        if !matches!(self, Self::RuntimeFolder) {
            // What a process removes in the meantime is gone, too.
            sandbox.shared_memory().iter().for_each(|file| drop(fs::remove_file(file)));
        }
        if !matches!(self, Self::SharedMemory) {
            while let Some(entry) = fs::read_dir(sandbox.runtime()).unwrap().next() {
                let path = entry.unwrap().path();
                drop(if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) });
            }
        }
    }
}

fn restarts_in_new_memory(removed: Removed, then: impl FnOnce(&mut Run)) {
    let sandbox = Sandbox::new();
    let live = DRIVE.replay(&sandbox, "removed").set("pace", "live").set("fti.patience_s", 10);
    let mut run = sandbox.run(&live, &["--speed", "4"]);
    run.wait_for("playback", "it runs", is_running);
    // With some checkpoints behind it.
    run.wait_for("mapping", "200 scans", |it| it.received > 200);
    removed.remove(&sandbox);
    then(&mut run);
    let said = run.wait_for_line(" was removed: ");
    assert!(said.contains("logind") && said.contains("cleaner"), "{said}");
    run.wait_for_line("everything starts again from its checkpoints");
    run.wait_for("playback", "it runs again", |it| is_running(it) && it.restarts > 0);
    let ended = run.end();
    assert_eq!(ended.map(), sandbox.replayed(&sandbox.path("removed-out/drive.mcap"), "again"), "{removed:?}\n{}", ended.stderr);
    assert!(!ended.stderr.contains("begins anew"), "{removed:?}\n{}", ended.stderr);
}

#[test]
fn a_run_continues_when_its_shared_memory_is_removed() {
    restarts_in_new_memory(Removed::SharedMemory, |_| ());
}

#[test]
fn a_run_continues_when_its_runtime_folder_is_removed() {
    restarts_in_new_memory(Removed::RuntimeFolder, |_| ());
}

#[test]
fn a_run_continues_when_both_are_removed() {
    restarts_in_new_memory(Removed::Both, |_| ());
}

#[test]
fn a_process_that_dies_without_shared_memory_starts_again() {
    restarts_in_new_memory(Removed::SharedMemory, |run| {
        let std = crate::harness::processes::built_in_children(run.pid())["std"];
        kill(std);
    });
}
