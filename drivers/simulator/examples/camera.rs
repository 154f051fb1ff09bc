//! Writes what the simulated camera sees of a drive: `camera WORLD.toml PREFIX [key=value ...]` makes `PREFIX.frames.y4m` and
//! `PREFIX.labels.y4m`.
//!
//! Keys: `width` (160; the height is 3/4 of it), `rate_hz` (15), `height_m` (0.3), `field_of_view_deg` (70), `seed` (1), `from_s` (0)
//! and `to_s` (the end of the drive).

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use anyhow::{Context, Result, bail};
use messages::Pose;
use stillmap_simulator::Optics;
use stillmap_simulator::camera::{Camera, Flaws, Picture};

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let (Some(world), Some(prefix)) = (arguments.next(), arguments.next()) else { bail!("expected WORLD.toml and PREFIX") };
    let world = world_file::read(Path::new(&world))?;
    let (mut width, mut rate_hz, mut height_m, mut view_deg, mut seed, mut from_s, mut to_s) =
        (160, 15.0, 0.3, 70.0, 1, 0.0, f64::INFINITY);
    for argument in arguments {
        let (key, value) = argument.split_once('=').with_context(|| format!("{argument}: expected key=value"))?;
        match key {
            "width" => width = value.parse().with_context(|| argument.clone())?,
            "seed" => seed = value.parse().with_context(|| argument.clone())?,
            "rate_hz" => rate_hz = value.parse().with_context(|| argument.clone())?,
            "height_m" => height_m = value.parse().with_context(|| argument.clone())?,
            "field_of_view_deg" => view_deg = value.parse().with_context(|| argument.clone())?,
            "from_s" => from_s = value.parse().with_context(|| argument.clone())?,
            "to_s" => to_s = value.parse().with_context(|| argument.clone())?,
            _ => bail!("no key {key}"),
        }
    }
    let field_of_view_rad = f64::to_radians(view_deg);
    let optics = Optics {
        mount: Pose::default(),
        height_m,
        field_of_view_rad,
        horizon_share: 0.5,
        size_px: [width, width * 3 / 4],
        interval_ns: (1e9 / rate_hz) as u64,
    };
    let mut camera = Camera::new(&world, &optics, &Flaws::default(), seed);
    let create = |kind: &str| -> Result<BufWriter<File>> {
        let path = format!("{prefix}.{kind}.y4m");
        let mut file = BufWriter::new(File::create(&path).context(path)?);
        writeln!(file, "YUV4MPEG2 W{width} H{} F{}:1000 Ip Cmono", width * 3 / 4, (rate_hz * 1000.0) as u32)?;
        Ok(file)
    };
    let (mut frames, mut labels) = (create("frames")?, create("labels")?);
    let mut picture = Picture::default();
    for number in ((from_s * rate_hz) as u64 + 1)..=camera.total_frames().min((to_s * rate_hz) as u64) {
        camera.take(number, &mut picture);
        for (file, bytes) in [(&mut frames, &picture.grey), (&mut labels, &picture.labels)] {
            file.write_all(b"FRAME\n")?;
            file.write_all(bytes)?;
        }
    }
    Ok(())
}
