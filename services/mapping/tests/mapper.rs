//! The map as a fold: what it depends on, and what it does not.

#![allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking; equal means equal to the bit")]

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, TAU};

use messages::{
    FilterAction, FilterVerdict, Layer, MapTile, OutlookScan, Payload, Pose, SonarReading, SonarScan, UpdateRegion, VerdictOutlook,
};
use proptest::prelude::*;
use state::{Packed, encode_part};
use stillmap_mapping::{CommitRule, Input, Mapper, Parameters, Refused, StateError, is_occupied};

const SECOND_NS: u64 = 1_000_000_000;

fn mapper(parameters: &Parameters) -> Mapper {
    Mapper::new(parameters).unwrap()
}

/// No verdicts are expected.
fn by_horizon() -> Mapper {
    mapper(&Parameters::default())
}

/// Both layers, in lockstep with verdicts.
fn lockstep_with_verdicts() -> Mapper {
    mapper(&Parameters { commit: CommitRule::Verdict, keep_unfiltered: true, ..Parameters::default() })
}

fn verdict(withheld: u32) -> FilterVerdict {
    FilterVerdict { withheld, ..FilterVerdict::default() }
}

fn echo_ahead(range_m: f64) -> SonarScan {
    let reading = SonarReading { range_m, echo: 1, ..SonarReading::default() };
    SonarScan::new(Pose::default(), &[reading], false)
}

/// The layers as they are shown now.
fn shown(mapper: &mut Mapper) -> Vec<MapTile> {
    mapper.refresh();
    let filtered: Vec<MapTile> = mapper.shown_tiles(Layer::Filtered).collect();
    filtered.into_iter().chain(mapper.shown_tiles(Layer::Unfiltered)).filter(|tile| tile.log_odds.iter().any(|&cell| cell != 0.0)).collect()
}

fn cells(tiles: Vec<MapTile>) -> Vec<(u32, i32, i32, Vec<u32>)> {
    tiles.into_iter().map(|t| (t.layer, t.row, t.column, t.log_odds.iter().map(|cell| cell.to_bits()).collect())).collect()
}

fn log_odds_at(mapper: &mut Mapper, layer: Layer, x_m: f64, y_m: f64) -> f32 {
    mapper.refresh();
    let (column, row) = ((x_m / 0.05).floor() as i32, (y_m / 0.05).floor() as i32);
    let tile = mapper.shown_tiles(layer).find(|tile| (tile.row, tile.column) == (row >> 5, column >> 5));
    tile.map_or(0.0, |tile| tile.log_odds[((row & 31) * 32 + (column & 31)) as usize])
}

#[test]
fn a_reading_is_shown_at_once_and_committed_past_the_horizon() {
    let mut mapper = by_horizon();
    mapper.step(Input::Scan { seq: 1, stamp_ns: SECOND_NS, scan: &echo_ahead(1.0) }).unwrap();
    assert!(log_odds_at(&mut mapper, Layer::Filtered, 1.0, 0.01) > 0.5);
    assert_eq!((mapper.pending_scans(), mapper.counts().readings), (1, 0));
    mapper.step(Input::Scan { seq: 2, stamp_ns: 4 * SECOND_NS - 1, scan: &echo_ahead(1.0) }).unwrap();
    assert_eq!(mapper.counts().readings, 0);
    mapper.step(Input::Scan { seq: 3, stamp_ns: 4 * SECOND_NS, scan: &echo_ahead(1.0) }).unwrap();
    assert_eq!((mapper.pending_scans(), mapper.counts().readings), (2, 1));
    mapper.step(Input::End).unwrap();
    assert_eq!((mapper.counts().readings, mapper.counts().undecided), (3, 0));
}

