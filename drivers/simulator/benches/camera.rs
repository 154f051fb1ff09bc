//! Time of a picture at three sizes: an empty corridor, and one with walkers in it.
#![allow(missing_docs, reason = "criterion's macros")]

use criterion::{Criterion, criterion_group, criterion_main};
use messages::Pose;
use stillmap_simulator::Optics;
use stillmap_simulator::camera::{Camera, Flaws, Picture};

/// Frames that are taken in turn, from a second after the walkers have come.
const FRAMES: std::ops::Range<u64> = 300..600;

fn bench(c: &mut Criterion) {
    for (name, text) in [
        ("empty", include_str!("../../../config/worlds/corridor-empty.toml")),
        ("walkers", include_str!("../../../config/worlds/corridor.toml")),
    ] {
        let Ok(world) = world_file::parse("corridor.toml", text) else { continue };
        for size_px in [[160, 120], [320, 240], [640, 480]] {
            let field_of_view_rad = 70_f64.to_radians();
            let optics =
                Optics { mount: Pose::default(), height_m: 0.3, field_of_view_rad, horizon_share: 0.5, size_px, interval_ns: 66_666_667 };
            let mut camera = Camera::new(&world, &optics, &Flaws::default(), 1);
            let (mut picture, mut frames) = (Picture::default(), FRAMES.cycle());
            c.bench_function(&format!("camera/{name}/{}x{}", size_px[0], size_px[1]), |b| {
                b.iter(|| camera.take(frames.next().unwrap_or(1), &mut picture));
            });
        }
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
