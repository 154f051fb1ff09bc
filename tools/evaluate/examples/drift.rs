//! What localisation makes of odometry that drifts: one row per world, the mean over its drives.
//!
//!     cargo run --release -p stillmap-evaluate --example drift -- odometry=d30 seeds=1..5 config/worlds/{block,rooms}.toml
//!
//! Further keys: `walkers=N`, `sonar=noisy`, `angles=off`, `each=1` for a row per drive.

use std::collections::BTreeMap;

use anyhow::Context;
use geometry::CellSize;
use localisation::{Localisation, Moved, Parameters, RightAngles};
use messages::{Layer, Pose};
use simulator::Body;
use stillmap_evaluate::{Drive, Labels, Occupancy, Variation, in_parallel, mapped, oracle, read_world};

/// As worlds declare them: distances 2 % too long, turns 4 % too large, the heading wanders by 1.5 or 3 °/√m.
const ODOMETRY: [(&str, [f64; 3]); 4] =
    [("exact", [0.0, 0.0, 0.0]), ("d15", [0.02, 0.04, 1.5]), ("d30", [0.02, 0.04, 3.0]), ("-d30", [-0.02, -0.04, 3.0])];
/// Deviation of 2 cm and 1 %, 3 % crosstalk, 10 % of the echoes missed.
const NOISY: &str = "\n[sonar]\nnoise_m = 0.02\nnoise_share = 0.01\ncrosstalk = 0.03\nmissed = 0.1\nmirrored = 1.0\n";

struct Options {
    keys: BTreeMap<String, String>,
    worlds: Vec<String>,
}

impl Options {
    fn read() -> Self {
        let (keys, worlds): (Vec<String>, Vec<String>) = std::env::args().skip(1).partition(|word| word.contains('='));
        let keys = keys.iter().filter_map(|word| word.split_once('=')).map(|(key, value)| (key.to_owned(), value.to_owned()));
        Self { keys: keys.collect(), worlds }
    }

    fn get<'a>(&'a self, key: &str, default: &'a str) -> &'a str {
        self.keys.get(key).map_or(default, String::as_str)
    }
}

/// Root mean square of the distance and of the heading's error, after a rigid alignment.
struct Errors {
    distance_m: f64,
    heading_rad: f64,
}

struct Row {
    path_m: f64,
    odometry: Errors,
    commit: Errors,
    last: Errors,
    /// Of the map by true poses, by odometry, by committed and by final poses.
    f1: [f64; 4],
    closures: usize,
    revisions: usize,
    bytes: usize,
    /// Time of each scan, ascending, µs.
    times_us: Vec<f64>,
}

#[allow(clippy::print_stdout, reason = "its only output")]
fn main() -> anyhow::Result<()> {
    let options = Options::read();
    let (first, last) = options.get("seeds", "1..5").split_once("..").context("seeds=FIRST..LAST")?;
    let seeds: Vec<u64> = (first.parse()?..=last.parse()?).collect();
    let tasks: Vec<(&String, u64)> = options.worlds.iter().flat_map(|world| seeds.iter().map(move |seed| (world, *seed))).collect();
    let rows = in_parallel(&tasks, |(world, seed)| run(&options, world, *seed))?;
    println!(
        "{:<22} path | ATE m: odometry commit final | heading deg: odometry final | F1: true odometry commit final, worst final | closures revisions | kB/m | us a scan: median 99.9 % most",
        "world"
    );
    for (world, rows) in options.worlds.iter().zip(rows.chunks(seeds.len())) {
        if options.get("each", "0") == "1" {
            rows.iter().zip(&seeds).for_each(|(row, seed)| print(&format!("{} {seed}", name(world)), std::slice::from_ref(row)));
        }
        print(name(world), rows);
    }
    Ok(())
}

fn name(world: &str) -> &str {
    world.rsplit('/').next().unwrap_or(world).trim_end_matches(".toml")
}

