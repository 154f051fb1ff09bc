//! Time to integrate one 3 m beam with the full fuzzy-tuned model into a 5 cm lattice, in small and large maps.
#![allow(missing_docs, clippy::unwrap_used, reason = "a benchmark")]

use std::f64::consts::TAU;
use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use grid::{Cell, CellSize, Lattice, TILE_EDGE};
use messages::{Pose, SonarReading};
use stillmap_mapping::{Parameters, integrate_reading};

fn beams(c: &mut Criterion) {
    let parameters = Parameters::new(&settings::Mapping::default(), settings::Pace::Lockstep).unwrap();
    for tiles_wide in [1, 100, 400] {
        let mut lattice = Lattice::new(CellSize::new(parameters.cell_m()).unwrap());
        for row in 0..tiles_wide {
            for column in 0..tiles_wide {
                lattice.set(Cell { row: row * TILE_EDGE as i32, column: column * TILE_EDGE as i32 }, 0.5);
            }
        }
        for (name, range_m, echo) in [("3 m echo", 3.0, 1), ("1 m echo", 1.0, 1), ("no echo", 3.0, 0)] {
            let mut turn = 0.0;
            c.bench_function(&format!("{name}, map of {} tiles", tiles_wide * tiles_wide), |bencher| {
                bencher.iter(|| {
                    turn = (turn + 0.618_034) % 1.0;
                    let pose = Pose { x_m: 4.0 + 0.1 * turn, y_m: 4.0 - 0.1 * turn, yaw_rad: turn * TAU };
                    let reading = SonarReading { range_m, echo, ..SonarReading::default() };
                    integrate_reading(&mut lattice, &parameters, black_box(&pose), black_box(&reading));
                });
            });
        }
    }
}

criterion_group!(benches, beams);
criterion_main!(benches);
