//! A simulated world waits for the processes that map its drive, however slow they are.

use messages::CameraMotion;
use toml::{Table, Value};

use crate::harness::{Deployment, Sandbox, recorded};

/// SBS stopped for two thirds of the time, as on a machine that is too slow for the pace that is asked for.
fn slow(process: &str) -> Table {
    let numbers = [("from_s", 5.0), ("for_s", 600.0), ("rate", 0.66)];
    let numbers = numbers.map(|(key, value)| (key.to_owned(), Value::from(value)));
    let names = [("process", process), ("kind", "slow")].map(|(key, value)| (key.to_owned(), Value::from(value)));
    names.into_iter().chain(numbers).collect()
}

#[test]
fn a_slow_consumer_skips_no_picture_and_changes_no_map() {
    let sandbox = Sandbox::new();
    let demo = Deployment::demo().without("viewer").with("injector").fault(slow("sbs"));
    let driven = sandbox.run(&demo, &["--speed", "20"]).end().map();
    let log = sandbox.path("demo-out").join("drive.mcap");
    let answered: Vec<u64> = recorded::<CameraMotion>(&log).into_iter().map(|(seq, _)| seq).collect();
    assert!(answered.len() > 500, "{answered:?}");
    assert_eq!(answered, (1..=answered.len() as u64).collect::<Vec<_>>(), "each picture is answered");
    assert_eq!(sandbox.replayed(&log, "again"), driven);
}