#[test]
fn a_withheld_reading_leaves_its_free_part_alone() {
    let mut mapper = lockstep_with_verdicts();
    mapper.step(Input::Scan { seq: 1, stamp_ns: 0, scan: &echo_ahead(1.0) }).unwrap();
    assert!(log_odds_at(&mut mapper, Layer::Filtered, 1.0, 0.01) > 0.5);
    mapper.step(Input::Verdict { seq: 1, verdict: &verdict(1) }).unwrap();
    assert_eq!(log_odds_at(&mut mapper, Layer::Filtered, 1.0, 0.01), 0.0);
    assert!(log_odds_at(&mut mapper, Layer::Filtered, 0.5, 0.01) < -0.4);
    assert!(log_odds_at(&mut mapper, Layer::Unfiltered, 1.0, 0.01) > 0.5);
    assert_eq!((mapper.counts().readings, mapper.counts().withheld), (1, 1));
}

#[test]
fn a_pending_reading_is_shown_with_the_expected_verdict() {
    let mut mapper = lockstep_with_verdicts();
    mapper.step(Input::Scan { seq: 1, stamp_ns: 0, scan: &echo_ahead(1.0) }).unwrap();
    let mut outlook = VerdictOutlook { count: 2, ..VerdictOutlook::default() };
    outlook.scans[0] = OutlookScan { seq: 1, withheld: 1, reserved: 0 };
    outlook.scans[1] = OutlookScan { seq: 7, withheld: 1, reserved: 0 };
    mapper.step(Input::Outlook(&outlook)).unwrap();
    assert_eq!(log_odds_at(&mut mapper, Layer::Filtered, 1.0, 0.01), 0.0);
    assert!(log_odds_at(&mut mapper, Layer::Unfiltered, 1.0, 0.01) > 0.5);
    mapper.step(Input::Verdict { seq: 1, verdict: &verdict(0) }).unwrap();
    assert!(log_odds_at(&mut mapper, Layer::Filtered, 1.0, 0.01) > 0.5);
    assert_eq!(mapper.counts().withheld, 0);
}

#[test]
fn a_verdict_that_frees_clears_its_region_and_nothing_else() {
    let mut mapper = lockstep_with_verdicts();
    let mut freeing = FilterVerdict { count: 1, action: FilterAction::Free as u32, ..FilterVerdict::default() };
    // Four cells are a disc of 5.6 cm.
    freeing.regions[0] = UpdateRegion { x_m: 1.0, y_m: 0.0, cells: 4.0 };
    for seq in 1..=2 {
        mapper.step(Input::Scan { seq, stamp_ns: seq, scan: &echo_ahead(1.0) }).unwrap();
    }
    mapper.step(Input::Verdict { seq: 1, verdict: &verdict(0) }).unwrap();
    let aside = log_odds_at(&mut mapper, Layer::Unfiltered, 0.98, 0.12);
    mapper.step(Input::Verdict { seq: 2, verdict: &freeing }).unwrap();
    assert_eq!(log_odds_at(&mut mapper, Layer::Filtered, 1.0, 0.01), -2.0);
    assert_eq!(log_odds_at(&mut mapper, Layer::Filtered, 0.98, 0.12), aside, "beside the region every reading counts");
    assert!(log_odds_at(&mut mapper, Layer::Unfiltered, 1.0, 0.01) > 0.5);
    assert_eq!(mapper.counts().withheld, 0);
    mapper.step(Input::Verdict { seq: 9, verdict: &freeing }).unwrap();
    assert_eq!(save(&restore(&save(&mapper)).unwrap()), save(&mapper));
}

#[test]
fn lonely_cells_are_published_free_when_asked_for() {
    let occupied = |lonely_below: u32| {
        let mut mapper = mapper(&Parameters { lonely_below, ..Parameters::default() });
        mapper.step(Input::Scan { seq: 1, stamp_ns: 0, scan: &echo_ahead(1.0) }).unwrap();
        shown(&mut mapper).iter().flat_map(|tile| tile.log_odds).filter(|cell| is_occupied(*cell)).count()
    };
    let (all, joined, inner) = (occupied(0), occupied(1), occupied(8));
    assert!(all > 4 && joined == all && inner == 0, "{all} {joined} {inner}");
}

