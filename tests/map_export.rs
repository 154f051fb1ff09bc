//! The map as files, written beside the work loop of mapping.

use std::path::Path;
use std::time::{Duration, Instant};

use crate::harness::Sandbox;
use crate::harness::blocked_file::{BlockedFile, Room};
use crate::harness::replay::DRIVE;

#[test]
fn mapping_sends_heartbeats_while_it_writes_the_map() {
    let sandbox = Sandbox::new();
    let mut run = sandbox.run(&DRIVE.replay(&sandbox, "replay"), &[]);
    let pid = run.pid_of("mapping");
    let out = sandbox.path("replay-out");
    let file = BlockedFile::at(&out.join(Path::new("map").with_extension(format!("{pid}.fresh"))), Room::Page);
    file.wait_for_writer(pid);
    // A heartbeat that is younger than the wait: the writer has been blocked all the while.
    let blocked = Instant::now();
    let is_alive = |age_ms: u64| blocked.elapsed() > Duration::from_millis(3000) && age_ms < 1000;
    run.wait_for("mapping", "it sends heartbeats", |it| it.pid == pid && is_alive(it.heartbeat_age_ms));
    file.kill_writer(pid);
    let ended = run.end();
    assert_eq!((ended.map(), ended.restarted()), (DRIVE.map.clone(), Some("mapping once")));
}
