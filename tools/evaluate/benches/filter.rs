//! Time that STD and FTI take for a drive through the hall with three and with twelve walkers, and that FTI takes to say the
//! verdicts to come after each scan, beside it.
#![allow(missing_docs, clippy::unwrap_used, reason = "a benchmark")]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use fti::{Fti, Input};
use messages::{Pose, SonarMotion};
use simulator::{Body, Optics};
use stillmap_evaluate::{CameraSetup, Chain, Drive, Variation, filter, read_world};

const HALL: &str = include_str!("../../../config/worlds/hall.toml");

fn drive(walkers: usize) -> Drive {
    let world = read_world(HALL, Variation { walkers: Some(walkers), seed: 1, stand_s: None }).unwrap();
    let optics = Optics {
        mount: Pose::default(),
        height_m: 0.3,
        field_of_view_rad: 70.0_f64.to_radians(),
        horizon_share: 0.5,
        size_px: [160, 120],
        interval_ns: 66_666_667,
    };
    Drive::through(&world, &Body::of(&psos::MODELS[0]), 3.0, Some(&CameraSetup::new(optics)), 1)
}

fn drives(c: &mut Criterion) {
    let chain = Chain::default();
    let mut group = c.benchmark_group("a scan");
    group.sample_size(10);
    for walkers in [3, 12] {
        let drive = drive(walkers);
        group.throughput(Throughput::Elements(drive.scans.len() as u64));
        group.bench_function(format!("STD and FTI, {walkers} walkers"), |bencher| {
            bencher.iter(|| filter(black_box(&drive), &chain).unwrap());
        });
    }
    group.finish();
}

fn outlook(c: &mut Criterion) {
    let drive = drive(3);
    let mut fti = Fti::new(fti::Parameters::default()).unwrap();
    let mut frames = drive.frames.iter().peekable();
    for scan in drive.scans.iter().take(300) {
        while let Some(frame) = frames.next_if(|frame| frame.stamp_ns <= scan.stamp_ns) {
            fti.step(Input::Camera { stamp_ns: frame.stamp_ns, motion: &frame.motion });
        }
        fti.step(Input::Scan { seq: scan.seq, stamp_ns: scan.stamp_ns, scan: &scan.scan });
        fti.step(Input::Sonar { seq: scan.seq, motion: &SonarMotion::default() });
    }
    c.bench_function("the verdicts to come, after a scan", |bencher| bencher.iter(|| black_box(fti.outlook())));
}

criterion_group!(benches, drives, outlook);
criterion_main!(benches);
