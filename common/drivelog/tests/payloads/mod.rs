//! Payloads of all kinds, valid ones where validity is checked by a log.
#![allow(dead_code, reason = "each test file uses its part")]

use messages::{
    Blob, CameraMotion, Counter, DeploymentStatus, FilterVerdict, Heartbeat, InputCounters, LogLine, MapSummary, MapTile, Mover, Pose,
    ProcessStatus, Progress, SonarMotion, SonarReading, SonarScan, Surface, TILE_CELLS, Text, TrackedWalker, TrueReading, TruthScan,
    TruthSurfaces, UpdateRegion, Walkers, WayChunk,
};
use proptest::collection::vec;
use proptest::prelude::*;
use stillmap_drivelog::Preamble;

/// A preamble of a run.
pub(crate) fn preamble(run: u64) -> Preamble {
    Preamble {
        run,
        robot: "pioneer-1".to_owned(),
        sonars: [90.0_f64, 15.0, -15.0].map(|deg| Pose { x_m: 0.1, y_m: 1.0 / 3.0, yaw_rad: deg.to_radians() }).to_vec(),
        origin: "recorded by a test".to_owned(),
        settings: "name = \"test\"\npace = \"lockstep\"\n".to_owned(),
    }
}

/// Payloads of a type.
pub(crate) trait Arbitrary: Sized {
    fn any() -> BoxedStrategy<Self>;
}

/// Any number that is one, subnormal and negative zero among them.
fn number() -> impl Strategy<Value = f64> {
    prop::num::f64::ANY.prop_filter("finite", |value| value.is_finite())
}

fn number32() -> impl Strategy<Value = f32> {
    prop::num::f32::ANY.prop_filter("finite", |value| value.is_finite())
}

fn text<const N: usize>() -> impl Strategy<Value = Text<N>> {
    "[^\0]{0,40}".prop_map(|text| Text::new(&text))
}

/// Fills an array from its start; the count beside it is the length of the list.
fn fill<T: Copy>(array: &mut [T], list: &[T]) -> u32 {
    array[..list.len()].copy_from_slice(list);
    list.len() as u32
}

macro_rules! arbitrary {
    ($($payload:ident { $($field:ident: $strategy:expr),* $(; $list:ident[$count:ident]: $item:expr, $most:expr)* })*) => { $(
        impl Arbitrary for $payload {
            fn any() -> BoxedStrategy<Self> {
                (($($strategy,)*), (Just(()), $(vec($item, 0..=$most),)*)).prop_map(|(($($field,)*), ((), $($list,)*))| {
                    #[allow(clippy::needless_update, reason = "not every payload is given whole")]
                    #[allow(unused_mut, reason = "not every payload has a list")]
                    let mut payload = $payload { $($field,)* ..Self::default() };
                    $(payload.$count = fill(&mut payload.$list, &$list);)*
                    payload
                }).boxed()
            }
        }
    )* };
}

arbitrary! {
    LogLine { process: text(), message: text(), level: 1..=4u32 }
    Pose { x_m: -1e6..=1e6, y_m: -1e6..=1e6, yaw_rad: number() }
    Mover {
        robot_x_m: number(), robot_y_m: number(), map_x_m: number(), map_y_m: number(), velocity_x_m_s: number(),
        velocity_y_m_s: number(), cells: any::<u32>(), readings: any::<u32>(), track: any::<u64>()
    }
    SonarMotion { truncated: 0..=1u32; movers[count]: Mover::any(), 16 }
    Blob {
        u_px: number32(), v_px: number32(), size_px: any::<u32>(), left_px: any::<u32>(), top_px: any::<u32>(),
        right_px: any::<u32>(), bottom_px: any::<u32>()
    }
    CameraMotion {
        transform: prop::array::uniform9(number()), residual_px: number(), inliers: number(), status: 0..=3u32,
        width: any::<u32>(), height: any::<u32>(); blobs[count]: Blob::any(), 16
    }
    UpdateRegion { x_m: number(), y_m: number(), cells: number() }
    FilterVerdict { withheld: any::<u32>(), inputs: 0..=3u32, action: 0..=1u32; regions[count]: UpdateRegion::any(), 8 }
    TrackedWalker { x_m: number(), y_m: number(), velocity_x_m_s: number(), velocity_y_m_s: number(), track: any::<u64>() }
    WayChunk { first: any::<u64>(), total: any::<u64>(); points_m[count]: prop::array::uniform2(number32()), 256 }
    MapSummary {
        sha256: prop::array::uniform32(any::<u8>()), scans: any::<u64>(), readings: any::<u64>(), withheld: any::<u64>(),
        undecided: any::<u64>(), tiles: any::<u64>(), way_m: number()
    }
    InputCounters {
        service: text(), received: any::<u64>(), lost: any::<u64>(), repeated: any::<u64>(), refused: any::<u64>(),
        last_seq: any::<u64>(), latency_median_us: any::<u32>(), latency_p99_us: any::<u32>()
    }
    Counter { name: text(), value: any::<u64>() }
    Heartbeat {
        process: text(), note: text(), progress: any::<u64>(), sent: any::<u64>(), pid: any::<u32>(), phase: 0..=2u32; inputs[inputs_count]: InputCounters::any(), 8; counters[counters_count]: Counter::any(), 16
    }
    Progress { process: text(), service: text(), answered: any::<u64>() }
    TrueReading { range_m: number(), sonar: any::<u32>(), label: 0..=4u32, walker: any::<u32>() }
    TruthScan {
        pose: Pose::any(), odometry: Pose::any(); readings[count]: TrueReading::any(), 16; walkers_m[walkers_count]: prop::array::uniform2(number()), 16
    }
    Surface { from_m: prop::array::uniform2(number()), to_m: prop::array::uniform2(number()) }
    TruthSurfaces { start: Pose::any(), first: any::<u32>(), total: any::<u32>(); surfaces[count]: Surface::any(), 64 }
}

