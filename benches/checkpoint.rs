//! Time to keep the state of a map of 50 × 50 m and of one four times as large: whole, and what a metre of driving has changed.
//!
//! `cargo bench --bench checkpoint`; says how many bytes each is, too.
#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark")]

use std::f64::consts::TAU;
use std::path::Path;
use std::time::{Duration, Instant};

use bus::Domain;
use criterion::{Criterion, criterion_group, criterion_main};
use mapping::{CommitRule, Input, Mapper, Parameters};
use messages::{Pose, SonarReading, SonarScan};
use runtime::{Checkpoint, Shell};
use stillmap::process::mapping::Tiles;

/// Edge of a tile, m.
const TILE_M: f64 = 1.6;
/// Scans between two checkpoints.
const SCANS: u32 = 64;
/// Time between two scans, ns: mapping refuses a robot that crosses the map at more than 10 m/s.
const SCAN_NS: u64 = 20_000_000_000;

/// A map with both layers, and the number of the next scan.
struct Drive {
    mapper: Mapper,
    seq: u64,
}

impl Drive {
    /// A map of `edge` × `edge` tiles, all of them written to.
    fn new(edge: u32) -> Self {
        let commit = CommitRule::Horizon { horizon_ns: 0 };
        let parameters = Parameters { commit, keep_unfiltered: true, ..Parameters::default() };
        let mut drive = Self { mapper: Mapper::new(&parameters).unwrap(), seq: 0 };
        for place in 0..edge * edge {
            drive.scan(TILE_M * f64::from(place % edge), TILE_M * f64::from(place / edge), 0.7);
        }
        drive
    }

    fn scan(&mut self, x_m: f64, y_m: f64, yaw_rad: f64) {
        self.seq += 1;
        let mount = |sonar: u32| Pose { yaw_rad: f64::from(sonar) * TAU / 3.0, ..Pose::default() };
        let reading = |sonar| SonarReading { mount: mount(sonar), range_m: 2.0, sonar, echo: 1 };
        let scan = SonarScan::new(Pose { x_m, y_m, yaw_rad }, &[reading(0), reading(1), reading(2)], false);
        self.mapper.step(Input::Scan { seq: self.seq, stamp_ns: self.seq * SCAN_NS, scan: &scan }).unwrap();
    }

    /// The scans between two checkpoints.
    fn continue_drive(&mut self) {
        let at_m = 5.0 + (self.seq % 512) as f64 * 0.03;
        (0..SCANS).for_each(|k| self.scan(at_m + f64::from(k) * 0.03, 7.0, f64::from(k) * 0.3));
    }

    fn save(&mut self, checkpoint: &mut Checkpoint) {
        checkpoint.save_parts(&self.mapper.save_head(), &mut Tiles(&mut self.mapper));
    }
}

fn length(file: &Path) -> u64 {
    std::fs::metadata(file).unwrap().len()
}

fn checkpoints(c: &mut Criterion) {
    let domain = Domain::open(&format!("bench-save-{}", std::process::id()), 1.0).unwrap();
    let shell = Shell::join(domain.membership_for("mapping", 0, "none".as_ref())).unwrap();
    let file = domain.directory().join("state/mapping.checkpoint");
    for (edge, size) in [(32, "50 x 50 m"), (64, "100 x 100 m")] {
        let mut drive = Drive::new(edge);
        let mut checkpoint = shell.checkpoint();
        drive.save(&mut checkpoint);
        let complete = length(&file);
        drive.continue_drive();
        drive.save(&mut checkpoint);
        println!("{size}: complete {complete} bytes, changes of {SCANS} scans {} bytes", length(&file) - complete);
        // A new one does not know what is in the file.
        c.bench_function(&format!("save a map of {size} completely"), |bencher| bencher.iter(|| drive.save(&mut shell.checkpoint())));
        let mut checkpoint = shell.checkpoint();
        c.bench_function(&format!("save the changes of {SCANS} scans in a map of {size}, and all of it now and then"), |bencher| {
            bencher.iter_custom(|times| {
                let mut spent = Duration::ZERO;
                for _ in 0..times {
                    drive.continue_drive();
                    let began = Instant::now();
                    drive.save(&mut checkpoint);
                    spent += began.elapsed();
                }
                spent
            });
        });
    }
    drop(shell);
    domain.close().unwrap();
}

criterion_group!(benches, checkpoints);
criterion_main!(benches);
