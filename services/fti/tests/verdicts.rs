//! A robot stands before a wall, a walker passes: the service from outside.

#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use std::collections::BTreeMap;

use messages::{
    AFTER_DOUBT, AFTER_LOSS, Blob, CameraMotion, CameraStatus, FilterVerdict, Payload, Pose, SonarMotion, SonarReading, SonarScan,
    StreamCursor,
};
use proptest::prelude::*;
use state::DecodeError;
use stillmap_fti::{Camera, Fti, Input, Parameters, Patience, StateError, Verdict};

const WALL_M: f64 = 2.5;
const WALKER_X_M: f64 = 1.5;
/// A scan every 100 ms, a frame every 50 ms.
const SCANS: u64 = 120;

/// How far aside the walker is, who enters on the right after 4 s and walks to the left at 0.8 m/s.
fn walker_y_m(time_s: f64) -> f64 {
    -1.6 + 0.8 * (time_s - 4.0)
}

fn before_sonar(time_s: f64) -> bool {
    walker_y_m(time_s).abs() < 0.3
}

fn scan(time_s: f64) -> SonarScan {
    scan_of(if before_sonar(time_s) { WALKER_X_M - 0.12 } else { WALL_M })
}

fn scan_of(range_m: f64) -> SonarScan {
    SonarScan::new(Pose::default(), &[SonarReading { range_m, echo: 1, ..SonarReading::default() }], false)
}

fn frame(time_s: f64) -> CameraMotion {
    frame_of(WALKER_X_M, walker_y_m(time_s))
}

fn frame_of(x_m: f64, y_m: f64) -> CameraMotion {
    let mut motion = CameraMotion { width: 160, height: 120, status: CameraStatus::Compensated as u32, ..CameraMotion::default() };
    let focal_px = 80.0 / (Camera::default().field_of_view_rad / 2.0).tan();
    let u_px = 80.0 - focal_px * y_m / x_m;
    let half_px = focal_px * 0.22 / x_m;
    if u_px - half_px > 0.0 && u_px + half_px < 160.0 {
        let bottom_px = (60.0 + focal_px * 0.3 / (x_m - 0.12)) as u32;
        motion.blobs[0] = Blob {
            u_px: u_px as f32,
            v_px: 40.0,
            size_px: 2000,
            left_px: (u_px - half_px) as u32,
            right_px: (u_px + half_px) as u32,
            top_px: 0,
            bottom_px,
            reserved: 0,
        };
        motion.count = 1;
    }
    motion
}

fn feed(fti: &mut Fti, scans: std::ops::RangeInclusive<u64>, with_camera: bool) -> Vec<Verdict> {
    let mut verdicts = Vec::new();
    for seq in scans {
        let stamp_ns = seq * 100_000_000;
        for frame_ns in [stamp_ns - 50_000_000, stamp_ns].into_iter().filter(|_| with_camera) {
            verdicts.extend(fti.step(Input::Camera { stamp_ns: frame_ns, motion: &frame(frame_ns as f64 * 1e-9) }));
        }
        verdicts.extend(fti.step(Input::Scan { seq, stamp_ns, scan: &scan(stamp_ns as f64 * 1e-9) }));
        verdicts.extend(fti.step(Input::Sonar { seq, motion: &SonarMotion::default() }));
    }
    verdicts
}

fn finish(fti: &mut Fti) -> Vec<Verdict> {
    let mut verdicts = fti.step(Input::CameraEnded);
    verdicts.extend(fti.step(Input::ScansEnded));
    verdicts
}

