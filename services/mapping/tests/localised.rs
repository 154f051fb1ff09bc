//! The map by estimated poses: what a revision changes, and what it does not depend on.

#![allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking; equal means equal to the bit")]

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use geometry::MapFromRobot;
use messages::{
    EstimateStatus, FilterAction, FilterVerdict, Layer, MapTile, MovedStretch, Pose, RobotEstimate, SmoothedPose, SonarReading, SonarScan,
    TrajectoryRevision, UpdateRegion,
};
use proptest::prelude::*;
use stillmap_mapping::{CommitRule, Input, Mapper, Parameters, PoseRule, Refused};

/// Scans after which a pose is smoothed in these tests.
const LAG: usize = 3;

/// A scan with its verdict, the pose by which it is integrated, and the revision that comes with its estimate.
#[derive(Debug, Clone)]
struct Moment {
    scan: SonarScan,
    verdict: FilterVerdict,
    pose: Pose,
    /// First and last scan as shares of those smoothed so far, and where the first one is from then on.
    revision: Option<(f64, f64, Pose)>,
}

fn pose() -> impl Strategy<Value = Pose> {
    (-0.5..0.5f64, -0.5..0.5f64, 0.0..TAU).prop_map(|(x_m, y_m, yaw_rad)| Pose { x_m, y_m, yaw_rad })
}

fn moments() -> impl Strategy<Value = Vec<Moment>> {
    let reading = (0.0..TAU, 0.2..3.0f64, prop::bool::weighted(0.8))
        .prop_map(|(yaw_rad, range_m, echo)| SonarReading::new(0, Pose { yaw_rad, ..Pose::default() }, range_m, echo));
    let scan = (pose(), prop::collection::vec(reading, 0..4)).prop_map(|(pose, readings)| SonarScan::new(pose, &readings, false));
    let withheld = (0..8u32).prop_map(|withheld| FilterVerdict { withheld, ..FilterVerdict::default() });
    let freed = pose().prop_map(|Pose { x_m, y_m, .. }| {
        let mut verdict = FilterVerdict { count: 1, action: FilterAction::Free as u32, ..FilterVerdict::default() };
        verdict.regions[0] = UpdateRegion { x_m, y_m, cells: 30.0 };
        verdict
    });
    let verdict = prop_oneof![3 => withheld, 1 => freed];
    let revision = prop::option::weighted(0.3, (0.0..1.0f64, 0.0..1.0f64, pose()));
    let moment = (scan, verdict, pose(), revision).prop_map(|(scan, verdict, pose, revision)| Moment { scan, verdict, pose, revision });
    prop::collection::vec(moment, 1..24)
}

/// What localisation publishes on a drive, by scan: the estimate, and the pieces after it.
#[derive(Debug, Clone)]
struct Published {
    estimates: Vec<(RobotEstimate, Vec<TrajectoryRevision>)>,
    /// The pose of each scan after the last revision.
    poses: Vec<Pose>,
}

fn published(moments: &[Moment]) -> Published {
    let mut poses: Vec<Pose> = moments.iter().map(|moment| moment.pose).collect();
    let (mut pieces, mut smoothed) = (0, 0);
    let estimates = moments.iter().enumerate().map(|(index, moment)| {
        let mut estimate = RobotEstimate { status: EstimateStatus::Tracking as u32, ..RobotEstimate::default() };
        // The last estimate smooths what is left: eight at most in these drives of 24 scans.
        let until = if index + 1 == moments.len() { moments.len().min(smoothed + 8) } else { index.saturating_sub(LAG) };
        for ((seq, pose), to) in (1..).zip(&poses).take(until).skip(smoothed).zip(&mut estimate.smoothed) {
            *to = SmoothedPose { seq, map_from_robot: *pose, is_placed: 1, reserved: 0 };
            estimate.count += 1;
        }
        smoothed = smoothed.max(until);
        let revision = moment.revision.filter(|_| smoothed > 0).map(|(from, to, now)| {
            let at = |share: f64| (share * smoothed as f64) as usize;
            let (first, last) = (at(from.min(to)), at(from.max(to)));
            let before = MapFromRobot::from_wire(&poses[first]);
            for pose in &mut poses[first..=last] {
                let relative = before.inverse().then(&MapFromRobot::from_wire(pose));
                *pose = MapFromRobot::from_wire(&now).then(&relative).to_wire();
            }
            let mut piece = TrajectoryRevision { revision: 1, is_last: 1, count: 1, ..TrajectoryRevision::default() };
            piece.moved[0] = MovedStretch { first: first as u64 + 1, last: last as u64 + 1, before: before.to_wire(), now };
            piece
        });
        pieces += u64::from(revision.is_some());
        estimate.pieces = pieces;
        (estimate, revision.into_iter().collect())
    });
    Published { estimates: estimates.collect(), poses }
}

