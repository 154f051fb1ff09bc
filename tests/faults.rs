//! Faults on whole deployments: disturbed messages, processes that hang, crash or find a full disk.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod harness;

use std::collections::HashMap;
use std::time::{Duration, Instant};

use harness::replays::{DRIVE, Watched, children, replay_settings, sha256_of};
use harness::{Bench, Run, text};

/// A test that waits for longer than this for a moment to come has missed it.
const MISSED: Duration = Duration::from_secs(120);

const INJECTOR: &str = "[[process]]\nname = \"injector\"\nrun = \"injector\"\n";

fn faults(faults: &[&str]) -> String {
    faults.iter().map(|fault| format!("[[fault]]\n{fault}\n")).collect()
}

/// Replays the drive in lockstep with an injector and these faults: exit code, map, what was said.
fn disturbed(faults_on_services: &[&str]) -> (Option<i32>, String, String) {
    let (_, log, _) = &*DRIVE;
    let bench = Bench::new();
    let settings = replay_settings("replay", log, &format!("{INJECTOR}{}", faults(faults_on_services)));
    let settings = bench.write("replay.toml", &settings);
    Watched::start(bench.stillmap(["run", settings.to_str().unwrap()])).end()
}

#[test]
fn what_comes_late_twice_or_in_heaps_leaves_the_map_as_it_is() {
    let all = ["robot/scan", "motion/sonar", "map/verdict"].map(|service| {
        [
            format!("service = {service:?}\nkind = \"duplicate\"\nrate = 0.3"),
            format!("service = {service:?}\nkind = \"delay\"\nrate = 0.05\nby_s = 0.01\nseed = 2"),
            format!("service = {service:?}\nkind = \"burst\"\nby_s = 0.02\nfrom_s = 5.0\nfor_s = 10.0"),
        ]
    });
    let all: Vec<&str> = all.iter().flatten().map(String::as_str).collect();
    let ended = disturbed(&all);
    assert_eq!(sha256_of(&ended), DRIVE.2, "{}", ended.2);
    assert!(!ended.1.contains("restarted"), "{}", ended.1);
}

#[test]
fn corrupt_and_missing_messages_are_counted_and_end_nothing() {
    let ended = disturbed(&[
        "service = \"robot/scan\"\nkind = \"corrupt\"\nrate = 0.1",
        "service = \"motion/sonar\"\nkind = \"corrupt\"\nrate = 0.1\nseed = 3",
        "service = \"motion/sonar\"\nkind = \"drop\"\nrate = 0.1\nseed = 4",
        "service = \"map/verdict\"\nkind = \"corrupt\"\nrate = 0.1\nseed = 5",
        "service = \"map/verdict\"\nkind = \"reorder\"\nrate = 0.1\nseed = 6",
    ]);
    let (code, stdout, stderr) = &ended;
    assert_eq!(*code, Some(0), "{stdout}{stderr}");
    assert!(!stdout.contains("restarted"), "{stdout}");
    let mut refused: HashMap<(String, String), usize> = HashMap::new();
    for line in stderr.lines().filter(|line| line.contains("refused message")) {
        assert!(line.contains("its checksum is"), "{line}");
        let process = line.split_whitespace().nth(2).unwrap().to_owned();
        let service = ["robot/scan", "motion/sonar", "map/verdict"].into_iter().find(|name| line.contains(name)).unwrap();
        *refused.entry((process, service.to_owned())).or_default() += 1;
    }
    let of = |process: &str, service: &str| refused.get(&(process.to_owned(), service.to_owned())).copied().unwrap_or_default();
    let scans = of("mapping", "robot/scan");
    assert!(scans > 10, "{refused:?}");
    assert_eq!((of("std", "robot/scan"), of("fti", "robot/scan"), of("recorder", "robot/scan")), (scans, scans, scans));
    assert!(of("fti", "motion/sonar") > 10 && of("mapping", "map/verdict") > 10, "{refused:?}");
    assert_ne!(sha256_of(&ended), DRIVE.2, "what is missing is missed");
    // The same faults, the same map.
    assert_eq!(sha256_of(&disturbed(&["service = \"robot/scan\"\nkind = \"corrupt\"\nrate = 0.1"])), {
        sha256_of(&disturbed(&["service = \"robot/scan\"\nkind = \"drop\"\nrate = 0.1"]))
    });
}

