//! An hour of simulated driving at ten times the speed: no process has more memory at the end than after warming up, and shared memory
//! does not grow.
//!
//! Six minutes and a gigabyte of disk:
//!
//!     cargo test --release -p stillmap --test stillmap memory -- --ignored --nocapture
//!
//! `STILLMAP_MEMORY_S` (default 3600) is how long the robot drives, `STILLMAP_MEMORY_SPEED` (default 10) how fast.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

use toml::Value;

use crate::harness::processes::built_in_children;
use crate::harness::{Deployment, Sandbox, worlds};

/// Where the robot drives in the hall, again and again.
const LAP_M: [[f64; 2]; 5] = [[9.8, 2.2], [10.0, 5.2], [3.0, 5.3], [1.2, 4.8], [1.0, 2.2]];
/// A lap takes about this long, s.
const LAP_S: f64 = 96.0;
/// Between two samples.
const SAMPLE: Duration = Duration::from_secs(2);
/// The share of the time in which everything warms up: the hall is mapped, every page of shared memory has been in use.
const WARM: f64 = 0.2;
/// What a process may have more at the end than after warming up, of its private memory: variation of the allocator, KiB.
const MOST_MORE_KIB: f64 = 1024.0;

fn number(variable: &str, default: f64) -> f64 {
    std::env::var(variable).map_or(default, |text| text.parse().unwrap())
}

/// The hall with so many laps in it.
fn hall(laps: usize) -> toml::Table {
    let mut hall = worlds::read("hall");
    let leg = |to_m: [f64; 2]| Value::Table([("to_m".to_owned(), Value::from(to_m.to_vec()))].into_iter().collect());
    *worlds::legs(&mut hall) = LAP_M.repeat(laps).into_iter().map(leg).collect();
    hall
}

/// Memory of a process, KiB: all that is resident, and the private part of it.
fn memory_kib(pid: u32) -> Option<[f64; 2]> {
    let status = fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
    let of = |key: &str| status.lines().find_map(|line| line.strip_prefix(key)?.trim().strip_suffix(" kB")?.parse().ok());
    Some([of("VmRSS:")?, of("RssAnon:")?])
}

/// Pages of `/dev/shm` that the sandbox's deployment uses, KiB.
fn shared_kib(sandbox: &Sandbox) -> f64 {
    sandbox.shared_memory().iter().filter_map(|path| fs::metadata(path).ok()).map(|file| file.blocks() as f64 / 2.0).sum()
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

/// A curve after warming up and at its end, medians of a tenth of it each, and its largest value in between.
fn ends(curve: &[f64]) -> [f64; 3] {
    let (count, warm) = (curve.len(), (curve.len() as f64 * WARM) as usize);
    let tenth = (count / 10).max(1);
    [median(&curve[warm..warm + tenth]), median(&curve[count - tenth..]), curve[warm..].iter().copied().fold(0.0, f64::max)]
}

#[test]
#[ignore = "takes six minutes: see the top of the file"]
fn an_hour_of_driving_does_not_grow_memory() {
    let (drive_s, speed) = (number("STILLMAP_MEMORY_S", 3600.0), number("STILLMAP_MEMORY_SPEED", 10.0));
    let sandbox = Sandbox::with_a_copy();
    let world = worlds::write(&sandbox, &hall((drive_s / LAP_S).ceil() as usize));
    let mut run = sandbox.run(&Deployment::demo().set("simulator.world", world), &["--speed", &speed.to_string()]);
    run.wait_for_line("pioneer    connected");

    let mut resident: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    let mut private: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    let mut shm = Vec::new();
    let mut sampled = Instant::now();
    loop {
        match run.line(SAMPLE.saturating_sub(sampled.elapsed())) {
            Err(RecvTimeoutError::Disconnected) => break,
            Err(RecvTimeoutError::Timeout) => sampled = Instant::now(),
            Ok(_) => continue,
        }
        shm.push(shared_kib(&sandbox));
        for (name, pid) in built_in_children(run.pid()).into_iter().chain([("supervisor".to_owned(), run.pid())]) {
            if let Some([all, own]) = memory_kib(pid) {
                resident.entry(name.clone()).or_default().push(all);
                private.entry(name).or_default().push(own);
            }
        }
    }
    run.end().assert_code(0);

    eprintln!("{drive_s} s at {speed} times the speed, {} samples; KiB after warming up, at the end, at most", shm.len());
    let [first, last, most] = ends(&shm);
    eprintln!("/dev/shm    {first:8.0} {last:8.0} {most:8.0}");
    let mut grown = Vec::new();
    for (name, curve) in &resident {
        let ([first, last, most], [own_first, own_last, _]) = (ends(curve), ends(&private[name]));
        eprintln!("{name:<11} {first:8.0} {last:8.0} {most:8.0}   private {own_first:8.0} {own_last:8.0}");
        if own_last - own_first > MOST_MORE_KIB {
            grown.push(format!("{name}: from {own_first} to {own_last} KiB"));
        }
    }
    assert!(grown.is_empty(), "{grown:?}");
    let [first, _, most] = ends(&shm);
    assert!(most < 2.0 * first + 4096.0, "/dev/shm: from {first} to {most} KiB");
}
