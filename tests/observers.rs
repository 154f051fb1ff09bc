//! Commands that look at a deployment change nothing about its run.

use rustix::process::Signal;

use crate::harness::processes::{resume, signal, stop};
use crate::harness::replay::DRIVE;
use crate::harness::{Observer, Sandbox, is_running};

#[test]
fn an_observer_that_stays_does_not_delay_the_end() {
    let sandbox = Sandbox::new();
    let replay = DRIVE.replay(&sandbox, "observed").set("pace", "live");
    let mut run = sandbox.run(&replay, &["--speed", "10"]);
    run.wait_for("playback", "it runs", is_running);
    let observer = Observer::join(sandbox.runtime(), Some("observed")).unwrap();
    signal(run.pid(), Signal::TERM);
    let ended = run.end();
    ended.assert_code(0);
    assert!(!ended.stderr.contains("still alive"), "{}", ended.stderr);
    drop(observer);
    sandbox.assert_nothing_left();
}

#[test]
fn an_observer_that_is_stopped_does_not_delay_the_end() {
    let sandbox = Sandbox::new();
    let replay = DRIVE.replay(&sandbox, "observed").set("pace", "live").without("mapping");
    let mut run = sandbox.run(&replay, &["--speed", "10"]);
    run.wait_for("playback", "it runs", is_running);
    // Without mapping it waits for a map that does not come.
    let observer = sandbox.start(sandbox.stillmap(["map", "--out", sandbox.path("copy").to_str().unwrap()]));
    stop(observer.pid());
    signal(run.pid(), Signal::TERM);
    let ended = run.end();
    assert!(!ended.stderr.contains("still alive") && ended.code == Some(0), "{:?} {}", ended.code, ended.stderr);
    resume(observer.pid());
    observer.end();
    sandbox.assert_nothing_left();
}

#[test]
fn without_a_deployment_the_folder_that_was_searched_is_named() {
    let sandbox = Sandbox::new();
    for command in [&["status"][..], &["top"], &["map"]] {
        let ended = sandbox.output(command);
        ended.assert_code(4);
        let said = format!("{}{}", ended.stdout, ended.stderr);
        assert!(said.contains(" is running in ") && said.contains(sandbox.runtime().to_str().unwrap()), "{said}");
    }
}