#[test]
fn the_walkers_echoes_are_withheld_and_the_walls_are_not() {
    let mut fti = Fti::new(Parameters::default()).unwrap();
    let mut verdicts = feed(&mut fti, 1..=SCANS, true);
    assert_eq!(verdicts.last().unwrap().seq, SCANS - 30, "three seconds are pending");
    verdicts.extend(finish(&mut fti));
    assert_eq!(verdicts.iter().map(|v| v.seq).collect::<Vec<_>>(), (1..=SCANS).collect::<Vec<_>>());
    for verdict in &verdicts {
        let expected = before_sonar(verdict.stamp_ns as f64 * 1e-9);
        assert_eq!(verdict.verdict.withholds(0), expected, "{verdict:?}");
        assert_eq!(verdict.verdict.inputs, FilterVerdict::FROM_SONAR | FilterVerdict::FROM_CAMERA);
    }
}

#[test]
fn without_a_camera_verdicts_come_and_say_so() {
    let mut fti = Fti::new(Parameters { camera: None, ..Parameters::default() }).unwrap();
    let mut verdicts = feed(&mut fti, 1..=SCANS, false);
    verdicts.extend(finish(&mut fti));
    assert_eq!(verdicts.len() as u64, SCANS);
    assert!(verdicts.iter().all(|verdict| verdict.verdict.inputs == FilterVerdict::FROM_SONAR));
    for verdict in &verdicts {
        let expected = before_sonar(verdict.stamp_ns as f64 * 1e-9);
        assert_eq!(verdict.verdict.withholds(0), expected, "who is gone within a second was no wall: {verdict:?}");
    }
}

/// Verdicts on a round wall, at which a turning robot looks. From scan 61 on, in which `after_gap` stands, it is nearer.
fn verdicts_on_a_shifted_wall(fti: &mut Fti, first: u64, after_gap: u32) -> Vec<Verdict> {
    let (mut verdicts, mut tiles) = (Vec::new(), Vec::new());
    for seq in first..=SCANS {
        let mut scan = scan_of(if seq <= 60 { WALL_M } else { 1.5 });
        scan.pose = Pose { x_m: if seq <= 5 { -5.0 } else { 0.0 }, yaw_rad: 0.1 * (seq % 7) as f64, ..Pose::default() };
        scan.after_gap = if seq == 61 { after_gap } else { 0 };
        verdicts.extend(fti.step(Input::Scan { seq, stamp_ns: seq * 100_000_000, scan: &scan }));
        verdicts.extend(fti.step(Input::Sonar { seq, motion: &SonarMotion::default() }));
        if seq == 61 && after_gap == AFTER_DOUBT && first == 1 {
            assert_eq!(verdicts.iter().map(|verdict| verdict.seq).collect::<Vec<_>>(), (1..=60).collect::<Vec<_>>());
            let unsaved = fti.take_unsaved();
            assert!(tiles.len() > 1 && tiles.iter().all(|tile| unsaved.contains(tile)), "no tile of a checkpoint is older");
        }
        tiles = fti.saved_tiles();
    }
    verdicts.extend(finish(fti));
    verdicts.retain(|verdict| verdict.seq > 60);
    verdicts
}

#[test]
fn after_a_doubtful_pose_the_old_places_judge_no_reading() {
    let fti = || Fti::new(Parameters { camera: None, ..Parameters::default() }).unwrap();
    let of_new = verdicts_on_a_shifted_wall(&mut fti(), 61, 0);
    assert_eq!(of_new.len(), 60);
    assert!(verdicts_on_a_shifted_wall(&mut fti(), 1, AFTER_DOUBT) == of_new);
    assert!(verdicts_on_a_shifted_wall(&mut fti(), 1, AFTER_LOSS) != of_new, "the wall was free floor before");
}

