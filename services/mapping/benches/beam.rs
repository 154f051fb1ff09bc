//! Time to integrate one beam with the full fuzzy-tuned model into a 5 cm lattice, in a small and in a large map; to show the map
//! anew within the horizon.
#![allow(missing_docs, clippy::unwrap_used, reason = "a benchmark")]

use std::f64::consts::TAU;
use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use messages::{Pose, SonarReading, SonarScan};
use stillmap_mapping::{CommitRule, Input, Mapper, Parameters};

/// Edge of a tile, m.
const TILE_M: f64 = 1.6;

/// Time from one ping to the next, ns.
const PING_NS: u64 = 40_000_000;
/// After this time the mapper believes any pose, ns.
const CARRIED_NS: u64 = 1_000_000_000;

/// A mapper with the number and the time of its last scan.
struct Drive {
    mapper: Mapper,
    seq: u64,
    stamp_ns: u64,
}

impl Drive {
    /// A map of `edge` × `edge` tiles; a scan is integrated for good `horizon_ns` after it came.
    fn new(edge: u32, horizon_ns: u64) -> Self {
        let parameters = Parameters { commit: CommitRule::Horizon { horizon_ns }, ..Parameters::default() };
        let mut drive = Self { mapper: Mapper::new(&parameters).unwrap(), seq: 0, stamp_ns: 0 };
        for place in 0..edge * edge {
            let pose = Pose { x_m: TILE_M * f64::from(place % edge), y_m: TILE_M * f64::from(place / edge), yaw_rad: 0.7 };
            drive.scan_after(CARRIED_NS, pose, 1.0, 1);
        }
        drive.scan_after(CARRIED_NS, Pose { x_m: 4.0, y_m: 4.0, yaw_rad: 0.0 }, 1.0, 1);
        drive
    }

    fn scan_after(&mut self, elapsed_ns: u64, pose: Pose, range_m: f64, echo: u32) {
        (self.seq, self.stamp_ns) = (self.seq + 1, self.stamp_ns + elapsed_ns);
        let scan = SonarScan::new(pose, &[SonarReading { range_m, echo, ..SonarReading::default() }], false);
        self.mapper.step(Input::Scan { seq: self.seq, stamp_ns: self.stamp_ns, scan: black_box(&scan) }).unwrap();
    }

    fn turning_scan(&mut self, range_m: f64, echo: u32) {
        let turn = self.seq as f64 * 0.618_034 % 1.0;
        self.scan_after(PING_NS, Pose { x_m: 4.0 + 0.1 * turn, y_m: 4.0 - 0.1 * turn, yaw_rad: turn * TAU }, range_m, echo);
    }
}

fn beams(c: &mut Criterion) {
    for edge in [4, 400] {
        let mut drive = Drive::new(edge, 0);
        for (name, range_m, echo) in [("3 m echo", 3.0, 1), ("1 m echo", 1.0, 1), ("no echo", 3.0, 0)] {
            c.bench_function(&format!("{name}, map of {} tiles", edge * edge), |bencher| {
                bencher.iter(|| drive.turning_scan(range_m, echo))
            });
        }
    }
}

fn shown(c: &mut Criterion) {
    let mut drive = Drive::new(40, 3_000_000_000);
    (0..75).for_each(|place| drive.turning_scan(0.5 + f64::from(place % 25) * 0.1, 1));
    c.bench_function("show 75 pending readings", |bencher| bencher.iter(|| drive.mapper.refresh()));
}

criterion_group!(benches, beams, shown);
criterion_main!(benches);
