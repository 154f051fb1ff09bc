//! Faults injected into whole deployments: disturbed messages, processes that hang, crash or find a full disk.

use std::collections::HashMap;

use rustix::process::Signal;
use toml::{Table, toml};

use crate::harness::processes::{Exit, built_in_children, kill, signal};
use crate::harness::replay::DRIVE;
use crate::harness::{Deployment, Ended, Run, Sandbox, is_running};
use messages::ProcessState;

fn with_faults(deployment: Deployment, faults: impl IntoIterator<Item = Table>) -> Deployment {
    faults.into_iter().fold(deployment.with("injector"), Deployment::fault)
}

/// Replays the drive in lockstep with these faults.
fn disturbed(faults: impl IntoIterator<Item = Table>) -> Ended {
    let sandbox = Sandbox::new();
    sandbox.run(&with_faults(DRIVE.replay(&sandbox, "replay"), faults), &[]).end()
}

fn of_service(service: &str, mut fault: Table) -> Table {
    fault.insert("service".to_owned(), service.into());
    fault
}

/// How many messages of each service each process has refused for this reason, by the lines at the end.
fn refused(stderr: &str, reason: &str) -> HashMap<(String, String), usize> {
    let mut counts: HashMap<(String, String), usize> = HashMap::new();
    for line in stderr.lines().filter(|line| line.contains(reason)) {
        let [_, _, process, "refused", count, "messages", "of", service, ..] = line.split_whitespace().collect::<Vec<_>>()[..] else {
            panic!("{line}");
        };
        *counts.entry((process.to_owned(), service.to_owned())).or_default() += count.parse::<usize>().unwrap();
    }
    counts
}

#[test]
fn delayed_and_duplicated_messages_leave_the_map_unchanged() {
    let of = |service| {
        [
            of_service(service, toml! { kind = "duplicate" rate = 0.3 }),
            of_service(service, toml! { kind = "delay" rate = 0.05 by_s = 0.01 seed = 2 }),
            of_service(service, toml! { kind = "burst" by_s = 0.02 from_s = 5.0 for_s = 10.0 }),
        ]
    };
    let ended = disturbed(["robot/scan", "motion/sonar", "map/verdict"].into_iter().flat_map(of));
    assert_eq!(ended.map(), DRIVE.map, "{}", ended.stderr);
    assert_eq!(ended.restarted(), None);
}

#[test]
fn corrupt_and_missing_messages_are_counted_and_end_no_process() {
    let ended = disturbed([
        of_service("robot/scan", toml! { kind = "corrupt" rate = 0.1 }),
        of_service("motion/sonar", toml! { kind = "corrupt" rate = 0.1 seed = 3 }),
        of_service("motion/sonar", toml! { kind = "drop" rate = 0.1 seed = 4 }),
        of_service("map/verdict", toml! { kind = "corrupt" rate = 0.1 seed = 5 }),
        of_service("map/verdict", toml! { kind = "reorder" rate = 0.1 seed = 6 }),
    ]);
    assert_ne!(ended.map(), DRIVE.map, "a lost message changes the map");
    assert_eq!(ended.restarted(), None);
    let begun: Vec<&str> = ended.stderr.lines().filter(|line| line.contains("refused message ")).collect();
    assert!(begun.iter().all(|line| line.contains("its checksum is")), "{}", ended.stderr);
    let refused = refused(&ended.stderr, "with a wrong checksum");
    assert_eq!(begun.len(), refused.len(), "one line when a stream begins to be refused, one when it ends: {}", ended.stderr);
    let of = |process: &str, service: &str| refused.get(&(process.to_owned(), service.to_owned())).copied().unwrap_or_default();
    let scans = of("mapping", "robot/scan");
    assert!(scans > 10, "{refused:?}");
    assert_eq!((of("std", "robot/scan"), of("fti", "robot/scan"), of("recorder", "robot/scan")), (scans, scans, scans));
    assert!(of("fti", "motion/sonar") > 10 && of("mapping", "map/verdict") > 10, "{refused:?}");
}

#[test]
fn a_corrupt_message_has_the_effect_of_a_lost_one() {
    let map = |kind: &str| disturbed([toml! { service = "robot/scan" rate = 0.1 }].map(|fault| of_kind(kind, fault))).map();
    assert_eq!(map("corrupt"), map("drop"));
}

fn of_kind(kind: &str, mut fault: Table) -> Table {
    fault.insert("kind".to_owned(), kind.into());
    fault
}

