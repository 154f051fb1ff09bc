//! Drives through small worlds, and the worlds that come with the program.

#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use geometry::CellSize;
use mapping::{CommitRule, Input, Mapper};
use messages::{FilterVerdict, Layer};
use simulator::Body;
use stillmap_evaluate::{Causes, Chain, Drive, Labels, Occupancy, Scan, Variation, filter, judge, oracle, read_world, unfiltered};

/// A room. A walker walks to a place beside the robot's path and stands there until the end. The robot never looks back.
const ROOM: &str = "
wall = [{ along_m = [[0, 0], [5, 0], [5, 4], [0, 4], [0, 0]] }]
walker = [{ from_m = [3.0, 3.5], speed_m_s = 1.0, way = [{ to_m = [2.6, 1.6], stop_s = 60 }] }]
[robot]
start_m = [0.8, 1.5]
way = [{ to_m = [1.4, 1.5], stop_s = 6 }]
";

fn body() -> Body {
    Body::of(&psos::MODELS[0])
}

fn drive(walkers: Option<usize>) -> Drive {
    let world = read_world(ROOM, Variation { walkers, seed: 1, stand_s: None }).unwrap();
    Drive::through(&world, &body(), 3.0, None, 1)
}

#[test]
fn true_labels_take_the_ghosts_out_and_leave_the_walls() {
    let parameters = mapping::Parameters::default();
    let (with, without) = (drive(None), drive(Some(0)));
    let before = judge(&with, &parameters, &unfiltered(&with)).unwrap();
    let truth = judge(&with, &parameters, &oracle(&with)).unwrap();
    let reference = judge(&without, &parameters, &unfiltered(&without)).unwrap();
    let labels = Labels::new(&with.truth, CellSize::new(parameters.cell_m).unwrap());
    let tally = |map| labels.tally(map, &before, &truth, &reference);
    assert!(tally(&before).ghosts.standing.before > 10, "{:?}", tally(&before));
    let scores = [(&before, unfiltered(&with)), (&truth, oracle(&with))].map(|(map, verdicts)| {
        let mut tally = tally(map);
        tally.count_verdicts(&with, &verdicts);
        tally.score()
    });
    let [none, all] = &scores;
    assert_eq!((none.ghosts_removed, none.walls_lost, none.net, none.sa, none.da, none.aa), (0.0, 0.0, Some(0.0), 1.0, 0.0, 0.0));
    assert_eq!((all.ghosts_removed, all.walls_lost, all.net, all.sa, all.da, all.aa), (1.0, 0.0, Some(-1.0), 1.0, 1.0, 1.0));
    assert!(all.iou_empty > none.iou_empty && all.precision > none.precision && all.blocked < none.blocked, "{scores:?}");
}

#[test]
fn wrong_verdicts_are_counted_by_cause() {
    let drive = drive(None);
    let none = Causes::count(&drive, &unfiltered(&drive));
    // The walker walks to its place ahead of the robot in about 2 s of a drive of 9 s and stands there.
    assert!(none.standing_ahead.all > 3 * none.moving_ahead.all && none.moving_ahead.all > 0, "{none:?}");
    assert_eq!((none.standing_ahead.wrong, none.moving_ahead.wrong), (none.standing_ahead.all, none.moving_ahead.all));
    assert_eq!((none.far_ahead.wrong, none.far_aside.wrong, none.near_walkers.wrong), (0, 0, 0));
    let all = vec![FilterVerdict { withheld: u32::MAX, ..FilterVerdict::default() }; drive.scans.len()];
    let all = Causes::count(&drive, &all);
    assert_eq!((all.standing_ahead.wrong, all.far_aside.wrong), (0, all.far_aside.all));
    let perfect = Causes::count(&drive, &oracle(&drive));
    assert_eq!(perfect.standing_ahead.wrong + perfect.moving_ahead.wrong + perfect.far_ahead.wrong + perfect.near_walkers.wrong, 0);
}

/// A walker comes to a place before the robot, stands there for half a minute and leaves.
const STATIONARY_WALKER: &str = "
wall = [{ along_m = [[0, 0], [5, 0], [5, 4], [0, 4], [0, 0]] }]
walker = [{ from_m = [2.2, 3.6], start_s = 1, speed_m_s = 0.8, way = [{ to_m = [2.2, 2.0], stop_s = 30 }, { to_m = [2.3, 0.4] }] }]
[robot]
start_m = [1.0, 2.0]
way = [{ to_m = [1.0, 2.0], stop_s = 45 }]
";
/// The walker comes at 3 s and leaves at 33 s.
const LEAVES_NS: u64 = 33_000_000_000;

#[test]
fn a_walker_is_gone_from_the_map_five_seconds_after_leaving() {
    let world = read_world(STATIONARY_WALKER, Variation { walkers: None, seed: 1, stand_s: None }).unwrap();
    let drive = Drive::through(&world, &body(), 3.0, None, 1);
    let mut chain = Chain::default();
    (chain.fti.camera, chain.mapping.commit) = (None, CommitRule::Verdict);
    let verdicts = filter(&drive, &chain).unwrap().verdicts;
    let mut mapper = Mapper::new(&chain.mapping).unwrap();
    let mut decided = 0;
    let mut stood = 0;
    for Scan { seq, stamp_ns, scan, .. } in &drive.scans {
        mapper.step(Input::Scan { seq: *seq, stamp_ns: *stamp_ns, scan }).unwrap();
        // A verdict comes a horizon after its scan, as from FTI.
        while drive.scans[decided].stamp_ns + 3_000_000_000 <= *stamp_ns {
            mapper.step(Input::Verdict { seq: drive.scans[decided].seq, verdict: &verdicts[decided] }).unwrap();
            decided += 1;
        }
        mapper.refresh();
        let shown = Occupancy::of(&mapper, Layer::Filtered).occupied;
        // The place is 1.2 m before the start, which is the origin of the map.
        let there = shown.iter().filter(|cell| (f64::from(cell.column) * 0.05 - 1.2).hypot(f64::from(cell.row) * 0.05) < 0.3).count();
        if *stamp_ns < LEAVES_NS {
            stood = stood.max(there);
        } else if *stamp_ns > LEAVES_NS + 5_000_000_000 {
            assert_eq!(there, 0, "{:.1} s after the walker left", (*stamp_ns - LEAVES_NS) as f64 * 1e-9);
        }
    }
    assert!(stood > 5 && decided > 300, "{stood} cells, {decided} scans: the walker was in the map");
}

#[test]
fn every_world_that_comes_with_the_program_can_be_varied() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/worlds");
    let mut worlds = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let text = std::fs::read_to_string(&path).unwrap();
        let own = read_world(&text, Variation { walkers: None, seed: 0, stand_s: None })
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        if !own.walkers.is_empty() {
            let twelve = read_world(&text, Variation { walkers: Some(12), seed: 3, stand_s: None })
                .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
            assert_eq!(twelve.walkers.len(), 12);
            worlds += 1;
        }
    }
    assert!(worlds >= 5, "{worlds}");
}