#[derive(Debug, Clone, Copy)]
enum Arrival {
    Scan(usize),
    Verdict(usize),
    Estimate(usize),
}

/// Each scan, then its estimate; verdicts some scans later, as `keys` say.
fn arrivals(count: usize, keys: &[u32]) -> Vec<Arrival> {
    let mut verdicts: Vec<(u32, usize)> = (0..count).map(|i| (i as u32 + keys[i % keys.len()] % 9, i)).collect();
    verdicts.sort_unstable();
    let mut verdicts = verdicts.into_iter().peekable();
    let mut order = Vec::new();
    for index in 0..count {
        order.extend([Arrival::Scan(index), Arrival::Estimate(index)]);
        order.extend(std::iter::from_fn(|| verdicts.next_if(|(at, _)| *at as usize <= index)).map(|(_, index)| Arrival::Verdict(index)));
    }
    order.extend(verdicts.map(|(_, index)| Arrival::Verdict(index)));
    order
}

fn localised() -> Mapper {
    let parameters = Parameters { commit: CommitRule::Verdict, poses: PoseRule::Estimate, keep_unfiltered: true, ..Parameters::default() };
    Mapper::new(&parameters).unwrap()
}

fn feed(mapper: &mut Mapper, moments: &[Moment], published: &Published, arrival: Arrival) {
    let stamp_ns = |index: usize| index as u64 * 100_000_000;
    match arrival {
        Arrival::Scan(index) => {
            mapper.step(Input::Scan { seq: index as u64 + 1, stamp_ns: stamp_ns(index), scan: &moments[index].scan }).unwrap();
        }
        Arrival::Verdict(index) => mapper.step(Input::Verdict { seq: index as u64 + 1, verdict: &moments[index].verdict }).unwrap(),
        Arrival::Estimate(index) => {
            let (estimate, pieces) = &published.estimates[index];
            mapper.step(Input::Estimate { seq: index as u64 + 1, estimate }).unwrap();
            for piece in pieces {
                mapper.step(Input::Revision { number: mapper.revised_up_to() + 1, piece }).unwrap();
            }
        }
    }
}

/// What a map is, to the bit: its number, its trajectory, and its tiles as shown.
type Map = (messages::MapSummary, Vec<[f32; 2]>, Vec<MapTile>);

fn finished(mut mapper: Mapper) -> Map {
    mapper.step(Input::End).unwrap();
    mapper.refresh();
    let known = |tile: &MapTile| tile.log_odds.iter().any(|cell| *cell != 0.0);
    let shown = |layer| mapper.shown_tiles(layer).filter(known).map(|tile| MapTile { tiles_in_layer: 0, ..tile });
    let tiles = shown(Layer::Filtered).chain(shown(Layer::Unfiltered)).collect();
    (mapper.summary(), mapper.way_m().to_vec(), tiles)
}

fn mapped(moments: &[Moment], published: &Published, order: &[Arrival]) -> Map {
    let mut mapper = localised();
    order.iter().for_each(|arrival| feed(&mut mapper, moments, published, *arrival));
    finished(mapper)
}

/// Head and parts of a state.
type State = (Vec<u8>, BTreeMap<[i32; 3], Vec<u8>>);