#[allow(clippy::print_stdout, reason = "its only output")]
fn print(name: &str, rows: &[Row]) {
    let mean = |number: &dyn Fn(&Row) -> f64| rows.iter().map(number).sum::<f64>() / rows.len() as f64;
    let f1 = [0, 1, 2, 3].map(|k| mean(&|row| row.f1[k]));
    let worst = rows.iter().map(|row| row.f1[3]).fold(1.0, f64::min);
    let worst_m = rows.iter().map(|row| row.last.distance_m).fold(0.0, f64::max);
    let mut times: Vec<f64> = rows.iter().flat_map(|row| &row.times_us).copied().collect();
    times.sort_by(f64::total_cmp);
    let quantile = |share: f64| times.get(((times.len() as f64 - 1.0) * share) as usize).copied().unwrap_or(0.0);
    println!(
        "{name:<22} {:4.0} | {:.3} {:.3} {:.3} (worst {worst_m:.3}) | {:5.2} {:.2} | {:.3} {:.3} {:.3} {:.3}, {worst:.3} | {:.1} {:.1} | {:.1} | {:.0} {:.0} {:.0}",
        mean(&|row| row.path_m),
        mean(&|row| row.odometry.distance_m),
        mean(&|row| row.commit.distance_m),
        mean(&|row| row.last.distance_m),
        mean(&|row| row.odometry.heading_rad.to_degrees()),
        mean(&|row| row.last.heading_rad.to_degrees()),
        f1[0],
        f1[1],
        f1[2],
        f1[3],
        mean(&|row| row.closures as f64),
        mean(&|row| row.revisions as f64),
        mean(&|row| row.bytes as f64 / 1000.0 / row.path_m),
        quantile(0.5),
        quantile(0.999),
        quantile(1.0),
    );
}

fn run(options: &Options, path: &str, seed: u64) -> anyhow::Result<Row> {
    let mut text = std::fs::read_to_string(path).context(path.to_owned())?;
    if options.get("sonar", "usual") == "noisy" {
        text.push_str(NOISY);
    }
    let odometry = ODOMETRY.iter().find(|(name, _)| *name == options.get("odometry", "d30")).context("odometry=exact, d15 or d30")?.1;
    let [distance, turn, wander] = odometry;
    text.push_str(&format!("\n[odometry]\ndistance_share = {distance:?}\nturn_share = {turn:?}\nwander_deg = {wander:?}\n"));
    let walkers = options.get("walkers", "0").parse().ok();
    let world = read_world(&text, Variation { walkers, seed, stand_s: None })?;
    let drive = Drive::through(&world, &Body::of(&psos::MODELS[0]), 3.0, None, seed);
    let truth: Vec<Pose> = drive.scans.iter().map(|scan| scan.truth.pose).collect();
    let start = truth.first().copied().unwrap_or_default();
    let truth: Vec<Pose> = truth.iter().map(|pose| relative(&start, pose)).collect();
    let right_angles = if options.get("angles", "auto") == "off" { RightAngles::Off } else { RightAngles::Auto };
    let estimate = localised(&drive, Parameters { enabled: true, right_angles, ..Parameters::default() })?;
    let odometry: Vec<Pose> = drive.scans.iter().map(|scan| scan.scan.pose).collect();
    let poses = [&truth, &odometry, &estimate.commit, &estimate.last];
    let mut f1 = [0.0; 4];
    if options.get("f1", "1") == "1" {
        let parameters = mapping::Parameters::default();
        let verdicts = oracle(&drive);
        let map = |poses: &[Pose]| -> anyhow::Result<Occupancy> {
            let mut moved = drive.clone();
            moved.scans.iter_mut().zip(aligned(poses, &truth)).for_each(|(scan, pose)| scan.scan.pose = pose);
            Ok(Occupancy::of(&mapped(&moved, &parameters, &verdicts)?, Layer::Filtered))
        };
        let reference = map(&truth)?;
        let labels = Labels::new(&drive.truth, CellSize::new(parameters.cell_m)?);
        for (f1, poses) in f1.iter_mut().zip(poses) {
            let map = map(poses)?;
            *f1 = labels.tally(&map, &map, &map, &reference).score().f1;
        }
    }
    let [_, odometry, commit, last] = poses.map(|poses| errors(poses, &truth));
    let path_m = truth.windows(2).map(|pair| (pair[0].x_m - pair[1].x_m).hypot(pair[0].y_m - pair[1].y_m)).sum();
    let Estimate { closures, revisions, bytes, times_us, .. } = estimate;
    Ok(Row { path_m, odometry, commit, last, f1, closures, revisions, bytes, times_us })
}