#[test]
fn who_stops_while_another_takes_over_his_blob_is_not_forgotten() {
    // The walker rests before the sonar after 6.2 s, where nothing is known yet; another walks on instead, so that the
    // camera sees one who walks through.
    let x_m = 2.5;
    let (rests_s, leaves_s) = (6.2, 10.0);
    let blob_y_m = |time_s: f64| 0.5 * (time_s - rests_s);
    let stands = |time_s: f64| time_s < leaves_s && blob_y_m(time_s.min(rests_s)).abs() < 0.3;
    let mut fti = Fti::new(Parameters::default()).unwrap();
    let mut verdicts = Vec::new();
    for seq in 1..=SCANS {
        let time_s = seq as f64 * 0.1;
        verdicts.extend(fti.step(Input::Camera { stamp_ns: seq * 100_000_000, motion: &frame_of(x_m, blob_y_m(time_s)) }));
        verdicts.extend(fti.step(Input::Scan {
            seq,
            stamp_ns: seq * 100_000_000,
            scan: &scan_of(if stands(time_s) { x_m - 0.12 } else { 2.95 }),
        }));
        verdicts.extend(fti.step(Input::Sonar { seq, motion: &SonarMotion::default() }));
    }
    verdicts.extend(finish(&mut fti));
    for verdict in &verdicts {
        assert_eq!(verdict.verdict.withholds(0), stands(verdict.stamp_ns as f64 * 1e-9), "{verdict:?}");
    }
}

#[test]
fn live_a_dead_camera_is_waited_for_no_longer_than_the_patience() {
    let mut fti = Fti::new(Parameters { patience: Patience::Seconds(0.5), ..Parameters::default() }).unwrap();
    let verdicts = feed(&mut fti, 1..=60, false);
    assert_eq!(verdicts.last().unwrap().seq, 60 - 30 - 6);
    assert!(verdicts.iter().all(|verdict| verdict.verdict.inputs == FilterVerdict::FROM_SONAR));
}

#[test]
fn after_a_restart_scans_wait_for_what_was_sent_before() {
    let mut fti = Fti::new(Parameters { patience: Patience::Seconds(0.5), camera: None, ..Parameters::default() }).unwrap();
    fti.be_patient(true);
    for seq in 1..=60 {
        assert!(fti.step(Input::Scan { seq, stamp_ns: seq * 100_000_000, scan: &scan_of(3.0) }).is_empty(), "scan {seq}");
    }
    let mut verdicts = Vec::new();
    for seq in 1..=60 {
        verdicts.extend(fti.step(Input::Sonar { seq, motion: &SonarMotion::default() }));
    }
    assert_eq!(verdicts.len(), 30, "all that a horizon of 3 s lets be decided");
    assert!(verdicts.iter().all(|verdict| verdict.verdict.inputs == FilterVerdict::FROM_SONAR));
    fti.step(Input::Scan { seq: 61, stamp_ns: 6_100_000_000, scan: &scan_of(3.0) });
    fti.step(Input::Scan { seq: 62, stamp_ns: 6_700_000_000, scan: &scan_of(3.0) });
    assert_eq!(fti.last_scan().map(|scan| scan.seq), Some(60));
    fti.be_patient(false);
    fti.step(Input::SonarPassed { seq: 60 });
    assert_eq!(fti.last_scan().map(|scan| scan.seq), Some(61), "more than the patience before the newest");
}

#[test]
fn the_last_scan_is_known_before_and_after_its_verdict() {
    for horizon_s in [0.0, 0.35, 3.0] {
        let parameters = Parameters { camera: None, horizon_s, ..Parameters::default() };
        let mut fti = Fti::new(parameters.clone()).unwrap();
        assert_eq!(fti.last_scan(), None);
        for seq in 1..=SCANS {
            drop(feed(&mut fti, seq..=seq, false));
            assert_eq!(fti.last_scan(), Some(StreamCursor { seq, stamp_ns: seq * 100_000_000 }), "a horizon of {horizon_s} s");
        }
        drop(finish(&mut fti));
        let restored = restore(parameters, &save(&fti)).unwrap();
        assert_eq!(
            (fti.last_scan(), restored.last_scan()),
            (Some(StreamCursor { seq: SCANS, stamp_ns: SCANS * 100_000_000 }), fti.last_scan())
        );
    }
}

