//! Sweeps worlds and seeds: `sweep [--seeds 1..2] [--walkers 3] [--rule likelihood,paper,std,ideal] [--errors 2] [--aside 37.5] [--verbose 1] WORLD…`; one line for each world and one for all.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command")]

use std::collections::BTreeMap;

use simulator::blobs::Failings;
use simulator::{Body, Optics};
use stillmap_evaluate::{
    Detection, Drive, Eyes, Filter, Labels, Tally, Variation, filter, judge, oracle, read_world, track_errors_m, unfiltered,
};

type Error = Box<dyn std::error::Error>;

fn main() -> Result<(), Error> {
    let mut options: BTreeMap<String, String> = BTreeMap::new();
    let mut worlds = Vec::new();
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.strip_prefix("--") {
            Some(key) => {
                let value = arguments.next().unwrap_or_default();
                options.insert(key.to_owned(), value);
            }
            None => worlds.push(argument),
        }
    }
    let option = |key: &str, default: &str| options.get(key).cloned().unwrap_or_else(|| default.to_owned());
    let (first, last) = option("seeds", "1..2").split_once("..").map(|(a, b)| (a.parse::<u64>(), b.parse::<u64>())).ok_or("seeds A..B")?;
    let walkers = match option("walkers", "3").as_str() {
        "file" => None,
        number => Some(number.parse()?),
    };
    let rule = option("rule", "likelihood");
    let scale: f64 = option("errors", "1").parse()?;
    let verbose = options.contains_key("verbose");
    let settings = settings::Mapping::default();
    let body = Body::of_settings(&settings::Robot::default());
    let optics = Optics::of_settings(&settings::Camera::default());
    let default = Failings::default();
    let failings = if rule == "paper" || rule == "ideal" {
        Failings::NONE
    } else {
        Failings {
            focal_share: scale * default.focal_share,
            horizon_px: scale * default.horizon_px,
            height_m: scale * default.height_m,
            ..default
        }
    };
    let mut parameters = fti::Parameters::default();
    let mut std = stillmap_std::Parameters::default();
    if rule == "paper" {
        (parameters.rule, parameters.cue) = (fti::Rule::Paper, fti::Cue::Paper);
        std.rule = stillmap_std::Rule::Paper;
    }
    if rule == "std" {
        parameters.camera = None;
    }
    std.aside_rad = option("aside", "37.5").parse::<f64>()?.to_radians();
    let run = Filter { std, fti: parameters };
    let mut all = Tally::default();
    let mut seen = Detection::default();
    for path in &worlds {
        let text = std::fs::read_to_string(path)?;
        let mut of_world = Tally::default();
        let mut errors = Vec::new();
        for seed in first.clone()?..=last.clone()? {
            let world = read_world(&text, Variation { walkers, seed })?;
            let drive = Drive::through(&world, &body, 3.0, (rule != "std").then_some(&Eyes { optics, failings }), seed);
            let empty = Drive::through(&read_world(&text, Variation { walkers: Some(0), seed })?, &body, 3.0, None, seed);
            let outcome = filter(&drive, &run)?;
            let maps = [&outcome.verdicts, &unfiltered(&drive), &oracle(&drive)].map(|verdicts| judge(&drive, &settings, verdicts));
            let [map, before, truth] = maps;
            let reference = judge(&empty, &settings, &unfiltered(&empty))?;
            let labels = Labels::new(&drive.truth, grid::CellSize::new(settings.cell_m.get())?);
            let mut tally = labels.tally(&map?, &before?, &truth?, &reference);
            tally.count_verdicts(&drive, &outcome.verdicts);
            let detection = Detection::count(&drive, &outcome.motions, run.std.aside_rad);
            errors.extend(track_errors_m(&drive, &outcome.tracks_m, 3.0));
            if verbose {
                print(&format!("{path} {seed}"), &tally);
            }
            if options.contains_key("dump") {
                dump(path, seed, &drive, &outcome);
            }
            of_world = of_world.with(&tally);
            seen = Detection {
                walker_echoes: seen.walker_echoes + detection.walker_echoes,
                detected: seen.detected + detection.detected,
                reported: seen.reported + detection.reported,
                false_alarms: seen.false_alarms + detection.false_alarms,
                minutes: seen.minutes + detection.minutes,
            };
        }
        errors.sort_by(f64::total_cmp);
        let median = errors.get(errors.len() / 2).copied().unwrap_or(f64::NAN);
        print(&format!("{path} (track {median:.2} m)"), &of_world);
        all = all.with(&of_world);
    }
    print("all", &all);
    let share = |part: usize, whole: usize| part as f64 / whole.max(1) as f64;
    println!(
        "std: precision {:.2} recall {:.2} false alarms {:.1} a minute",
        share(seen.detected, seen.reported),
        share(seen.detected, seen.walker_echoes),
        seen.false_alarms as f64 / seen.minutes.max(1e-9)
    );
    Ok(())
}

fn print(name: &str, tally: &Tally) {
    let score = tally.score();
    println!(
        "{name:55} removed {:5.1} % ({}→{}, oracle {}; literal {:.1} %)  walls lost {:4.2} % (reference {:4.2} %)  F1 {:.3}  echoes {}/{} of walkers, {} others of {}",
        100.0 * score.ghosts_removed,
        tally.ghosts_before,
        tally.ghosts_after,
        tally.ghosts_oracle,
        100.0 * score.ghosts_removed_literal,
        100.0 * score.walls_lost,
        100.0 * score.walls_lost_reference,
        score.f1,
        tally.withheld_walkers,
        tally.walker_echoes,
        tally.withheld - tally.withheld_walkers,
        tally.echoes - tally.walker_echoes,
    );
}

/// One line for each echo: what it was, where from, and the grounds of its verdict.
fn dump(path: &str, seed: u64, drive: &Drive, outcome: &stillmap_evaluate::Outcome) {
    for ((scan, grounds), verdict) in drive.scans.iter().zip(&outcome.grounds).zip(&outcome.verdicts) {
        for (index, (reading, grounds)) in
            scan.scan.readings().iter().zip(grounds).enumerate().filter(|(_, (reading, _))| reading.echo != 0)
        {
            let Some(truth) = scan.truth.readings.get(index) else { continue };
            println!(
                "echo {path} {seed} {} {} {:.2} {} {} {:.2} {:.2} {}",
                scan.stamp_ns / 1_000_000,
                reading.mount.yaw_rad.to_degrees().round(),
                reading.range_m,
                truth.label,
                truth.walker,
                grounds.walker,
                grounds.still,
                u32::from(verdict.withholds(index))
            );
        }
    }
}