struct Estimate {
    commit: Vec<Pose>,
    last: Vec<Pose>,
    closures: usize,
    revisions: usize,
    bytes: usize,
    times_us: Vec<f64>,
}

/// The poses as a consumer receives them: at the commit horizon, and after the revisions.
fn localised(drive: &Drive, parameters: Parameters) -> anyhow::Result<Estimate> {
    let mut localisation = Localisation::new(parameters)?;
    let mut answers = Vec::new();
    let mut times_us = Vec::new();
    for scan in &drive.scans {
        let start = processor_us();
        answers.push(localisation.step(scan.seq, scan.stamp_ns, &scan.scan));
        times_us.push(processor_us() - start);
    }
    let bytes = localisation.to_bytes().len();
    answers.push(localisation.finish());
    let mut last: BTreeMap<u64, Pose> = BTreeMap::new();
    let mut commit = Vec::new();
    let mut revisions = 0;
    for answer in &answers {
        if let Some(it) = &answer.revision {
            revisions += 1;
            it.moved.iter().for_each(|moved| revise(&mut last, moved));
        }
        for it in &answer.smoothed {
            commit.push(it.map_from_robot.to_wire());
            last.insert(it.seq, it.map_from_robot.to_wire());
        }
    }
    let closures = localisation.closures().filter(|closure| closure.weight > 0.3).count();
    Ok(Estimate { commit, last: last.into_values().collect(), closures, revisions, bytes, times_us })
}

/// Time that this thread has had a processor, µs.
fn processor_us() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 * 1e6 + time.tv_nsec as f64 / 1e3
}

fn revise(poses: &mut BTreeMap<u64, Pose>, moved: &Moved) {
    let motion = moved.now.then(&moved.before.inverse()).to_wire();
    poses.range_mut(moved.first..=moved.last).for_each(|(_, pose)| *pose = motion.then(pose));
}

fn relative(from: &Pose, to: &Pose) -> Pose {
    let (sin, cos) = from.yaw_rad.sin_cos();
    let (dx, dy) = (to.x_m - from.x_m, to.y_m - from.y_m);
    Pose::new(cos * dx + sin * dy, cos * dy - sin * dx, to.yaw_rad - from.yaw_rad)
}

/// The poses laid rigidly on the truth.
fn aligned(poses: &[Pose], truth: &[Pose]) -> Vec<Pose> {
    let count = poses.len().max(1) as f64;
    let mean =
        |list: &[Pose]| [list.iter().map(|pose| pose.x_m).sum::<f64>() / count, list.iter().map(|pose| pose.y_m).sum::<f64>() / count];
    let (from, to) = (mean(poses), mean(truth));
    let (mut cos, mut sin) = (0.0, 0.0);
    for (pose, target) in poses.iter().zip(truth) {
        let (p, t) = ([pose.x_m - from[0], pose.y_m - from[1]], [target.x_m - to[0], target.y_m - to[1]]);
        cos += p[0] * t[0] + p[1] * t[1];
        sin += p[0] * t[1] - p[1] * t[0];
    }
    let turn = Pose::new(0.0, 0.0, sin.atan2(cos));
    let centre = turn.then(&Pose::new(from[0], from[1], 0.0));
    let motion = Pose::new(to[0] - centre.x_m, to[1] - centre.y_m, turn.yaw_rad);
    poses.iter().map(|pose| motion.then(pose)).collect()
}

fn errors(poses: &[Pose], truth: &[Pose]) -> Errors {
    let count = poses.len().max(1) as f64;
    let aligned = aligned(poses, truth);
    let squares =
        |error: &dyn Fn(&Pose, &Pose) -> f64| aligned.iter().zip(truth).map(|(pose, truth)| error(pose, truth).powi(2)).sum::<f64>();
    let distance_m = (squares(&|pose, truth| (pose.x_m - truth.x_m).hypot(pose.y_m - truth.y_m)) / count).sqrt();
    let heading_rad = (squares(&|pose, truth| geometry::wrapped(pose.yaw_rad - truth.yaw_rad)) / count).sqrt();
    Errors { distance_m, heading_rad }
}