#[test]
fn seconds_in_which_nothing_comes_whole_hold_up_no_replay() {
    // Each is far longer than the replay's window.
    let silence = |kind: &str| {
        let of = |service: &str, from_s: u32| format!("service = {service:?}\nkind = {kind:?}\nfrom_s = {from_s}.0\nfor_s = 6.0");
        let (scans, motions, verdicts) = (of("robot/scan", 0), of("motion/sonar", 20), of("map/verdict", 30));
        disturbed(&[&scans, &motions, &verdicts])
    };
    let (dropped, damaged) = (silence("drop"), silence("corrupt"));
    assert_eq!(dropped.0, Some(0), "{}{}", dropped.1, dropped.2);
    assert_eq!(sha256_of(&dropped), sha256_of(&damaged), "what is damaged is worth as much as what is missing");
    assert_ne!(sha256_of(&dropped), DRIVE.2);
}

/// A live replay at the pace of the drive, times two.
fn live(bench: &Bench, more: &str, supervisor: &str) -> Run {
    let (_, log, _) = &*DRIVE;
    let settings = replay_settings("live", log, more).replace("\"lockstep\"", "\"live\"");
    let (head, _) = settings.split_once("[supervisor]").unwrap();
    let settings = bench.write("live.toml", &format!("{head}[supervisor]\n{supervisor}\n"));
    Run::start(bench.stillmap(["run", settings.to_str().unwrap(), "--speed", "2"]))
}

#[test]
fn a_clock_that_is_set_costs_what_it_is_set_back_by_and_that_is_said() {
    let (bench, log, _) = &*DRIVE;
    // Ten seconds of scans are stamped three seconds ahead; the first of those after them lie before the last of these. They are more
    // than the replay's window.
    let (code, stdout, stderr) = disturbed(&["service = \"robot/scan\"\nkind = \"clock\"\nby_s = 3.0\nfrom_s = 30.0\nfor_s = 10.0"]);
    assert_eq!(code, Some(0), "{stdout}{stderr}");
    assert!(!stdout.contains("restarted") && stdout.contains("map sha256"), "{stdout}{stderr}");
    let refused: Vec<&str> = stderr.lines().filter(|line| line.contains("mapping") && line.contains("refused message")).collect();
    assert!(refused.iter().all(|line| line.contains("of robot/scan: its stamp") && line.contains("is before")), "{stderr}");
    // Three seconds at seven to eleven scans a second.
    assert!((20..36).contains(&refused.len()), "{} refused: {stderr}", refused.len());
    let integrated = |of: &str| of.lines().find_map(|line| line.strip_prefix("figures ")?.trim().split(' ').next()?.parse::<usize>().ok());
    let recorded = text(&bench.output(["log", "info", log.to_str().unwrap()]).stdout);
    let scans = recorded.lines().find(|line| line.contains("robot/scan")).unwrap().split_ascii_whitespace().nth(2).unwrap();
    assert_eq!(integrated(&stdout).unwrap() + refused.len(), scans.parse::<usize>().unwrap(), "{stdout}{recorded}");
}

/// The lines that a command says, which went well.
#[track_caller]
fn told(output: &std::process::Output) -> Vec<String> {
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    text(&output.stdout).lines().map(str::to_owned).collect()
}