#[test]
fn seconds_of_lost_messages_do_not_block_a_replay() {
    // Each is far longer than the replay's window.
    let silence = |kind: &str| {
        let faults = [
            toml! { service = "robot/scan" from_s = 0.0 for_s = 6.0 },
            toml! { service = "motion/sonar" from_s = 20.0 for_s = 6.0 },
            toml! { service = "map/verdict" from_s = 30.0 for_s = 6.0 },
        ];
        disturbed(faults.map(|fault| of_kind(kind, fault))).map()
    };
    let dropped = silence("drop");
    assert_eq!(dropped, silence("corrupt"), "a corrupt message has the effect of a lost one");
    assert_ne!(dropped, DRIVE.map);
}

#[test]
fn scans_of_a_clock_set_back_are_refused_and_reported() {
    // Ten seconds of scans are stamped three seconds ahead; the first of those after them lie before the last of these. They are more
    // than the replay's window.
    let ended = disturbed([toml! { service = "robot/scan" kind = "clock" by_s = 3.0 from_s = 30.0 for_s = 10.0 }]);
    ended.map();
    assert_eq!(ended.restarted(), None);
    let begun: Vec<&str> = ended.stderr.lines().filter(|line| line.contains("mapping") && line.contains("refused message ")).collect();
    assert!(begun.len() == 1 && begun[0].contains("of robot/scan: its stamp") && begun[0].contains("is before"), "{}", ended.stderr);
    let refused = refused(&ended.stderr, "out of order or out of range")[&("mapping".to_owned(), "robot/scan".to_owned())];
    // Three seconds at seven to eleven scans a second.
    assert!((20..36).contains(&refused), "{refused} refused: {}", ended.stderr);
    let figures = ended.stdout.lines().find_map(|line| line.strip_prefix("figures ")).unwrap();
    let integrated: usize = figures.trim().split(' ').next().unwrap().parse().unwrap();
    let sandbox = Sandbox::new();
    let scans = crate::harness::recorded::<messages::SonarScan>(&DRIVE.log(&sandbox)).len();
    assert_eq!(integrated + refused, scans, "{}", ended.stderr);
}

/// A live replay of the drive, with an injector.
fn live(sandbox: &Sandbox, faults: impl IntoIterator<Item = Table>) -> Deployment {
    with_faults(DRIVE.replay(sandbox, "live").set("pace", "live"), faults)
}

/// The lines of a command that went well.
#[track_caller]
fn lines(ended: &Ended) -> Vec<&str> {
    ended.assert_code(0);
    ended.stdout.lines().collect()
}

#[test]
fn injected_faults_are_reported_and_refusals_shown_in_status() {
    const CORRUPTS: &str = "disturbs robot/scan as requested: corrupt, rate 0.5, for 5 s";
    let sandbox = Sandbox::new();
    let live = live(&sandbox, []).set("injector.services", ["robot/scan", "motion/sonar"]);
    let mut run = sandbox.run(&live, &["--speed", "2"]);
    run.wait_for("mapping", "it maps", |it| it.received > 5);
    let inject = |words: &[&str]| sandbox.output(["inject"].iter().chain(words));
    let refused = |words: &[&str], expected: &str| {
        let ended = inject(words);
        ended.assert_code(2);
        assert!(ended.stderr.contains(expected), "{}", ended.stderr);
    };
    refused(&["--service", "map/verdict", "drop"], "--service map/verdict is not routed through an injector");
    refused(&["--process", "mappping", "kill"], "--process mappping: deployment live has no such process");
    refused(&["--process", "mapping", "drop"], "drop --process mapping");
    assert_eq!(lines(&inject(&["--service", "robot/scan", "corrupt", "--rate", "0.5", "--for", "5"])), [CORRUPTS]);
    run.wait_for("mapping", "it reports refused scans", |it| it.refused > 5 && it.note.as_str().contains("of robot/scan"));
    inject(&["--service", "motion/sonar", "drop", "--for", "20"]).assert_code(0);
    let stop = inject(&["--process", "recorder", "stop", "--for", "0.5"]);
    assert_eq!(lines(&stop), ["stops recorder as requested, for 0.5 s", "recorder is no longer stopped"]);
    let fti = run.wait_for("fti", "it reports what it lacks", |it| it.note.as_str().contains("no sonar motion since "));
    let since = fti.note.as_str().split("no sonar motion since ").nth(1).and_then(|rest| rest.split_once(" s"));
    assert!(since.is_some_and(|(since, _)| (0.0..3600.0).contains(&since.parse::<f64>().unwrap())), "of the run's time: {fti:?}");
    assert_eq!(lines(&inject(&["--process", "std", "kill"])), ["kills std as requested", "std: killed"]);
    run.wait_for("std", "it has restarted", |it| it.restarts == 1 && is_running(it));
    let ended = run.end();
    ended.assert_code(0);
    assert_eq!(ended.restarted(), Some("std once"));
    let [begins, over] = [CORRUPTS, "robot/scan is no longer disturbed: corrupt"].map(|words| ended.stderr.find(words));
    assert!(begins.is_some() && begins < over, "{}", ended.stderr);
}

