//! Drives through worlds with the default parameters and prints the measures in a line for each world and one for all, and where
//! the verdicts are wrong: the frame of an experiment with the filter.
//!
//!     cargo run --release -p stillmap-evaluate --example sweep -- config/worlds/*.toml random:1..20 --seeds 3..4 --walkers 3
//!
//! `--stand S`, `--no-camera`: as of `stillmap evaluate`. `--each`: a line for each drive.
#![allow(clippy::print_stdout, reason = "an example")]

use std::collections::BTreeMap;

use anyhow::{Context, Result, bail};
use simulator::Body;
use stillmap_evaluate::{Causes, Setup, Share, Tally, Variation, in_parallel, read_world};

struct Drive {
    world: String,
    text: String,
    variation: Variation,
}

struct Scored {
    name: String,
    tally: Tally,
    causes: Causes,
}

fn main() -> Result<()> {
    let (mut worlds, mut seeds, mut walkers, mut stand_s, mut camera, mut each) = (Vec::new(), vec![1, 2], None, None, true, false);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().with_context(|| format!("{argument}: expected a value"));
        match argument.as_str() {
            "--seeds" => seeds = range(&value()?)?,
            "--walkers" => walkers = Some(value()?.parse()?),
            "--stand" => stand_s = Some(value()?.parse()?),
            "--no-camera" => camera = false,
            "--each" => each = true,
            _ => worlds.push(argument),
        }
    }
    let mut drives = Vec::new();
    for world in worlds {
        if let Some(numbers) = world.strip_prefix("random:") {
            for seed in range(numbers)? {
                let text = world_file::random_world(seed).with_context(|| format!("random world {seed}"))?;
                drives.push(Drive { world: world.clone(), text, variation: Variation { walkers, seed, stand_s } });
            }
        } else {
            let text = std::fs::read_to_string(&world).with_context(|| world.clone())?;
            let drive =
                |seed: &u64| Drive { world: world.clone(), text: text.clone(), variation: Variation { walkers, seed: *seed, stand_s } };
            drives.extend(seeds.iter().map(drive));
        }
    }
    let setup = Setup::new(Body::of(&psos::MODELS[0]));
    let setup = if camera { setup } else { setup.without_camera() };
    let scored = in_parallel(&drives, |drive| -> Result<Scored> {
        let driven = setup.run(&read_world(&drive.text, drive.variation)?, drive.variation.seed)?;
        let name = if each { format!("{} {}", drive.world, drive.variation.seed) } else { drive.world.clone() };
        Ok(Scored { name, tally: driven.trial.tally, causes: driven.trial.causes })
    })?;
    let mut by_name: BTreeMap<&str, Vec<&Scored>> = BTreeMap::new();
    scored.iter().for_each(|drive| by_name.entry(&drive.name).or_default().push(drive));
    by_name.iter().for_each(|(name, drives)| print(name, drives));
    print("all", &scored.iter().collect::<Vec<_>>());
    let causes = scored.iter().fold(Causes::default(), |sum, drive| sum.with(&drive.causes));
    for (echoes, Share { wrong, all }) in [
        ("moving walkers ahead, kept", causes.moving_ahead),
        ("moving walkers aside, kept", causes.moving_aside),
        ("standing walkers ahead, kept", causes.standing_ahead),
        ("standing walkers aside, kept", causes.standing_aside),
        ("near walkers, withheld", causes.near_walkers),
        ("far from walkers ahead, withheld", causes.far_ahead),
        ("far from walkers aside, withheld", causes.far_aside),
    ] {
        println!("  {echoes:34} {wrong:6} of {all:7}  {:5.2} %", percent(wrong, all));
    }
    Ok(())
}

fn range(text: &str) -> Result<Vec<u64>> {
    let Some((first, last)) = text.split_once("..") else { bail!("{text}: expected FIRST..LAST") };
    Ok((first.parse()?..=last.parse()?).collect())
}

fn print(name: &str, drives: &[&Scored]) {
    let lost = |tally: &Tally| percent(tally.cells.lost, tally.cells.true_labels);
    let worst = drives.iter().map(|drive| lost(&drive.tally)).fold(0.0, f64::max);
    let tally = drives.iter().fold(Tally::default(), |sum, drive| sum.with(&drive.tally));
    let cells = tally.cells;
    println!(
        "{name:36} G {:5}->{:5} {:5.1} %  L {:5.2} % worst {worst:5.1}  net {:+6.1} %  iou {:.3} {:.3} {:.3}  blocked {:4.1}->{:4.1} %  F1 {:.3}",
        cells.caused,
        cells.caused_left,
        100.0 - percent(cells.caused_left, cells.caused),
        lost(&tally),
        percent(cells.differ_after, cells.differ_before) - 100.0,
        cells.unfiltered.iou(),
        cells.filtered.iou(),
        cells.oracle.iou(),
        percent(cells.places_blocked_before, cells.places),
        percent(cells.places_blocked, cells.places),
        tally.score().f1,
    );
}

fn percent(part: usize, total: usize) -> f64 {
    100.0 * part as f64 / total.max(1) as f64
}