#[test]
fn the_order_of_arrival_decides_nothing() {
    let mut fti = Fti::new(Parameters::default()).unwrap();
    let mut in_order = feed(&mut fti, 1..=SCANS, true);
    in_order.extend(finish(&mut fti));
    let mut fti = Fti::new(Parameters::default()).unwrap();
    let mut late = Vec::new();
    for seq in 1..=SCANS {
        late.extend(fti.step(Input::Sonar { seq, motion: &SonarMotion::default() }));
        late.extend(fti.step(Input::Scan { seq, stamp_ns: seq * 100_000_000, scan: &scan(seq as f64 * 0.1) }));
    }
    for half in 1..=2 * SCANS {
        let stamp_ns = half * 50_000_000;
        late.extend(fti.step(Input::Camera { stamp_ns, motion: &frame(stamp_ns as f64 * 1e-9) }));
    }
    late.extend(finish(&mut fti));
    assert_eq!(late, in_order);
}

/// Head and tiles of a state.
type State = (Vec<u8>, BTreeMap<[i32; 3], Vec<u8>>);

fn save(fti: &Fti) -> State {
    let mut state = (fti.save_head(Vec::new()), BTreeMap::new());
    save_tiles(fti, fti.saved_tiles(), &mut state);
    state
}

fn save_tiles(fti: &Fti, keys: Vec<[i32; 3]>, state: &mut State) {
    for key in keys {
        let mut tile = Vec::new();
        fti.save_tile(key, &mut tile);
        state.1.insert(key, tile);
    }
}

fn restore(parameters: Parameters, state: &State) -> Result<Fti, StateError> {
    Fti::restore(parameters, &state.0, state.1.iter().map(|(key, tile)| (*key, tile.as_slice())))
}

#[test]
fn what_changed_from_time_to_time_is_all_there_is() {
    let mut fti = Fti::new(Parameters::default()).unwrap();
    let mut kept = State::default();
    for from in (1..=SCANS).step_by(7) {
        feed(&mut fti, from..=(from + 6).min(SCANS), true);
        kept.0 = fti.save_head(Vec::new());
        let changed = fti.take_unsaved();
        save_tiles(&fti, changed, &mut kept);
        assert_eq!(kept, save(&fti), "from scan {from}");
    }
    assert!(kept.1.len() > 1);
}

#[test]
fn a_restored_state_gives_the_same_verdicts() {
    for cut in [0, 1, 45, 62, 100] {
        let mut whole = Fti::new(Parameters::default()).unwrap();
        feed(&mut whole, 1..=cut, true);
        let mut restored = restore(Parameters::default(), &save(&whole)).unwrap();
        assert_eq!(save(&restored), save(&whole));
        assert_eq!(feed(&mut restored, cut + 1..=SCANS, true), feed(&mut whole, cut + 1..=SCANS, true));
        assert_eq!(finish(&mut restored), finish(&mut whole));
    }
}

#[test]
fn the_state_does_not_grow_with_time() {
    let mut fti = Fti::new(Parameters::default()).unwrap();
    let mut lap = |seqs: std::ops::RangeInclusive<u64>| {
        let first = *seqs.start();
        for seq in seqs {
            // The walker comes again every twelve seconds.
            let (stamp_ns, time_s) = (seq * 100_000_000, (seq - first) as f64 % 120.0 * 0.1);
            drop(fti.step(Input::Camera { stamp_ns, motion: &frame(time_s) }));
            drop(fti.step(Input::Scan { seq, stamp_ns, scan: &scan(time_s) }));
            drop(fti.step(Input::Sonar { seq, motion: &SonarMotion::default() }));
        }
        let (head, tiles) = save(&fti);
        head.len() + tiles.values().map(Vec::len).sum::<usize>()
    };
    let (warm, later) = (lap(1..=600), lap(601..=18_000));
    assert!(later < warm + 1000, "half an hour makes {warm} bytes {later}");
}