#[test]
fn a_hung_process_is_restarted_once_and_a_crash_loop_fails() {
    let sandbox = Sandbox::new();
    let faults = [
        toml! { process = "std" kind = "stop" from_s = 4.0 for_s = 600.0 },
        toml! { process = "fti" kind = "kill" from_s = 8.0 by_s = 0.1 },
    ];
    // Far longer than a busy machine keeps a process from its work: only the stopped one is taken for hung.
    let live = live(&sandbox, faults).set("supervisor.restarts", 3).set("supervisor.heartbeat_timeout_s", 10);
    let mut run = sandbox.run(&live.set("playback.window", 256), &["--speed", "1"]);
    let fti = run.wait_for("fti", "it has failed", |it| it.state == ProcessState::Failed as u32);
    assert!(fti.note.as_str().contains("3 restarts in"), "{fti:?}");
    run.wait_for("std", "it hung and has restarted", |it| it.restarts == 1 && is_running(it));
    signal(run.pid(), Signal::TERM);
    let ended = run.end();
    ended.assert_code(3);
    let killed = ended.stderr.lines().filter(|line| line.split_whitespace().nth(2) == Some("std") && line.ends_with("; killed")).count();
    assert_eq!(killed, 1, "{}", ended.stderr);
    assert_eq!(ended.restarted(), Some("fti 3 times, std once"));
    assert!(ended.stdout.contains("failed     fti") && ended.stdout.contains("map sha256"), "{}", ended.stdout);
    for words in ["stops std as configured, for 600 s", "kills fti as configured, every 0.1 s, until the end"] {
        assert_eq!(ended.stderr.lines().filter(|line| line.contains(words)).count(), 1, "{words}: {}", ended.stderr);
    }
}

#[test]
fn a_run_without_its_driver_ends_once_no_data_moves() {
    let sandbox = Sandbox::new();
    let lost = Deployment::new("lost", &["recorder", "mapping", "fti", "std", "viewer"]).with_driver(["/bin/false"]);
    let lost = lost.set("supervisor.startup_deadline_s", 60).set("supervisor.heartbeat_timeout_s", 60);
    let lost = lost.set("supervisor.restarts", 0);
    let ended = sandbox.run(&lost, &[]).end();
    ended.assert_code(3);
    let (stdout, stderr) = (&ended.stdout, &ended.stderr);
    assert!(stderr.contains("stopping: nothing can be done without driver"), "{stderr}");
    assert!(!stderr.contains("still moves") && ended.restarted().is_none() && stdout.contains("map sha256"), "{stdout}{stderr}");
}

#[test]
fn recording_stops_on_a_full_disk_and_resumes_in_a_new_file() {
    let sandbox = Sandbox::new();
    let full = toml! { process = "recorder" kind = "disk" from_s = 8.0 for_s = 8.0 };
    let ended = sandbox.run(&live(&sandbox, [full]), &["--speed", "2"]).end();
    ended.assert_code(3);
    assert!(ended.stdout.contains("log        INCOMPLETE: ") && ended.stdout.contains(" not recorded\n"), "{}", ended.stdout);
    assert_eq!(ended.restarted(), None);
    let said = |words: &str| ended.stderr.find(words).unwrap_or_else(|| panic!("{words}: {}", ended.stderr));
    assert!(
        said("fills the disk of recorder as configured, for 8 s") < said("the log file has reached its size limit"),
        "{}",
        ended.stderr
    );
    assert!(said("the disk of recorder is no longer full") < said("recording resumed in"), "{}", ended.stderr);
    said("messages are not recorded");
    let out = sandbox.path("live-out");
    assert!(out.join("drive.2.mcap").exists());
    let info = sandbox.output(["log", "info", out.join("drive.mcap").to_str().unwrap()]);
    info.assert_code(3);
    assert!(info.stdout.contains("missing   robot/scan: "), "{}", info.stdout);
}

#[test]
fn no_process_outlives_the_supervisor_of_a_disturbed_run() {
    let sandbox = Sandbox::new();
    let live = live(&sandbox, []).set("injector.services", ["robot/scan", "map/verdict"]);
    let mut run: Run = sandbox.run(&live, &["--speed", "2"]);
    run.wait_for("injector", "it runs", is_running);
    assert_eq!(built_in_children(run.pid()).len(), 6);
    let children = Exit::of_children(run.pid());
    kill(run.pid());
    children.iter().for_each(Exit::wait);
    sandbox.assert_nothing_left();
}