#[test]
fn status_names_what_was_refused() {
    const CORRUPTS: &str = "disturbs robot/scan as requested: corrupt, rate 0.5, for 5 s";
    let bench = Bench::new();
    let more = format!("{INJECTOR}[injector]\nservices = [\"robot/scan\", \"motion/sonar\"]\n");
    let run = live(&bench, &more, "");
    drop(bench.wait_for("mapping", "it maps", |it| it["received"].as_u64() > Some(5)));
    let inject = |words: &[&str]| bench.output(["inject"].iter().chain(words));
    let unrouted = inject(&["--service", "map/verdict", "drop"]);
    assert_eq!(unrouted.status.code(), Some(2));
    assert!(text(&unrouted.stderr).contains("--service map/verdict is not routed through an injector"), "{}", text(&unrouted.stderr));
    let nobody = inject(&["--process", "mappping", "kill"]);
    assert!(text(&nobody.stderr).contains("--process mappping: deployment live has no such process"), "{}", text(&nobody.stderr));
    let impossible = inject(&["--process", "mapping", "drop"]);
    assert_eq!(impossible.status.code(), Some(2));
    assert_eq!(told(&inject(&["--service", "robot/scan", "corrupt", "--rate", "0.5", "--for", "5"])), [CORRUPTS]);
    let mapping = bench.wait_for("mapping", "it has refused scans", |it| it["refused"].as_u64() > Some(5));
    assert!(mapping["note"].as_str().unwrap().contains("of robot/scan"), "{mapping}");
    assert_eq!(inject(&["--service", "motion/sonar", "drop", "--for", "20"]).status.code(), Some(0));
    let inject_stop = inject(&["--process", "recorder", "stop", "--for", "0.5"]);
    let fti = bench.wait_for("fti", "it says what it lacks", |it| it["note"].as_str().is_some_and(|note| note.contains("no sonar motion")));
    let since = fti["note"].as_str().unwrap().split("no sonar motion since ").nth(1).and_then(|rest| rest.split_once(" s"));
    assert!(since.is_some_and(|(since, _)| (0.0..3600.0).contains(&since.parse::<f64>().unwrap())), "since the run began: {fti}");
    assert_eq!(told(&inject(&["--process", "std", "kill"])), ["kills std as requested", "std: killed"]);
    drop(bench.wait_for("std", "it is back", |it| it["restarts"] == 1 && it["state"] == "running"));
    let ended = run.end();
    assert_eq!(ended.status.code(), Some(0), "{}", text(&ended.stderr));
    assert!(text(&ended.stdout).contains("std once"), "{}", text(&ended.stdout));
    let said = text(&ended.stderr);
    let [begins, over] = [CORRUPTS, "robot/scan is no longer disturbed: corrupt"].map(|words| said.find(words));
    assert!(begins.is_some() && begins < over, "{said}");
    assert_eq!(told(&inject_stop), ["stops recorder as requested, for 0.5 s", "recorder is no longer stopped"]);
}

#[test]
fn a_hung_process_is_killed_and_a_crash_loop_fails_while_the_rest_goes_on() {
    let bench = Bench::new();
    let more = format!(
        "{INJECTOR}{}",
        faults(&[
            "process = \"std\"\nkind = \"stop\"\nfrom_s = 4.0\nfor_s = 60.0",
            "process = \"fti\"\nkind = \"kill\"\nfrom_s = 8.0\nby_s = 0.1"
        ])
    );
    let run = live(&bench, &more, "restarts = 3\nheartbeat_timeout_s = 1.0\nstop_deadline_s = 2.0");
    drop(bench.wait_for("std", "it hung and is back", |it| it["restarts"].as_u64() >= Some(1) && it["state"] == "running"));
    let fti = bench.wait_for("fti", "it has failed", |it| it["state"] == "failed");
    assert!(fti["note"].as_str().unwrap().contains("3 restarts in"), "{fti}");
    let ended = run.end();
    let (stdout, stderr) = (text(&ended.stdout), text(&ended.stderr));
    assert_eq!(ended.status.code(), Some(3), "{stdout}{stderr}");
    // On a busy machine it may seem to hang once more: it is started again as often as it is killed.
    let killed = stderr.lines().filter(|line| line.split_whitespace().nth(2) == Some("std") && line.ends_with("; killed")).count();
    let times = if killed == 1 { "once".to_owned() } else { format!("{killed} times") };
    assert!(killed > 0 && stdout.contains(&format!("std {times}")), "{stdout}{stderr}");
    assert!(stdout.contains("failed     fti") && stdout.contains("map sha256"), "{stdout}");
    for words in ["stops std as configured, for 60 s", "kills fti as configured, every 0.1 s, until the end"] {
        assert_eq!(stderr.lines().filter(|line| line.contains(words)).count(), 1, "{words}: {stderr}");
    }
}

