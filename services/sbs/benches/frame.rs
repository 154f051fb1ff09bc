//! Time of a frame at three sizes, camera still and panning. Peers are measured beside it by a script, in the same run.
#![allow(missing_docs, reason = "criterion's macros")]

#[path = "../tests/common/mod.rs"]
mod common;

use criterion::{Criterion, criterion_group, criterion_main};
use stillmap_sbs::{Parameters, State};

/// Frames that are run through before and during the measurement, back and forth.
const FRAMES: u64 = 40;

fn bench(c: &mut Criterion) {
    for (width, height) in [(160, 120), (320, 240), (640, 480)] {
        for (name, pan) in [("still", 0.0), ("panning", 1.2)] {
            let unit = width as f64 / 160.0;
            let frame = |n: u64| {
                let t = n as f64;
                let figure = [(20.0 + 2.0 * t) * unit, 0.2 * height as f64, 24.0 * unit, 0.7 * height as f64];
                common::picture(width, height, [pan * t, 0.0], Some(figure), n)
            };
            let frames: Vec<Vec<u8>> = (0..FRAMES).chain((0..FRAMES).rev()).map(frame).collect();
            let mut state = State::new(Parameters { training_frames: 0, ..Parameters::default() });
            let layout = common::grey(width, height);
            let mut n = 0;
            c.bench_function(&format!("frame/{width}x{height}/{name}"), |b| {
                b.iter(|| {
                    n += 1;
                    common::step(&mut state, n, layout, &frames[n as usize % frames.len()])
                });
            });
        }
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