#[test]
fn another_version_and_cut_bytes_are_refused() {
    let error = |head: &[u8], tiles: &[([i32; 3], &[u8])]| Fti::restore(Parameters::default(), head, tiles.to_vec()).unwrap_err();
    assert!(matches!(error(&[77; 8], &[]), StateError::Bytes(DecodeError::Version { .. })));
    let mut fti = Fti::new(Parameters::default()).unwrap();
    feed(&mut fti, 1..=40, true);
    let (head, tiles) = save(&fti);
    assert!(matches!(error(&head[..head.len() / 2], &[]), StateError::Bytes(DecodeError::Damaged(_))));
    let (key, tile) = tiles.first_key_value().unwrap();
    assert!(matches!(error(&head, &[(*key, &tile[..9])]), StateError::Bytes(DecodeError::Damaged(_))));
    assert_eq!(error(&head, &[(*key, &[0])]), StateError::Tile { key: *key, found: 0 });
    for nowhere in [[1, 0, 0], [0, i32::MAX, 0]] {
        assert_eq!(error(&head, &[(nowhere, tile)]), StateError::Tile { key: nowhere, found: 1024 });
    }
}

#[test]
fn parameters_out_of_range_are_refused() {
    let error = Fti::new(Parameters { horizon_s: f64::NAN, ..Parameters::default() }).unwrap_err();
    assert_eq!(error.to_string(), "horizon_s is NaN, expected 0 to 10 s");
}

proptest! {
    #[test]
    fn any_bytes_are_answered_with_valid_verdicts(bytes in proptest::collection::vec(any::<u8>(), 2000), stamps in proptest::collection::vec(any::<u64>(), 6)) {
        let mut fti = Fti::new(Parameters { patience: Patience::Seconds(0.0), ..Parameters::default() }).unwrap();
        let mut verdicts = feed(&mut fti, 1..=20, true);
        for (seq, stamp_ns) in (100..).zip(stamps) {
            let (scan, rest) = bytes.split_at(size_of::<SonarScan>());
            let scan: SonarScan = bytemuck::pod_read_unaligned(scan);
            let mut motion: SonarMotion = bytemuck::pod_read_unaligned(&padded(rest, size_of::<SonarMotion>()));
            let mut camera: CameraMotion = bytemuck::pod_read_unaligned(&padded(rest, size_of::<CameraMotion>()));
            (motion.count, camera.count) = (16, 16);
            verdicts.extend(fti.step(Input::Camera { stamp_ns, motion: &camera }));
            verdicts.extend(fti.step(Input::Scan { seq, stamp_ns, scan: &scan }));
            verdicts.extend(fti.step(Input::Sonar { seq, motion: &motion }));
        }
        verdicts.extend(finish(&mut fti));
        for verdict in verdicts {
            prop_assert_eq!(verdict.verdict.validate(), Ok(()));
        }
    }

    #[test]
    fn garbage_is_refused_or_read_but_never_breaks(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        let mut versioned = vec![5];
        versioned.extend(&bytes);
        if let Ok(mut fti) = Fti::restore(Parameters::default(), &versioned, []) {
            feed(&mut fti, 1..=40, true);
        }
    }
}

fn padded(bytes: &[u8], size: usize) -> Vec<u8> {
    bytes.iter().copied().cycle().take(size).collect()
}

#[test]
fn no_track_is_predicted_over_a_long_pause() {
    let (mut fti, walking) = (Fti::new(Parameters::default()).unwrap(), 55);
    feed(&mut fti, 1..=walking, true);
    assert_eq!(fti.walkers().count, 1);
    // Thirty years later a blob is there again, where a track without an end would expect the walker.
    let stamp_ns = 1_000_000_000_000_000_000;
    fti.step(Input::Camera { stamp_ns, motion: &frame(5.5) });
    fti.step(Input::Scan { seq: walking + 1, stamp_ns, scan: &scan(5.5) });
    fti.step(Input::Sonar { seq: walking + 1, motion: &SonarMotion::default() });
    assert_eq!(fti.last_scan(), Some(StreamCursor { seq: walking + 1, stamp_ns }));
    assert_eq!(fti.walkers().count, 0);
}