#[test]
fn at_sensor_pace_a_missing_verdict_means_keep_and_is_counted() {
    let deadline = CommitRule::VerdictOrDeadline { deadline_ns: 4 * SECOND_NS };
    let mut mapper = mapper(&Parameters { commit: deadline, ..Parameters::default() });
    mapper.step(Input::Scan { seq: 1, stamp_ns: 0, scan: &echo_ahead(1.0) }).unwrap();
    mapper.step(Input::Scan { seq: 2, stamp_ns: 3 * SECOND_NS, scan: &echo_ahead(1.0) }).unwrap();
    assert_eq!(mapper.counts().undecided, 0);
    mapper.step(Input::Scan { seq: 3, stamp_ns: 4 * SECOND_NS, scan: &echo_ahead(1.0) }).unwrap();
    assert_eq!((mapper.counts().readings, mapper.counts().undecided), (1, 1));
    let late = mapper.step(Input::Verdict { seq: 1, verdict: &verdict(1) });
    assert_eq!(late, Err(Refused::LateVerdict { seq: 1, decided: 1 }));
    assert!(log_odds_at(&mut mapper, Layer::Filtered, 1.0, 0.01) > 0.5);
}

#[test]
fn after_a_restart_scans_wait_for_verdicts_of_before() {
    let deadline = CommitRule::VerdictOrDeadline { deadline_ns: 4 * SECOND_NS };
    let mut mapper = mapper(&Parameters { commit: deadline, ..Parameters::default() });
    mapper.be_patient(true);
    for seq in 1..=10 {
        mapper.step(Input::Scan { seq, stamp_ns: seq * SECOND_NS, scan: &echo_ahead(1.0) }).unwrap();
    }
    assert_eq!(mapper.counts().scans, 0);
    for seq in 1..=4 {
        mapper.step(Input::Verdict { seq, verdict: &verdict(1) }).unwrap();
    }
    assert_eq!((mapper.counts().withheld, mapper.counts().undecided), (4, 0));
    mapper.be_patient(false);
    mapper.step(Input::Scan { seq: 11, stamp_ns: 11 * SECOND_NS, scan: &echo_ahead(1.0) }).unwrap();
    assert_eq!((mapper.counts().scans, mapper.counts().undecided), (7, 3), "scans 5 to 7 are past the deadline");
}

#[test]
fn in_lockstep_a_verdict_is_waited_for() {
    let mut mapper = lockstep_with_verdicts();
    mapper.step(Input::Scan { seq: 1, stamp_ns: 0, scan: &echo_ahead(1.0) }).unwrap();
    mapper.step(Input::Scan { seq: 2, stamp_ns: 3600 * SECOND_NS, scan: &echo_ahead(1.0) }).unwrap();
    mapper.step(Input::Verdict { seq: 2, verdict: &verdict(0) }).unwrap();
    assert_eq!((mapper.counts().scans, mapper.decided_up_to()), (0, 0));
    mapper.step(Input::Verdict { seq: 1, verdict: &verdict(0) }).unwrap();
    assert_eq!((mapper.counts().scans, mapper.decided_up_to()), (2, 2));
}

#[test]
fn a_pose_after_missing_scans_may_be_as_far_as_they_took() {
    let scan = |x_m| SonarScan::new(Pose { x_m, ..Pose::default() }, &[], false);
    for (missing, accepted) in [(0, false), (2, false), (3, true)] {
        let mut mapper = Mapper::new(&Parameters::default()).unwrap();
        mapper.step(Input::Scan { seq: 1, stamp_ns: 100_000_000, scan: &scan(0.0) }).unwrap();
        let stamp_ns = 110_000_000;
        assert_eq!(mapper.step(Input::Scan { seq: 2 + missing, stamp_ns, scan: &scan(3.4) }).is_ok(), accepted, "{missing}");
    }
}

