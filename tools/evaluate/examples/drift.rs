//! What localisation makes of odometry that drifts: one row per world, the mean over its drives.
//!
//!     cargo run --release -p stillmap-evaluate --example drift -- odometry=d30 seeds=1..5 config/worlds/{block,rooms}.toml
//!
//! Further keys: `walkers=N`, `sonar=noisy`, `angles=off`, `each=1` for a row per drive.

use std::collections::BTreeMap;

use anyhow::Context;
use localisation::{Localisation, Parameters, RightAngles};
use simulator::Body;
use stillmap_evaluate::{ByPoses, Drive, LocalisationScore, Localised, TrajectoryError, Variation, in_parallel, oracle, read_world};

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

struct Row {
    score: LocalisationScore,
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
    let f1 = |of: fn(&ByPoses<f64>) -> f64| mean(&|row| of(&row.score.f1));
    let ate_m = |of: fn(&ByPoses<TrajectoryError>) -> TrajectoryError| mean(&|row| of(&row.score.error).distance_m);
    let heading_deg = |of: fn(&ByPoses<TrajectoryError>) -> TrajectoryError| mean(&|row| of(&row.score.error).heading_rad.to_degrees());
    let worst = rows.iter().map(|row| row.score.f1.last).fold(1.0, f64::min);
    let worst_m = rows.iter().map(|row| row.score.error.last.distance_m).fold(0.0, f64::max);
    let mut times: Vec<f64> = rows.iter().flat_map(|row| &row.times_us).copied().collect();
    times.sort_by(f64::total_cmp);
    let quantile = |share: f64| times.get(((times.len() as f64 - 1.0) * share) as usize).copied().unwrap_or(0.0);
    println!(
        "{name:<22} {:4.0} | {:.3} {:.3} {:.3} (worst {worst_m:.3}) | {:5.2} {:.2} | {:.3} {:.3} {:.3} {:.3}, {worst:.3} | {:.1} {:.1} | {:.1} | {:.0} {:.0} {:.0}",
        mean(&|row| row.score.path_m),
        ate_m(|error| error.odometry),
        ate_m(|error| error.commit),
        ate_m(|error| error.last),
        heading_deg(|error| error.odometry),
        heading_deg(|error| error.last),
        f1(|f1| f1.exact),
        f1(|f1| f1.odometry),
        f1(|f1| f1.commit),
        f1(|f1| f1.last),
        mean(&|row| row.score.closures as f64),
        mean(&|row| row.score.revisions as f64),
        mean(&|row| row.bytes as f64 / 1000.0 / row.score.path_m),
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
    let right_angles = if options.get("angles", "auto") == "off" { RightAngles::Off } else { RightAngles::Auto };
    let parameters = Parameters { enabled: true, right_angles, ..Parameters::default() };
    let (bytes, times_us) = cost(&drive, parameters)?;
    let localised = Localised::of(&drive, parameters)?;
    let score = LocalisationScore::of(&drive, &localised, &oracle(&drive), &mapping::Parameters::default())?;
    Ok(Row { score, bytes, times_us })
}

/// Size of the state after the drive, bytes, and the time of each scan, µs.
fn cost(drive: &Drive, parameters: Parameters) -> anyhow::Result<(usize, Vec<f64>)> {
    let mut localisation = Localisation::new(parameters)?;
    let mut times_us = Vec::new();
    for scan in &drive.scans {
        let start = processor_us();
        localisation.step(scan.seq, scan.stamp_ns, &scan.scan);
        times_us.push(processor_us() - start);
    }
    Ok((localisation.to_bytes().len(), times_us))
}

/// Time that this thread has had a processor, µs.
fn processor_us() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 * 1e6 + time.tv_nsec as f64 / 1e3
}
