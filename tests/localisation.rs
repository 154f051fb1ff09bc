//! A drive whose odometry drifts, with a place that the robot recognises: kills and replays change neither poses nor map.

use std::path::PathBuf;
use std::sync::LazyLock;

use bus::{Reader, Received, RunningDomain};
use messages::{RobotEstimate, TrajectoryRevision};
use runtime::Observer;
use toml::{Table, Value};

use crate::harness::processes::{built_in_children, kill, look_until};
use crate::harness::recorded_drive::RecordedDrive;
use crate::harness::{Deployment, Ended, Sandbox, recorded, worlds};

/// The processes of a replay.
const PROCESSES: [&str; 6] = ["recorder", "mapping", "fti", "std", "localisation", "playback"];

/// One recorded drive for all tests, and its undisturbed replay.
static DRIVE: LazyLock<(RecordedDrive, Outcome)> = LazyLock::new(|| {
    let sandbox = Sandbox::new();
    let drive = Deployment::new("drive", &["recorder", "simulator", "pioneer"]).set("pioneer.port", "simulator");
    let recorded = RecordedDrive::of(&with_robot(drive).set("simulator.world", to_and_fro(&sandbox)), false);
    let undisturbed = Outcome::of(&sandbox, &sandbox.run(&replay(recorded.write(&sandbox)), &[]).end());
    assert!(!undisturbed.revisions.is_empty(), "the robot recognises a place");
    (recorded, undisturbed)
});

/// Up and down a corridor three times, with odometry that drifts.
fn to_and_fro(sandbox: &Sandbox) -> PathBuf {
    let mut world = worlds::read("corridor-empty");
    let leg = |x_m: f64| Value::from(Table::from_iter([("to_m".to_owned(), Value::from(vec![x_m, 1.0]))]));
    let legs = worlds::legs(&mut world);
    let y_m = legs[0]["to_m"][1].clone();
    *legs = [7.0, 2.0, 7.0, 2.0].map(leg).into();
    legs.iter_mut().for_each(|leg| leg["to_m"][1] = y_m.clone());
    let drift = [("distance_share", 0.02), ("turn_share", 0.04), ("wander_deg", 3.0)];
    world.insert("odometry".to_owned(), Value::from(Table::from_iter(drift.map(|(key, value)| (key.to_owned(), Value::from(value))))));
    worlds::write(sandbox, &world)
}

fn with_robot(deployment: Deployment) -> Deployment {
    deployment.set("robot.range_limit_m", 3.0).set("robot.odometry_modulus", 32768)
}

fn replay(log: PathBuf) -> Deployment {
    let replay = with_robot(Deployment::new("replay", &PROCESSES)).set("pace", "lockstep").tireless().patient();
    replay.set("mapping.keep_unfiltered", true).set("playback.log", log).set("playback.window", 16)
}

/// What a replay gives.
#[derive(PartialEq)]
struct Outcome {
    map: String,
    pgm: Vec<u8>,
    estimates: Vec<(u64, RobotEstimate)>,
    revisions: Vec<(u64, TrajectoryRevision)>,
}

impl Outcome {
    #[track_caller]
    fn of(sandbox: &Sandbox, ended: &Ended) -> Self {
        let out = sandbox.path("replay-out");
        let log = out.join("drive.mcap");
        let pgm = std::fs::read(out.join("map.pgm")).unwrap();
        Self { map: ended.map(), pgm, estimates: recorded(&log), revisions: recorded(&log) }
    }

    #[track_caller]
    fn assert_equals_the_undisturbed(&self, what: &str) {
        let expected = &DRIVE.1;
        assert!(self.estimates == expected.estimates, "{what}: estimates");
        assert!(self.revisions == expected.revisions, "{what}: revisions");
        assert_eq!(self.map, expected.map, "{what}: map");
        assert!(self.pgm == expected.pgm, "{what}: file of the map");
    }
}

/// The estimates of the deployment in a sandbox, once it runs.
fn estimates(sandbox: &Sandbox) -> (Observer, Reader<RobotEstimate>) {
    let mut joined = None;
    look_until("the deployment runs", || {
        let domain = RunningDomain::all_in(sandbox.runtime()).into_iter().next();
        joined = domain.and_then(|domain| Observer::join(&domain).ok()).and_then(|mut observer| {
            let reader = observer.reader().ok()?;
            Some((observer, reader))
        });
        joined.is_some()
    });
    joined.unwrap()
}

/// Replays the drive and kills the process whenever so many scans have their estimate.
#[track_caller]
fn killed_after(process: &str, scans: &[u64]) {
    let sandbox = Sandbox::new();
    let run = sandbox.run(&replay(DRIVE.0.write(&sandbox)), &[]);
    let (_observer, mut reader) = estimates(&sandbox);
    let mut last = 0;
    for scans in scans {
        look_until("a scan has its estimate", || {
            while let Some(received) = reader.take().unwrap() {
                if let Received::Message(estimate) = received {
                    last = estimate.seq();
                }
            }
            last >= *scans && built_in_children(run.pid()).contains_key(process)
        });
        kill(built_in_children(run.pid())[process]);
    }
    let ended = run.end();
    Outcome::of(&sandbox, &ended).assert_equals_the_undisturbed(&format!("{process}:\n{}\n", ended.stderr));
}

#[test]
fn a_killed_localisation_gives_the_same_map() {
    killed_after("localisation", &[1, 300, 450, 600]);
}

#[test]
fn a_mapping_killed_around_revisions_gives_the_same_map() {
    killed_after("mapping", &[1, 300, 450, 600]);
}