fn add_parts(mapper: &Mapper, names: Vec<[i32; 3]>, state: &mut State) {
    for name in names {
        let mut bytes = Vec::new();
        mapper.save_part(name, &mut bytes);
        state.1.insert(name, bytes);
    }
}

fn save(mapper: &Mapper) -> State {
    let mut state = (mapper.save_head(), BTreeMap::new());
    add_parts(mapper, mapper.saved_parts(), &mut state);
    state
}

fn restore(state: &State) -> Mapper {
    localised().restore(&state.0, state.1.iter().map(|(name, part)| (*name, part.as_slice()))).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_revised_map_is_that_of_the_revised_poses(moments in moments(), keys in prop::collection::vec(any::<u32>(), 1..24)) {
        let given = published(&moments);
        let anew: Vec<Moment> = moments.iter().zip(&given.poses).map(|(it, pose)| Moment { pose: *pose, revision: None, ..it.clone() }).collect();
        let found = mapped(&moments, &given, &arrivals(moments.len(), &keys));
        let expected = mapped(&anew, &published(&anew), &arrivals(moments.len(), &[0]));
        prop_assert!(found == expected, "{:?} {:?}", found.0, expected.0);
    }

    #[test]
    fn by_odometry_as_estimate_the_map_is_that_of_odometry(mut moments in moments()) {
        // A region that is set free takes the way over the robot frame, which rounds.
        moments.iter_mut().for_each(|it| (it.pose, it.revision, it.verdict) = (it.scan.pose, None, FilterVerdict { withheld: it.verdict.withheld, ..FilterVerdict::default() }));
        let mut by_odometry = Mapper::new(&Parameters { commit: CommitRule::Verdict, keep_unfiltered: true, ..Parameters::default() }).unwrap();
        let order = arrivals(moments.len(), &[3]);
        let given = published(&moments);
        order.iter().filter(|arrival| !matches!(arrival, Arrival::Estimate(_))).for_each(|it| feed(&mut by_odometry, &moments, &given, *it));
        prop_assert!(mapped(&moments, &given, &order) == finished(by_odometry));
    }

    #[test]
    fn restored_anywhere_the_map_is_the_same(moments in moments(), keys in prop::collection::vec(any::<u32>(), 1..24), cut in any::<prop::sample::Index>()) {
        let (given, order) = (published(&moments), arrivals(moments.len(), &keys));
        let mut mapper = localised();
        let (before, after) = order.split_at(cut.index(order.len()));
        before.iter().for_each(|arrival| feed(&mut mapper, &moments, &given, *arrival));
        let mut restored = restore(&save(&mapper));
        prop_assert!(save(&mapper) == save(&restored));
        for arrival in after {
            feed(&mut mapper, &moments, &given, *arrival);
            feed(&mut restored, &moments, &given, *arrival);
            prop_assert!(save(&mapper) == save(&restored), "after {arrival:?}");
        }
        prop_assert!(finished(mapper) == finished(restored));
    }

    #[test]
    fn parts_saved_when_they_change_are_the_whole_state(moments in moments(), saves in any::<u64>()) {
        let (given, mut mapper) = (published(&moments), localised());
        let mut kept = save(&mapper);
        for (count, arrival) in arrivals(moments.len(), &[4]).into_iter().enumerate() {
            feed(&mut mapper, &moments, &given, arrival);
            if count % 3 == 0 {
                mapper.refresh();
            }
            if saves & (1 << (count % 64)) != 0 {
                kept.0 = mapper.save_head();
                let changed = mapper.take_unsaved();
                add_parts(&mapper, changed, &mut kept);
                prop_assert!(save(&restore(&kept)) == save(&mapper), "after {count} arrivals");
            }
        }
    }

    #[test]
    fn a_viewer_has_the_map_as_it_is(moments in moments(), keys in prop::collection::vec(any::<u32>(), 1..24), cut in any::<prop::sample::Index>()) {
        let (given, order) = (published(&moments), arrivals(moments.len(), &keys));
        let (mut mapper, mut received) = (localised(), BTreeMap::new());
        let cut = cut.index(order.len());
        for (count, arrival) in order.iter().enumerate() {
            feed(&mut mapper, &moments, &given, *arrival);
            receive(&mut mapper, &mut received);
            if count == cut {
                mapper = restore(&save(&mapper));
            }
        }
        mapper.step(Input::End).unwrap();
        receive(&mut mapper, &mut received);
        let known: Vec<_> = received.into_iter().filter(|(_, cells)| cells.iter().any(|cell| *cell != 0.0)).collect();
        let tiles = [Layer::Filtered, Layer::Unfiltered].map(|layer| mapper.shown_tiles(layer).collect::<Vec<_>>()).concat();
        let shown = tiles.into_iter().map(|tile| ((tile.layer, tile.row, tile.column), tile.log_odds.to_vec()));
        let shown: Vec<_> = shown.filter(|(_, cells)| cells.iter().any(|cell| *cell != 0.0)).collect();
        prop_assert!(known == shown);
    }
}