#[test]
fn a_pose_that_no_robot_can_reach_is_refused_unless_it_lasts() {
    let at = |x_m: f64| SonarScan { pose: messages::Pose { x_m, ..messages::Pose::default() }, ..echo_ahead(1.0) };
    let mut mapper = by_horizon();
    mapper.step(Input::Scan { seq: 1, stamp_ns: 0, scan: &at(0.0) }).unwrap();
    let before = save(&mapper);
    let refused = mapper.step(Input::Scan { seq: 2, stamp_ns: 100_000_000, scan: &at(500.0) }).unwrap_err();
    assert_eq!(refused.to_string(), "scan 2 is 500.0 m away from the one before, expected at most 1.5 m in 0.10 s");
    assert_eq!(save(&mapper), before);
    mapper.step(Input::Scan { seq: 3, stamp_ns: 200_000_000, scan: &at(0.3) }).unwrap();
    for (seq, stamp_ns) in [(4, 300_000_000), (5, 1_199_000_000)] {
        mapper.step(Input::Scan { seq, stamp_ns, scan: &at(500.0) }).unwrap_err();
    }
    mapper.step(Input::Scan { seq: 6, stamp_ns: 1_200_000_000, scan: &at(500.0) }).unwrap();
    mapper.step(Input::Scan { seq: 7, stamp_ns: 1_300_000_000, scan: &at(500.1) }).unwrap();
}

#[test]
fn what_cannot_be_taken_is_refused_and_changes_nothing() {
    let mut mapper = lockstep_with_verdicts();
    mapper.step(Input::Scan { seq: 5, stamp_ns: 100, scan: &echo_ahead(1.0) }).unwrap();
    mapper.step(Input::Verdict { seq: 9, verdict: &verdict(0) }).unwrap();
    let before = save(&mapper);
    let refused = |mapper: &mut Mapper, input: Input<'_>| mapper.step(input).unwrap_err();
    let scan = &echo_ahead(1.0);
    assert_eq!(refused(&mut mapper, Input::Scan { seq: 5, stamp_ns: 200, scan }), Refused::RepeatedScan { seq: 5, last: 5 });
    let back = Refused::BackInTime { seq: 6, stamp_ns: 99, last_ns: 100 };
    assert_eq!(refused(&mut mapper, Input::Scan { seq: 6, stamp_ns: 99, scan }), back);
    let invalid = refused(&mut mapper, Input::Scan { seq: 6, stamp_ns: 100, scan: &echo_ahead(f64::NAN) });
    assert_eq!(invalid.to_string(), "message 6: readings.range_m is NaN, expected 0 to 10 m");
    assert_eq!(refused(&mut mapper, Input::Verdict { seq: 4, verdict: &verdict(0) }), Refused::LateVerdict { seq: 4, decided: 4 });
    assert_eq!(refused(&mut mapper, Input::Verdict { seq: 9, verdict: &verdict(0) }), Refused::RepeatedVerdict { seq: 9 });
    assert_eq!(save(&mapper), before);
    let mut unexpecting = by_horizon();
    assert_eq!(refused(&mut unexpecting, Input::Verdict { seq: 1, verdict: &verdict(0) }), Refused::UnexpectedVerdict { seq: 1 });
}

/// A robot drives 6 m along a wall at y = 0.8 m, a sonar looking straight at it.
#[test]
fn a_straight_wall_is_a_straight_dark_line() {
    let mut mapper = by_horizon();
    for step in 0..120_u64 {
        let pose = Pose { x_m: 0.05 * step as f64, ..Pose::default() };
        let mount = Pose { y_m: 0.1, yaw_rad: FRAC_PI_2, ..Pose::default() };
        let reading = SonarReading { mount, range_m: 0.72, sonar: 0, echo: 1 };
        mapper
            .step(Input::Scan { seq: step + 1, stamp_ns: step * SECOND_NS / 10, scan: &SonarScan::new(pose, &[reading], false) })
            .unwrap();
    }
    mapper.step(Input::End).unwrap();
    for column in 4..116 {
        let x_m = 0.05 * f64::from(column) + 0.01;
        let at = |mapper: &mut Mapper, y_m| log_odds_at(mapper, Layer::Filtered, x_m, y_m);
        assert!(at(&mut mapper, 0.82) > 1.5, "no wall at x = {x_m} m");
        assert!(at(&mut mapper, 0.62) < -0.5, "not free before the wall at x = {x_m} m");
        assert!(at(&mut mapper, 0.92) == 0.0, "known behind the wall at x = {x_m} m");
    }
    assert!((mapper.summary().way_m - 5.95).abs() < 1e-3);
}

