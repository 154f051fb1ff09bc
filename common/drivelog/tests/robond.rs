//! Import of a real robot's log, and of files that are not quite one.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stderr, reason = "tests fail by panicking")]

use std::path::Path;

use messages::{Pose, SonarScan};
use stillmap_drivelog::{Entry, Log, import_robond, info};

fn import(measurements: &str, poses: &str) -> Result<Vec<(u64, u64, SonarScan)>, String> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("measurement.txt"), measurements).unwrap();
    std::fs::write(folder.path().join("poses.txt"), poses).unwrap();
    let to = folder.path().join("log.mcap");
    import_robond(folder.path(), &to).map_err(|error| error.to_string())?;
    Ok(scans(&to))
}

fn scans(path: &Path) -> Vec<(u64, u64, SonarScan)> {
    let mut log = Log::open(path).unwrap();
    let mut scans = Vec::new();
    loop {
        match log.next_of().unwrap() {
            Some(Entry::Message { seq, stamp_ns, payload }) => scans.push((seq, stamp_ns, payload)),
            Some(Entry::End { seq, .. }) => assert_eq!(seq, scans.len() as u64),
            None => return scans,
        }
    }
}

#[test]
fn a_step_becomes_a_scan() {
    let measurements = "1000 400 5110 1500 2000 2500 3000 5100 6000\n1205 1 2 3 4 5 6 7 8\n";
    let found = import(measurements, "1000 250 -1500 2700\n1205 0 0 0\n").unwrap();
    assert_eq!(found.iter().map(|(seq, stamp_ns, _)| (*seq, *stamp_ns)).collect::<Vec<_>>(), [(1, 1_000_000_000), (2, 1_205_000_000)]);
    let scan = found[0].2;
    assert_eq!(scan.pose, Pose { x_m: 0.25, y_m: -1.5, yaw_rad: 270f64.to_radians() });
    let readings: Vec<_> =
        scan.readings().iter().map(|it| (it.sonar, it.mount.yaw_rad.to_degrees().round(), it.range_m, it.echo)).collect();
    assert_eq!(readings[0], (0, -90.0, 0.4, 1), "the first looks right");
    assert_eq!(readings[1].3, 0, "5110 is no echo");
    assert_eq!(readings[6], (6, 38.0, 5.1, 1));
    assert_eq!(readings[7], (7, 90.0, 5.11, 0));
}

#[test]
fn a_bad_line_is_told_with_file_and_number() {
    let good = "1 2 3 4 5 6 7 8 9\n2 2 3 4 5 6 7 8 9\n";
    let poses = "1 0 0 0\n2 0 0 0\n";
    let refused = |measurements: &str, poses: &str| {
        let error = import(measurements, poses).unwrap_err();
        assert!(!error.contains('\n'), "{error}");
        error
    };
    for (line, found) in
        [("2 2 3 4 5 6 7 8", "8 numbers"), ("", "nothing"), ("2 2 3 4 5 6 7 8 NaN", "no number"), ("2 2 3 4 5 6 7 8 x", "a word")]
    {
        let error = refused(&format!("1 2 3 4 5 6 7 8 9\n{line}\n3 2 3 4 5 6 7 8 9\n"), poses);
        assert!(
            error.contains(&format!("measurement.txt: line 2: found {line:?}, expected its time in ms and eight ranges")),
            "{found}: {error}"
        );
    }
    assert!(refused(good, "1 0 0 0\n2 0 0\n").contains("poses.txt: line 2: found \"2 0 0\", expected its time in ms, x and y"));
    assert!(refused(good, "1 0 0 0\n").contains("poses.txt: line 2: found \"1 lines\", expected 2 as in measurement.txt"));
    assert!(refused(good, "1 0 0 0\n3 0 0 0\n").contains("poses.txt: line 2: found \"time 3\", expected 2 as in measurement.txt"));
    let again = "1 2 3 4 5 6 7 8 9\n1 2 3 4 5 6 7 8 9\n";
    assert!(refused(again, "1 0 0 0\n1 0 0 0\n").contains("line 2: found \"time 1\", expected a time after that of the line before"));
    assert!(refused("1 -2 3 4 5 6 7 8 9\n", "1 0 0 0\n").contains("line 1: found \"readings.range_m is -0.002, expected 0 to 10 m\""));
    assert!(refused(good, "1 0 0 0\n2 1e12 0 0\n").contains("line 2: found \"pose.x_m is 1000000000"));
}

#[test]
fn a_real_log_becomes_ours() {
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/sonar_log");
    if !from.is_dir() {
        eprintln!("skipped: there is no {}", from.display());
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let to = folder.path().join("log.mcap");
    let imported = import_robond(&from, &to).unwrap();
    assert_eq!(imported.scans, 413);
    // Its README: no echo is 32 % of all.
    assert_eq!(imported.without_echo * 100 / (413 * 8), 32);
    let told = info(&to).unwrap();
    assert!(told.is_complete());
    assert_eq!(told.preamble.sonars.len(), 8);
    let scans = scans(&to);
    let (_, stamp_ns, last) = scans[412];
    assert_eq!((scans.len(), stamp_ns), (413, 1_779_324_000_000));
    assert_eq!((last.pose.x_m, last.pose.y_m), (16.842, -9.437));
    assert!(import_robond(&from, &to).unwrap_err().to_string().contains("exists"));
}