fn receive(mapper: &mut Mapper, received: &mut BTreeMap<(u32, i32, i32), Vec<f32>>) {
    mapper.refresh();
    for layer in [Layer::Filtered, Layer::Unfiltered] {
        for key in mapper.take_unsent(layer, 1000) {
            let mut tile = MapTile::default();
            mapper.write_tile(layer, key, &mut tile);
            received.insert((tile.layer, tile.row, tile.column), tile.log_odds.to_vec());
        }
    }
}

fn ahead(x_m: f64) -> SonarScan {
    SonarScan::new(Pose::new(x_m, 0.0, 0.0), &[SonarReading::new(0, Pose::default(), 1.0, true)], false)
}

fn smoothed(seq: u64, pose: Pose, is_placed: bool) -> RobotEstimate {
    let mut estimate = RobotEstimate { count: 1, ..RobotEstimate::default() };
    estimate.smoothed[0] = SmoothedPose { seq, map_from_robot: pose, is_placed: u32::from(is_placed), reserved: 0 };
    estimate
}

/// Scans whose verdicts are there at once.
fn with_verdicts(mapper: &mut Mapper, count: u64) {
    for seq in 1..=count {
        mapper.step(Input::Verdict { seq, verdict: &FilterVerdict::default() }).unwrap();
        mapper.step(Input::Scan { seq, stamp_ns: seq * 1_000_000_000, scan: &ahead(0.1 * seq as f64) }).unwrap();
    }
}

#[test]
fn a_scan_is_held_until_its_pose_is_there() {
    let mut mapper = localised();
    with_verdicts(&mut mapper, 3);
    assert_eq!((mapper.counts().scans, mapper.pending_scans()), (0, 3));
    mapper.step(Input::Estimate { seq: 1, estimate: &smoothed(1, Pose::default(), true) }).unwrap();
    assert_eq!((mapper.counts().scans, mapper.counts().unsmoothed), (1, 0));
    mapper.step(Input::End).unwrap();
    assert_eq!((mapper.counts().scans, mapper.counts().unsmoothed), (3, 2));
}

#[test]
fn past_the_deadline_a_scan_is_placed_by_the_last_estimate() {
    let poses = PoseRule::EstimateOrDeadline { deadline_ns: 4_000_000_000 };
    let mut mapper = Mapper::new(&Parameters { commit: CommitRule::Verdict, poses, ..Parameters::default() }).unwrap();
    with_verdicts(&mut mapper, 4);
    let estimate = RobotEstimate { map_from_odom: Pose::new(5.0, 0.0, 0.0), ..RobotEstimate::default() };
    mapper.step(Input::Estimate { seq: 4, estimate: &estimate }).unwrap();
    assert_eq!(mapper.counts().scans, 0);
    mapper.step(Input::Scan { seq: 5, stamp_ns: 5_000_000_000, scan: &ahead(0.5) }).unwrap();
    assert_eq!((mapper.counts().scans, mapper.counts().unsmoothed), (1, 1));
    mapper.step(Input::End).unwrap();
    assert_eq!(mapper.way_m().first(), Some(&[5.1, 0.0]));
}