#[test]
fn what_is_sent_makes_the_whole_map() {
    let mut mapper = by_horizon();
    let mut received: BTreeMap<(i32, i32), MapTile> = BTreeMap::new();
    let receive = |mapper: &mut Mapper, received: &mut BTreeMap<(i32, i32), MapTile>| {
        let mut message = MapTile::default();
        for key in mapper.take_unsent(Layer::Filtered, 3) {
            mapper.write_tile(Layer::Filtered, key, &mut message);
            received.insert((key.row, key.column), message);
        }
    };
    for step in 0..200_u64 {
        let pose = Pose { x_m: 0.1 * step as f64, y_m: 0.0, yaw_rad: step as f64 };
        let reading = SonarReading { range_m: 0.3 + (step % 20) as f64 * 0.1, echo: 1, ..SonarReading::default() };
        mapper.step(Input::Scan { seq: step + 1, stamp_ns: step * SECOND_NS / 5, scan: &SonarScan::new(pose, &[reading], false) }).unwrap();
        mapper.refresh();
        receive(&mut mapper, &mut received);
    }
    (0..100).for_each(|_| receive(&mut mapper, &mut received));
    let tiles = |tiles: &mut dyn Iterator<Item = MapTile>| cells(tiles.collect());
    let complete = tiles(&mut mapper.shown_tiles(Layer::Filtered));
    assert_eq!(tiles(&mut received.values().copied()), complete);
    assert_eq!(received.values().last().unwrap().tiles_in_layer as usize, complete.len());
    received.clear();
    mapper.send_again();
    (0..100).for_each(|_| receive(&mut mapper, &mut received));
    assert_eq!(tiles(&mut received.values().copied()), complete);
}

/// A drive of a few scans, with the verdict on each.
fn drive() -> impl Strategy<Value = Vec<(SonarScan, u32)>> {
    let reading = (0.0..TAU, 0.2..3.0f64, prop::bool::weighted(0.8)).prop_map(|(yaw_rad, range_m, echo)| SonarReading {
        mount: Pose { yaw_rad, ..Pose::default() },
        range_m,
        sonar: 0,
        echo: u32::from(echo),
    });
    // As far apart as a robot can be after 0.1 s.
    let pose = (-0.5..0.5f64, -0.5..0.5f64, 0.0..TAU).prop_map(|(x_m, y_m, yaw_rad)| Pose { x_m, y_m, yaw_rad });
    let scan = (pose, prop::collection::vec(reading, 0..4)).prop_map(|(pose, readings)| SonarScan::new(pose, &readings, false));
    prop::collection::vec((scan, prop_oneof![Just(0u32), 0..8u32]), 1..24)
}

/// Whether each input comes as a scan (with its own place in the order) or as a verdict, in some order that keeps that of the scans.
fn arrivals(drive: &[(SonarScan, u32)], keys: &[u32]) -> Vec<(bool, usize)> {
    let mut verdicts: Vec<(u32, bool, usize)> =
        (0..drive.len()).map(|i| (keys[i % keys.len()].wrapping_mul(i as u32 + 1) % 40, true, i)).collect();
    verdicts.extend((0..drive.len()).map(|i| (i as u32, false, i)));
    verdicts.sort_unstable();
    verdicts.into_iter().map(|(_, is_verdict, index)| (is_verdict, index)).collect()
}

