//! Drives through small worlds, and the worlds that come with the program.

#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use grid::CellSize;
use simulator::Body;
use stillmap_evaluate::{Drive, Labels, Tally, Variation, judge, oracle, read_world, unfiltered};

/// A room; somebody walks to a place beside the robot's way, stands there until the end, and the robot never looks back.
const ROOM: &str = "
wall = [{ along_m = [[0, 0], [5, 0], [5, 4], [0, 4], [0, 0]] }]
walker = [{ from_m = [3.0, 3.5], speed_m_s = 1.0, way = [{ to_m = [2.6, 1.6], stop_s = 60 }] }]
[robot]
start_m = [0.8, 1.5]
way = [{ to_m = [1.4, 1.5], stop_s = 6 }]
";

fn drive(walkers: Option<usize>) -> Drive {
    let world = read_world(ROOM, Variation { walkers, seed: 1 }).unwrap();
    Drive::through(&world, &Body::of_settings(&settings::Robot::default()), 3.0, None, 1)
}

#[test]
fn true_labels_take_the_ghosts_out_and_leave_the_walls() {
    let settings = settings::Mapping::default();
    let (with, without) = (drive(None), drive(Some(0)));
    let before = judge(&with, &settings, &unfiltered(&with)).unwrap();
    let truth = judge(&with, &settings, &oracle(&with)).unwrap();
    let reference = judge(&without, &settings, &unfiltered(&without)).unwrap();
    let labels = Labels::new(&with.truth, CellSize::new(settings.cell_m.get()).unwrap());
    let tally = |map| labels.tally(map, &before, &truth, &reference);
    assert!(tally(&before).ghosts_before > 10, "{:?}", tally(&before));
    assert_eq!((tally(&before).score().ghosts_removed, tally(&truth).score().walls_lost), (0.0, 0.0));
    assert!(tally(&truth).score().ghosts_removed > 0.9, "{:?}", tally(&truth));
    assert!(tally(&truth).score().precision > tally(&before).score().precision);
    let mut verdicts = Tally::default();
    verdicts.count_verdicts(&with, &oracle(&with));
    assert!(
        verdicts.walker_echoes > 20 && verdicts.withheld_walkers == verdicts.walker_echoes && verdicts.withheld == verdicts.walker_echoes
    );
}

#[test]
fn every_world_that_comes_with_the_program_can_be_varied() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/worlds");
    let mut worlds = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let text = std::fs::read_to_string(&path).unwrap();
        let own = read_world(&text, Variation { walkers: None, seed: 0 }).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        if !own.walkers.is_empty() {
            let twelve =
                read_world(&text, Variation { walkers: Some(12), seed: 3 }).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
            assert_eq!(twelve.walkers.len(), 12);
            worlds += 1;
        }
    }
    assert!(worlds >= 5, "{worlds}");
}
