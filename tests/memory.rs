//! An hour of simulated driving at ten times the speed: no process takes more memory at the end than once it had warmed up, and
//! shared memory stays as it is.
//!
//! `cargo test --release -p stillmap --test memory -- --ignored --nocapture`; `STILLMAP_MEMORY_S` (default 3600) says how long the
//! robot drives, `STILLMAP_MEMORY_SPEED` (default 10) how fast. It takes six minutes and a gigabyte of disk.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod harness;

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::os::unix::fs::MetadataExt;
use std::time::{Duration, Instant};

use harness::Bench;
use harness::replays::{Watched, children};

const DEMO: &str = include_str!("../config/demo.toml");
const HALL: &str = include_str!("../config/worlds/hall.toml");
/// Where the robot drives in the hall, again and again.
const LAP_M: [[f64; 2]; 5] = [[9.8, 2.2], [10.0, 5.2], [3.0, 5.3], [1.2, 4.8], [1.0, 2.2]];
/// A lap takes about so long, s.
const LAP_S: f64 = 96.0;
/// Between two looks.
const LOOK: Duration = Duration::from_secs(2);
/// The share of the time until everything has warmed up: the hall is mapped, every page of shared memory was in use.
const WARM: f64 = 0.2;
/// What a process may have more at the end than after warming up, of its own memory: the allocator's to and fro, KiB.
const MOST_MORE_KIB: f64 = 1024.0;

fn number(variable: &str, default: f64) -> f64 {
    std::env::var(variable).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// The hall with so many laps in it.
fn world(laps: usize) -> String {
    let (head, rest) = HALL.split_once("[[robot.way]]").unwrap();
    let (_, walls) = rest.split_once("# Walls").unwrap();
    let lap = LAP_M.map(|[x, y]| format!("[[robot.way]]\nto_m = [{x}, {y}]\n")).concat();
    format!("{head}{}\n# Walls{walls}", lap.repeat(laps))
}

/// Memory of a process, KiB: all that is resident, and what of it is its own.
fn memory(pid: u64) -> Option<[f64; 2]> {
    let status = fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
    let of = |key: &str| status.lines().find_map(|line| line.strip_prefix(key)?.trim().strip_suffix(" kB")?.parse().ok());
    Some([of("VmRSS:")?, of("RssAnon:")?])
}

/// Pages of `/dev/shm` that the deployment of this bench has in use, KiB.
fn shared(bench: &Bench) -> f64 {
    let left = bench.left_behind();
    let sizes = left.iter().filter(|path| path.starts_with("/dev/shm")).filter_map(|path| fs::metadata(path).ok());
    sizes.map(|file| file.blocks() as f64 / 2.0).sum()
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

/// What a curve is once it has warmed up, and at its end: medians of a tenth of it each, and its largest value between.
fn ends(curve: &[f64]) -> [f64; 3] {
    let (count, warm) = (curve.len(), (curve.len() as f64 * WARM) as usize);
    let tenth = (count / 10).max(1);
    [median(&curve[warm..warm + tenth]), median(&curve[count - tenth..]), curve[warm..].iter().copied().fold(0.0, f64::max)]
}

#[test]
#[ignore = "takes six minutes: see the top of the file"]
fn an_hour_takes_no_more_memory_than_its_beginning() {
    let (drive_s, speed) = (number("STILLMAP_MEMORY_S", 3600.0), number("STILLMAP_MEMORY_SPEED", 10.0));
    let bench = Bench::with_a_copy();
    let world = bench.write("laps.toml", &world((drive_s / LAP_S).ceil() as usize));
    let settings = bench.write("memory.toml", &DEMO.replace("worlds/hall.toml", world.to_str().unwrap()));
    let mut run = Watched::start(bench.stillmap(["run", settings.to_str().unwrap(), "--speed", &speed.to_string()]));
    drop(run.wait_for_line("pioneer    connected"));
    bench.remember_domain();

    let mut resident: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    let mut own: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    let mut shm = Vec::new();
    let mut looked = Instant::now();
    loop {
        match run.line(LOOK.saturating_sub(looked.elapsed())) {
            None => break,
            Some(Some(_)) => continue,
            Some(None) => looked = Instant::now(),
        }
        shm.push(shared(&bench));
        for (name, pid) in children(run.pid()).into_iter().chain([("supervisor".to_owned(), run.pid().into())]) {
            if let Some([all, its]) = memory(pid) {
                resident.entry(name.clone()).or_default().push(all);
                own.entry(name).or_default().push(its);
            }
        }
    }
    let (code, stdout, stderr) = run.end();
    assert_eq!(code, Some(0), "{stdout}{stderr}");

    say(&format!("{drive_s} s at {speed} times the speed, {} looks; KiB after warming up, at the end, at most", shm.len()));
    let [first, last, most] = ends(&shm);
    say(&format!("/dev/shm    {first:8.0} {last:8.0} {most:8.0}"));
    let mut grown = Vec::new();
    for (name, curve) in &resident {
        let ([first, last, most], [own_first, own_last, _]) = (ends(curve), ends(&own[name]));
        say(&format!("{name:<11} {first:8.0} {last:8.0} {most:8.0}   its own {own_first:8.0} {own_last:8.0}"));
        if own_last - own_first > MOST_MORE_KIB {
            grown.push(format!("{name}: from {own_first} to {own_last} KiB"));
        }
    }
    assert!(grown.is_empty(), "{grown:?}");
    let [first, _, most] = ends(&shm);
    assert!(most < 2.0 * first + 4096.0, "/dev/shm: from {first} to {most} KiB");
}