fn feed(mapper: &mut Mapper, drive: &[(SonarScan, u32)], (is_verdict, index): (bool, usize)) {
    let seq = index as u64 + 1;
    let (scan, withheld) = &drive[index];
    let taken = match is_verdict {
        true => mapper.step(Input::Verdict { seq, verdict: &verdict(*withheld) }),
        false => mapper.step(Input::Scan { seq, stamp_ns: seq * SECOND_NS / 10, scan }),
    };
    taken.unwrap();
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn when_a_verdict_comes_does_not_matter(drive in drive(), keys in prop::collection::vec(any::<u32>(), 1..24)) {
        let finish = |order: Vec<(bool, usize)>| {
            let mut mapper = lockstep_with_verdicts();
            order.into_iter().for_each(|arrival| feed(&mut mapper, &drive, arrival));
            (mapper.summary(), cells(shown(&mut mapper)), save(&mapper))
        };
        let in_turn = (0..drive.len()).flat_map(|i| [(false, i), (true, i)]).collect();
        prop_assert!(finish(arrivals(&drive, &keys)) == finish(in_turn));
    }

    #[test]
    fn what_is_shown_is_what_would_be_committed_now(drive in drive(), keys in prop::collection::vec(any::<u32>(), 1..24), looks in any::<u64>()) {
        let mut mapper = lockstep_with_verdicts();
        for (count, arrival) in arrivals(&drive, &keys).into_iter().enumerate() {
            feed(&mut mapper, &drive, arrival);
            if looks & (1 << (count % 64)) != 0 {
                let mut ended = mapper.clone();
                ended.step(Input::End).unwrap();
                let mut afresh = restore(&save(&ended)).unwrap();
                prop_assert!(cells(shown(&mut mapper)) == cells(shown(&mut afresh)), "after {count} arrivals");
            }
        }
    }

    #[test]
    fn restored_anywhere_the_map_is_the_same(drive in drive(), keys in prop::collection::vec(any::<u32>(), 1..24), cut in any::<prop::sample::Index>()) {
        let arrivals = arrivals(&drive, &keys);
        let cut = cut.index(arrivals.len());
        let mut whole = lockstep_with_verdicts();
        arrivals[..cut].iter().for_each(|&arrival| feed(&mut whole, &drive, arrival));
        let mut restored = restore(&save(&whole)).unwrap();
        for mapper in [&mut whole, &mut restored] {
            arrivals[cut..].iter().for_each(|&arrival| feed(mapper, &drive, arrival));
            mapper.step(Input::End).unwrap();
        }
        prop_assert_eq!(whole.summary(), restored.summary());
        prop_assert!(save(&whole) == save(&restored));
        prop_assert!(cells(shown(&mut whole)) == cells(shown(&mut restored)));
    }

    #[test]
    fn what_changed_from_time_to_time_is_all_there_is(drive in drive(), keys in prop::collection::vec(any::<u32>(), 1..24), saves in any::<u64>()) {
        let mut mapper = lockstep_with_verdicts();
        let mut kept = save(&mapper);
        for (count, arrival) in arrivals(&drive, &keys).into_iter().enumerate() {
            feed(&mut mapper, &drive, arrival);
            if count % 3 == 0 {
                mapper.refresh();
            }
            if saves & (1 << (count % 64)) != 0 {
                kept.0 = mapper.save_head();
                let changed = mapper.take_unsaved();
                save_tiles(&mapper, changed, &mut kept);
                prop_assert!(kept == save(&mapper), "after {count} arrivals");
                prop_assert_eq!(mapper.take_unsaved(), Vec::<[i32; 3]>::new());
            }
        }
    }
}

/// Head and tiles of a state.
type State = (Vec<u8>, BTreeMap<[i32; 3], Vec<u8>>);

fn save(mapper: &Mapper) -> State {
    let mut state = (mapper.save_head(), BTreeMap::new());
    save_tiles(mapper, mapper.saved_parts(), &mut state);
    state
}

fn save_tiles(mapper: &Mapper, keys: Vec<[i32; 3]>, state: &mut State) {
    for key in keys {
        let mut tile = Vec::new();
        mapper.save_part(key, &mut tile);
        state.1.insert(key, tile);
    }
}

/// Into a mapper of both layers.
fn restore(state: &State) -> Result<Mapper, StateError> {
    restore_into(lockstep_with_verdicts(), state)
}