#[test]
fn a_run_whose_driver_is_lost_ends_once_nothing_moves_whoever_talks() {
    let bench = Bench::new();
    let built_in = |kind: &str| format!("[[process]]\nname = {kind:?}\nrun = {kind:?}\n");
    let settings = format!(
        "name = \"lost\"\nout = \"lost-out\"\n{}[[process]]\nname = \"driver\"\ncommand = [\"/bin/false\"]\nends_run = true
        [mapping]\nexpect_verdicts = true\n[fti]\nexpect_camera = false\n[supervisor]\nrestarts = 0\nstartup_deadline_s = 60.0
        heartbeat_timeout_s = 60.0\n",
        ["recorder", "mapping", "fti", "std", "viewer"].map(built_in).concat()
    );
    let settings = bench.write("lost.toml", &settings);
    let (code, stdout, stderr) = Watched::start(bench.stillmap(["run", settings.to_str().unwrap()])).end();
    assert_eq!(code, Some(3), "{stdout}{stderr}");
    assert!(stderr.contains("stopping: nothing can be done without driver"), "{stderr}");
    assert!(!stderr.contains("still moves") && !stdout.contains("restarted"), "{stdout}{stderr}");
    assert!(stdout.contains("map sha256"), "{stdout}{stderr}");
}

#[test]
fn a_full_disk_stops_the_recording_and_a_new_file_goes_on() {
    let bench = Bench::new();
    let more = format!("{INJECTOR}{}", faults(&["process = \"recorder\"\nkind = \"disk\"\nfrom_s = 8.0\nfor_s = 8.0"]));
    let ended = live(&bench, &more, "").end();
    let (stdout, stderr) = (text(&ended.stdout), text(&ended.stderr));
    assert_eq!(ended.status.code(), Some(0), "{stdout}{stderr}");
    assert!(stderr.contains("the log file has reached its size limit") && stderr.contains("messages are not recorded"), "{stderr}");
    assert!(stderr.contains("recording resumed in"), "{stderr}");
    let said = |words: &str| stderr.find(words).unwrap_or_else(|| panic!("{words}: {stderr}"));
    assert!(said("fills the disk of recorder as configured, for 8 s") < said("the log file has reached its size limit"), "{stderr}");
    assert!(said("the disk of recorder is no longer full") < said("recording resumed in"), "{stderr}");
    assert!(!stdout.contains("restarted"), "{stdout}");
    let out = bench.path("live-out");
    assert!(out.join("drive.2.mcap").exists());
    let info = bench.output(["log", "info", out.join("drive.mcap").to_str().unwrap()]);
    assert_eq!(info.status.code(), Some(0), "{}{}", text(&info.stdout), text(&info.stderr));
    assert!(text(&info.stdout).contains("robot/scan"));
}

#[test]
fn nothing_outlives_the_supervisor_of_a_disturbed_run() {
    let bench = Bench::new();
    let run = live(&bench, &format!("{INJECTOR}[injector]\nservices = [\"robot/scan\", \"map/verdict\"]\n"), "");
    drop(bench.wait_for("injector", "it runs", |it| it["state"] == "running"));
    bench.remember_domain();
    let all = children(run.pid());
    assert_eq!(all.len(), 6, "{all:?}");
    harness::kill(run.pid().into());
    drop(run);
    let since = Instant::now();
    let alive = || all.iter().any(|(_, pid)| std::fs::read_to_string(format!("/proc/{pid}/stat")).is_ok_and(|it| !it.contains(") Z ")));
    while alive() || !bench.left_behind().is_empty() {
        assert!(since.elapsed() < MISSED, "left: {:?}", bench.left_behind());
        std::thread::yield_now();
    }
}
