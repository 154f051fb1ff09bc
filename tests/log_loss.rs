//! A log that is removed, moved or truncated while it is recorded: the run says what is missing, and so do the readers of the log.

use std::fs::{self, File};
use std::path::Path;

use messages::SonarScan;

use crate::harness::replay::DRIVE;
use crate::harness::{Ended, Sandbox, recorded};

/// Records a drive, harms the log in the middle of it, and checks the run's end. The log lacks its first part then.
#[track_caller]
fn record_with(sandbox: &Sandbox, harm: impl FnOnce(&Path), expected: &str) -> Ended {
    let replay = DRIVE.replay(sandbox, "replay").set("pace", "live").set("supervisor.restarts", 0);
    let log = sandbox.path("replay-out/drive.mcap");
    let mut run = sandbox.run(&replay, &["--speed", "10"]);
    run.wait_for("mapping", "it has received 50 scans", |it| it.received > 50);
    run.wait_for("recorder", "it has written", |it| it.received > 50);
    harm(&log);
    let said = run.wait_for_line("while it was recorded; recording continues in");
    assert!(said.contains(expected) && said.ends_with("replay-out/drive.2.mcap"), "{said}");
    let ended = run.end();
    ended.assert_code(3);
    assert!(ended.stdout.contains("log        INCOMPLETE: 1 part removed or truncated\n"), "{}", ended.stdout);
    assert!(ended.stderr.contains(&format!("the log is incomplete: {} ", log.display())), "{}", ended.stderr);
    assert_eq!(ended.stderr.matches("while it was recorded").count(), 1, "{}", ended.stderr);
    let info = sandbox.output(["log".as_ref(), "info".as_ref(), log.as_os_str()]);
    info.assert_code(3);
    assert!(info.stdout.contains("missing   robot/scan: "), "{}", info.stdout);
    info
}

/// Number of scans of the drive that the log has from the second part on.
fn scans_of_the_rest(sandbox: &Sandbox) -> u64 {
    let scans = recorded::<SonarScan>(&sandbox.path("replay-out/drive.2.mcap"));
    let numbers: Vec<u64> = scans.iter().map(|(seq, _)| *seq).collect();
    let last = recorded::<SonarScan>(&DRIVE.log(sandbox)).last().unwrap().0;
    assert_eq!(numbers, (numbers[0]..=last).collect::<Vec<_>>(), "everything since the file was lost");
    numbers[0] - 1
}

#[test]
fn a_run_whose_log_is_removed_names_the_missing_part() {
    let sandbox = Sandbox::new();
    let info = record_with(&sandbox, |log| fs::remove_file(log).unwrap(), "drive.mcap was removed");
    let missing = scans_of_the_rest(&sandbox);
    assert!(info.stdout.contains("missing   part 1 of the log\n"), "{}", info.stdout);
    assert!(info.stdout.contains(&format!("missing   robot/scan: {missing} messages: 1 to {missing}\n")), "{}", info.stdout);

    let log = sandbox.path("replay-out/drive.mcap");
    let replayed = sandbox.output(["replay".as_ref(), log.as_os_str(), "--out".as_ref(), sandbox.path("again").as_os_str()]);
    replayed.assert_code(3);
    assert!(replayed.stderr.contains("missing in the log: part 1 of the log"), "{}", replayed.stderr);
    let summary = format!("replay     INCOMPLETE, the log lacks 1 part, {missing} scans\n");
    assert!(replayed.stdout.contains(&summary), "{}", replayed.stdout);

    let recovered = sandbox.output(["log".as_ref(), "recover".as_ref(), log.as_os_str()]);
    recovered.assert_code(0);
    assert!(recovered.stdout.contains("missing   part 1 of the log\n"), "{}", recovered.stdout);
}

#[test]
fn a_run_whose_log_is_truncated_names_the_missing_scans() {
    let sandbox = Sandbox::new();
    let truncate = |log: &Path| File::options().write(true).open(log).unwrap().set_len(0).unwrap();
    record_with(&sandbox, truncate, "drive.mcap was truncated to 0 bytes");
    assert!(scans_of_the_rest(&sandbox) > 0);
}

#[test]
fn a_log_that_was_moved_is_complete_when_it_is_moved_back() {
    let sandbox = Sandbox::new();
    let aside = sandbox.path("aside.mcap");
    record_with(&sandbox, |log| fs::rename(log, &aside).unwrap(), "drive.mcap was moved");
    let log = sandbox.path("replay-out/drive.mcap");
    fs::rename(&aside, &log).unwrap();
    let info = sandbox.output(["log".as_ref(), "info".as_ref(), log.as_os_str()]);
    info.assert_code(0);
    assert_eq!(sandbox.replayed(&log, "again"), DRIVE.map);
}

#[test]
fn a_run_whose_output_folder_is_removed_names_the_missing_part() {
    let sandbox = Sandbox::new();
    let remove = |log: &Path| fs::remove_dir_all(log.parent().unwrap()).unwrap();
    record_with(&sandbox, remove, "drive.mcap was removed");
}

#[test]
fn a_log_of_another_program_is_told_by_its_library() {
    let sandbox = Sandbox::new();
    let path = sandbox.path("bag.mcap");
    let writer = mcap::WriteOptions::new().profile("ros2").library("libmcap 1.3.0").create(File::create(&path).unwrap());
    writer.unwrap().finish().unwrap();
    for command in [&["log", "info"][..], &["replay"]] {
        let ended = sandbox.output(command.iter().map(Path::new).chain([path.as_path()]));
        ended.assert_code(2);
        assert!(ended.stderr.contains("recorded by libmcap 1.3.0 with profile ros2: not a stillmap log"), "{}", ended.stderr);
    }
}