impl Arbitrary for Walkers {
    fn any() -> BoxedStrategy<Self> {
        let walkers = vec(TrackedWalker::any(), 0..=16);
        walkers
            .prop_map(|list| {
                let mut payload = Self::default();
                payload.count = fill(&mut payload.walkers, &list);
                payload
            })
            .boxed()
    }
}

impl Arbitrary for SonarScan {
    fn any() -> BoxedStrategy<Self> {
        let mount = (-10.0..=10.0, -10.0..=10.0, -10.0..=10.0).prop_map(|(x_m, y_m, yaw_rad)| Pose { x_m, y_m, yaw_rad });
        let reading = (mount, 0.0..=10.0, 0..=255u32, 0..=1u32).prop_map(|(mount, range_m, sonar, echo)| SonarReading {
            mount,
            range_m,
            sonar,
            echo,
        });
        (Pose::any(), vec(reading, 0..=16), any::<bool>())
            .prop_map(|(pose, readings, after_gap)| Self::new(pose, &readings, after_gap))
            .boxed()
    }
}

impl Arbitrary for MapTile {
    fn any() -> BoxedStrategy<Self> {
        let place = (-100_000..100_000, -100_000..100_000, 0..=1u32, any::<u32>(), any::<u64>());
        (place, 0.005..=1.0, vec(-100f32..=100.0, TILE_CELLS))
            .prop_map(|((column, row, layer, tiles_in_layer, scan_seq), cell_m, cells)| {
                let mut tile = Self { cell_m, scan_seq, column, row, layer, tiles_in_layer, ..Self::default() };
                tile.log_odds.copy_from_slice(&cells);
                tile
            })
            .boxed()
    }
}

impl Arbitrary for DeploymentStatus {
    fn any() -> BoxedStrategy<Self> {
        let numbers = (any::<[u64; 6]>(), number(), number(), number(), any::<u32>(), 0..=6u32, any::<u32>());
        let process = (text(), text(), numbers, vec(Counter::any(), 0..=16)).prop_map(|(process, note, numbers, list)| {
            let (counts, received_per_s, sent_per_s, cpu, pid, state, restarts) = numbers;
            let [heartbeat_age_ms, received, lost, refused, sent, resident_bytes] = counts;
            let mut status = ProcessStatus {
                process,
                note,
                heartbeat_age_ms,
                received,
                lost,
                refused,
                sent,
                received_per_s,
                sent_per_s,
                cpu,
                resident_bytes,
                pid,
                state,
                restarts,
                ..ProcessStatus::default()
            };
            status.counters_count = fill(&mut status.counters, &list);
            status
        });
        (text(), any::<u64>(), 0..=1u32, vec(process, 0..=24))
            .prop_map(|(deployment, uptime_ms, ending, list)| {
                let mut status = Self { deployment, uptime_ms, ending, ..Self::default() };
                status.count = fill(&mut status.processes, &list);
                status
            })
            .boxed()
    }
}