fn restore_into(mapper: Mapper, state: &State) -> Result<Mapper, StateError> {
    mapper.restore(&state.0, state.1.iter().map(|(key, tile)| (*key, tile.as_slice())))
}

/// A state with something in every field.
fn some_state() -> State {
    let mut mapper = lockstep_with_verdicts();
    for seq in 1..4 {
        let scan = SonarScan { pose: Pose { x_m: 0.1 * seq as f64, ..Pose::default() }, ..echo_ahead(0.4) };
        mapper.step(Input::Scan { seq, stamp_ns: seq, scan: &scan }).unwrap();
    }
    mapper.step(Input::Verdict { seq: 1, verdict: &verdict(0) }).unwrap();
    mapper.step(Input::Verdict { seq: 3, verdict: &verdict(1) }).unwrap();
    mapper.step(Input::Verdict { seq: 9, verdict: &verdict(1) }).unwrap();
    save(&mapper)
}

#[test]
fn a_cut_or_lengthened_state_is_refused() {
    let state = some_state();
    assert!(restore(&state).is_ok());
    let with_head = |head: &[u8]| restore(&(head.to_vec(), state.1.clone())).unwrap_err();
    for length in 0..state.0.len() {
        assert!(matches!(with_head(&state.0[..length]), StateError::Bytes(_)), "{length}");
    }
    let error = with_head(&[state.0.as_slice(), &[0]].concat());
    assert_eq!(error.to_string(), "1 bytes follow the state, expected none");

    let with_tile = |key: [i32; 3], tile: &[u8]| {
        let tiles = state.1.iter().map(|(key, tile)| (*key, tile.as_slice())).chain([(key, tile)]);
        lockstep_with_verdicts().restore(&state.0, tiles).unwrap_err().to_string()
    };
    let tile = |cells: &[f32]| encode_part(&Packed::from(cells), Vec::new());
    assert!(with_tile([0, 0, 0], &tile(&[0.0; 1024])[..9]).starts_with("the state cannot be decoded"));
    assert_eq!(with_tile([0, 0, 0], &tile(&[0.0; 1025])), "a tile of 1025 cells, expected 1024 cells");
    for key in [[2, 0, 0], [-1, 0, 0], [1, i32::MAX, 0]] {
        assert_eq!(
            with_tile(key, &tile(&[0.0; 1024])),
            format!("tile {} {} {}, expected a tile of a layer that is set, within reach", key[0], key[1], key[2])
        );
    }
    assert!(with_tile([1, 0, 0], &tile(&[f32::NAN; 1024])).contains("a cell of NaN"));
}

#[test]
fn a_state_with_a_flipped_bit_is_refused_or_a_state() {
    let state = some_state();
    let check = |flipped: &State, thoroughly: bool| {
        if let Ok(mut mapper) = restore(flipped) {
            // A number may have been written in more bytes than it needs.
            assert!(restore(&save(&mapper)).is_ok());
            assert!(mapper.summary().validate().is_ok());
            if thoroughly {
                mapper.refresh();
                mapper.step(Input::End).unwrap();
            }
        }
    };
    for bit in [0, 3, 7] {
        for byte in 0..state.0.len() {
            let mut flipped = state.clone();
            flipped.0[byte] ^= 1 << bit;
            check(&flipped, byte % 16 == 0);
        }
        let (key, tile) = state.1.first_key_value().unwrap();
        for byte in 0..tile.len() {
            let mut flipped = state.clone();
            flipped.1.get_mut(key).unwrap()[byte] ^= 1 << bit;
            check(&flipped, byte % 16 == 0);
        }
    }
}

#[test]
fn a_state_of_other_settings_is_refused() {
    let state = some_state();
    let error = |parameters: Parameters| restore_into(mapper(&parameters), &state).unwrap_err().to_string();
    let coarser = Parameters { cell_m: 0.1, ..Parameters::default() };
    assert_eq!(error(coarser), "0.05, expected the edge of a cell that is set");
    assert_eq!(error(Parameters::default()), "true, expected an unfiltered layer as it is set");
}