#[test]
fn a_scan_of_a_lost_robot_is_drawn_once_a_revision_places_it() {
    let mut mapper = localised();
    with_verdicts(&mut mapper, 1);
    let estimate = RobotEstimate { status: EstimateStatus::Lost as u32, ..smoothed(1, Pose::default(), false) };
    mapper.step(Input::Estimate { seq: 1, estimate: &estimate }).unwrap();
    let tiles = |mapper: &mut Mapper| {
        mapper.refresh();
        mapper.shown_tiles(Layer::Filtered).count()
    };
    assert_eq!((mapper.counts().scans, tiles(&mut mapper)), (1, 0));
    let mut piece = TrajectoryRevision { revision: 1, count: 1, is_last: 1, ..TrajectoryRevision::default() };
    piece.moved[0] = MovedStretch { first: 1, last: 1, before: Pose::default(), now: Pose::new(7.0, 0.0, 0.0) };
    mapper.step(Input::Revision { number: 1, piece: &piece }).unwrap();
    mapper.step(Input::End).unwrap();
    assert!(tiles(&mut mapper) > 0);
    assert_eq!(mapper.way_m(), [[7.0, 0.0]]);
}

#[test]
fn the_new_map_is_shown_with_a_fixed_scan() {
    let shown_at = |verdicts_first: bool| {
        let mut mapper = localised();
        if verdicts_first {
            with_verdicts(&mut mapper, 300);
        } else {
            (1..=300).for_each(|seq| mapper.step(Input::Scan { seq, stamp_ns: seq, scan: &ahead(0.0) }).unwrap());
        }
        for seq in 1..=260 {
            mapper.step(Input::Estimate { seq, estimate: &smoothed(seq, Pose::default(), true) }).unwrap();
        }
        let mut piece = TrajectoryRevision { revision: 1, count: 1, is_last: 1, ..TrajectoryRevision::default() };
        piece.moved[0] = MovedStretch { first: 1, last: 260, before: Pose::default(), now: Pose::new(7.0, 0.0, 0.0) };
        mapper.step(Input::Revision { number: 1, piece: &piece }).unwrap();
        (261..=300).find(|seq| {
            mapper.step(Input::Estimate { seq: *seq, estimate: &RobotEstimate::default() }).unwrap();
            mapper.way_m().first() == Some(&[7.0, 0.0])
        })
    };
    // 260 poses are two slices of 128 scans and a rest.
    assert_eq!((shown_at(true), shown_at(false)), (Some(263), Some(263)));
}

#[test]
fn estimates_out_of_order_are_refused() {
    let (estimate, piece) = (RobotEstimate::default(), TrajectoryRevision::default());
    let mut mapper = localised();
    mapper.step(Input::Estimate { seq: 3, estimate: &estimate }).unwrap();
    let repeated = mapper.step(Input::Estimate { seq: 3, estimate: &estimate });
    assert_eq!(repeated, Err(Refused::RepeatedEstimate { seq: 3, last: 3 }));
    mapper.step(Input::Revision { number: 1, piece: &piece }).unwrap();
    assert_eq!(mapper.step(Input::Revision { number: 1, piece: &piece }), Err(Refused::RepeatedPiece { number: 1, last: 1 }));
    let mut by_odometry = Mapper::new(&Parameters::default()).unwrap();
    assert_eq!(by_odometry.step(Input::Estimate { seq: 1, estimate: &estimate }), Err(Refused::UnexpectedEstimate { seq: 1 }));
    let wild = RobotEstimate { map_from_odom: Pose::new(f64::NAN, 0.0, 0.0), ..estimate };
    assert!(matches!(mapper.step(Input::Estimate { seq: 4, estimate: &wild }), Err(Refused::Invalid { seq: 4, .. })));
}
