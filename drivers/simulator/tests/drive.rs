//! Whole drives: rhythm, order of firing, truth, and that nothing depends on anything but world, robot and seed.
#![expect(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking")]

use messages::{EchoLabel, Payload, TruthScan};
use proptest::prelude::*;
use psos::Model;
use stillmap_simulator::camera::{Camera, Flaws, LABEL_EDGE, LABEL_WALKER, Picture};
use stillmap_simulator::{Body, Optics, PACKET_INTERVAL_NS, Packet, Simulation, World};

const QUIET: &str = "sonar = { noise_m = 0, noise_share = 0, crosstalk = 0, missed = 0 }\n";

fn world(toml: &str) -> World {
    world_file::parse("test", toml).unwrap_or_else(|error| panic!("{error}"))
}

fn of_file(name: &str) -> World {
    let path = format!("{}/../../config/worlds/{name}", env!("CARGO_MANIFEST_DIR"));
    world_file::read(path.as_ref()).unwrap_or_else(|error| panic!("{error}"))
}

fn pioneer() -> Body {
    Body::of(Model::named("pioneer-1").unwrap())
}

fn drive(world: &World, seed: u64) -> Vec<(Packet, TruthScan)> {
    let mut simulation = Simulation::new(world, &pioneer(), seed);
    std::iter::from_fn(|| simulation.next_packet()).collect()
}

/// Ranges of one sonar with what they came from.
fn ranges(drive: &[(Packet, TruthScan)], sonar: u32) -> Vec<(f64, u32, u32)> {
    let readings = drive.iter().flat_map(|(_, truth)| truth.readings[..truth.count as usize].iter());
    readings.filter(|reading| reading.sonar == sonar).map(|reading| (reading.range_m, reading.label, reading.walker)).collect()
}

/// A robot that stands for some seconds at the origin and looks along x.
fn standing(seconds: u32, things: &str) -> World {
    world(&format!("robot = {{ start_m = [0, 0], way = [{{ to_m = [0, 0], stop_s = {seconds} }}] }}\n{QUIET}{things}"))
}

#[test]
fn sonars_fire_25_times_and_packets_come_10_times_a_second() {
    let drive = drive(&standing(28, ""), 1);
    assert_eq!(drive.len(), 290, "the robot stands for a second before it sets off");
    let fired: Vec<u8> = drive.iter().flat_map(|(packet, _)| packet.readings.iter().map(|reading| reading.sonar)).collect();
    assert_eq!(fired.len(), 725, "25 a second");
    assert!(fired.iter().enumerate().all(|(ping, sonar)| ping % 7 == usize::from(*sonar)));
    for (packet, truth) in &drive {
        assert_eq!(packet.readings.len(), if packet.number % 2 == 1 { 2 } else { 3 });
        assert_eq!(packet.stamp_ns, packet.number * PACKET_INTERVAL_NS);
        assert_eq!(truth.count as usize, packet.readings.len());
    }
}

#[test]
fn a_wall_two_metres_ahead_reads_two_metres_less_the_mount() {
    let drive = drive(&standing(3, "wall = [{ along_m = [[2, -3], [2, 3]] }]"), 1);
    // 1870 mm is 10784.3 units of 0.1734 mm.
    for (range_m, label, _) in ranges(&drive, 3) {
        assert_eq!(range_m, 10784.0 * 0.1734 / 1000.0);
        assert_eq!(label, EchoLabel::Still as u32);
    }
    assert!(ranges(&drive, 0).iter().all(|reading| *reading == (28835.0 * 0.1734 / 1000.0, EchoLabel::NoEcho as u32, 0)), "5 m in units");
}

#[test]
fn noise_is_as_wide_as_configured() {
    let mut noisy = standing(280, "wall = [{ along_m = [[2, -3], [2, 3]] }]");
    noisy.sonar = world("robot = { start_m = [0, 0], way = [] }\nsonar = { noise_m = 0.01, noise_share = 0.005, missed = 0 }").sonar;
    let ranges: Vec<f64> =
        ranges(&drive(&noisy, 1), 3).iter().filter(|reading| reading.1 == EchoLabel::Still as u32).map(|r| r.0).collect();
    let count = ranges.len() as f64;
    let mean = ranges.iter().sum::<f64>() / count;
    let deviation = (ranges.iter().map(|range| (range - mean).powi(2)).sum::<f64>() / count).sqrt();
    assert!((mean - 1.87).abs() < 0.003, "{mean}");
    assert!((deviation - 0.019_35).abs() < 0.002, "{deviation}: 0.01 + 0.005 × 1.87");
}

#[test]
fn missed_echoes_and_crosstalk_come_at_their_rates() {
    let wall = "robot = { start_m = [0, 0], way = [{ to_m = [0, 0], stop_s = 280 }] }\nwall = [{ along_m = [[2, -3], [2, 3]] }]\n";
    let count = |sonar: &str, label: EchoLabel| {
        let drive = drive(&world(&format!("{wall}sonar = {sonar}")), 1);
        ranges(&drive, 3).iter().filter(|reading| reading.1 == label as u32).count()
    };
    // 1004 pings of sonar 3; crosstalk is echoes when it comes before the echo, which 1.72 of 4.85 m do.
    assert!((70..130).contains(&count("{ missed = 0.1, crosstalk = 0 }", EchoLabel::NoEcho)));
    assert!((140..220).contains(&count("{ missed = 0, crosstalk = 0.5 }", EchoLabel::Crosstalk)));
    assert_eq!(count("{ missed = 0, crosstalk = 0 }", EchoLabel::Still), 1004);
}

#[test]
fn a_walker_before_the_robot_is_named_in_the_truth() {
    let walkers = "wall = [{ along_m = [[3, -3], [3, 3]] }]
        [[walker]]
        from_m = [0, -9]
        way = [{ to_m = [0, -8] }]
        [[walker]]
        from_m = [1.5, -1.5]
        start_s = 5
        speed_m_s = 0.5
        way = [{ to_m = [1.5, 0], stop_s = 4 }, { to_m = [1.5, 1.5] }]";
    let drive = drive(&standing(16, walkers), 1);
    let ahead = ranges(&drive, 3);
    let walker = EchoLabel::Walker as u32;
    assert!(ahead.iter().all(|reading| (reading.1 == walker) == (reading.2 == 2)), "the second walker");
    assert!(ahead.iter().filter(|reading| reading.1 == walker).all(|reading| (1.2..1.6).contains(&reading.0)));
    assert!(
        (12..22).contains(&ahead.iter().filter(|reading| reading.1 == walker).count()),
        "4 s of standing at 3.6 pings a second, and passing"
    );
    let (_, truth) = &drive[99];
    assert_eq!(truth.walkers_count, 2);
    assert!(truth.walkers_m[1][0] == 1.5 && truth.walkers_m[1][1].abs() < 1e-9, "{:?}", truth.walkers_m[1]);
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_seed_does_not() {
    let world = of_file("corridor.toml");
    let bytes = |seed| {
        let drive = drive(&world, seed);
        drive.iter().flat_map(|(_, truth)| bytemuck::bytes_of(truth).to_vec()).collect::<Vec<u8>>()
    };
    assert!(bytes(1) == bytes(1));
    assert!(bytes(1) != bytes(2));
}

#[test]
fn a_resumed_drive_equals_one_that_never_stopped() {
    let mut world = of_file("corridor.toml");
    world.odometry =
        world_file::parse("test", "robot = { start_m = [0, 0], way = [] }\nodometry = { wander_deg = 1, distance_share = 0.02 }")
            .unwrap()
            .odometry;
    let entire = drive(&world, 3);
    for resumed_at in [1, 2, 250, 600] {
        let mut simulation = Simulation::new(&world, &pioneer(), 3);
        simulation.advance_to(resumed_at);
        assert_eq!(simulation.odometry(), entire[resumed_at as usize - 1].0.odometry);
        let rest: Vec<_> = std::iter::from_fn(|| simulation.next_packet()).collect();
        assert!(rest == entire[resumed_at as usize..], "taken up after {resumed_at} packets");
    }
}

#[test]
fn walls_echo_the_same_for_any_walker() {
    let still = |walkers: &str| {
        drive(
            &world(&format!(
                "robot = {{ start_m = [0, 0], way = [{{ to_m = [0, 0], stop_s = 20 }}] }}\nwall = [{{ along_m = [[3, 1], [-3, 1]] }}]\n{walkers}"
            )),
            5,
        )
    };
    let (alone, crossed) = (still(""), still("walker = [{ from_m = [2, -2], speed_m_s = 0.3, way = [{ to_m = [2, 0.5] }] }]"));
    assert_eq!(ranges(&alone, 0), ranges(&crossed, 0));
    assert_ne!(ranges(&alone, 3), ranges(&crossed, 3), "the walker was echoes");
}

#[test]
fn odometry_is_the_true_way_from_the_start() {
    let world = of_file("corridor.toml");
    for (packet, truth) in drive(&world, 1) {
        let start = messages::Pose { x_m: 0.9, y_m: 1.0, yaw_rad: 0.0 };
        let claimed = start.then(&packet.odometry);
        assert!((claimed.x_m - truth.pose.x_m).hypot(claimed.y_m - truth.pose.y_m) < 1e-9);
        assert_eq!(packet.odometry, truth.odometry);
        assert_eq!(packet.odometry == messages::Pose::default(), packet.number <= 10, "a client sees the origin before the robot sets off");
    }
}

#[test]
fn the_demo_corridors_are_driven_and_every_truth_is_valid() {
    for (name, walkers) in [("corridor.toml", [1, 2, 3].as_slice()), ("corridor-empty.toml", &[])] {
        let world = of_file(name);
        let drive = drive(&world, 1);
        assert!((800..=1000).contains(&drive.len()), "{name}: 80 to 100 s, found {} packets", drive.len());
        let mut echoes: Vec<u32> =
            (0..7).flat_map(|sonar| ranges(&drive, sonar)).filter(|r| r.1 == EchoLabel::Walker as u32).map(|r| r.2).collect();
        echoes.sort_unstable();
        echoes.dedup();
        assert_eq!(echoes, walkers, "{name}");
        for (_, truth) in &drive {
            truth.validate().unwrap();
        }
    }
}

#[test]
fn surfaces_are_told_in_chunks() {
    let many: String = (0..40).map(|row| format!("[[box]]\ncentre_m = [{row}, 30]\nsize_m = [0.5, 0.5]\n")).collect();
    let chunks =
        Simulation::new(&standing(1, &format!("pillar = [{{ centre_m = [3, 3], radius_m = 1 }}]\n{many}")), &pioneer(), 1).surfaces();
    let counts: Vec<(u32, u32, u32)> = chunks.iter().map(|chunk| (chunk.first, chunk.count, chunk.total)).collect();
    assert_eq!(counts, [(0, 64, 176), (64, 64, 176), (128, 48, 176)]);
    for chunk in &chunks {
        chunk.validate().unwrap();
    }
}

#[test]
fn a_recessed_door_echoes_behind_its_wall() {
    let mut world = of_file("corridor-empty.toml");
    world.sonar = world_sonar_without_chance();
    // Sonar 6 looks at the right wall, from 0.1 m ahead of the robot and 0.1 m to its right.
    for (_, truth) in drive(&world, 1).iter().take(240) {
        let x_m = truth.pose.x_m + 0.1;
        let beside = truth.readings[..truth.count as usize].iter().find(|reading| reading.sonar == 6);
        let Some(reading) = beside else { continue };
        let wall_y_m = truth.pose.y_m - 0.1 - reading.range_m;
        if (x_m - 2.4).abs() < 0.2 {
            assert!((wall_y_m + 0.3).abs() < 0.02, "door at x = {x_m}: {wall_y_m}");
        } else if (3.3..4.4).contains(&x_m) {
            assert!(wall_y_m.abs() < 0.02, "wall at x = {x_m}: {wall_y_m}");
        }
    }
}

fn world_sonar_without_chance() -> stillmap_simulator::world::Sonar {
    standing(1, "").sonar
}

proptest! {
    #[test]
    fn every_reading_is_within_what_a_sonar_can_say(x_m in -1.0..15.0, y_m in -2.0..4.0, heading_deg in -180.0..180.0, seed: u64) {
        let mut world = of_file("corridor-empty.toml");
        world.robot = world_file::parse("test", &format!(
            "[robot]\nstart_m = [{x_m:.3}, {y_m:.3}]\nheading_deg = {heading_deg:.1}\nway = [{{ to_m = [{x_m:.3}, {y_m:.3}], stop_s = 2 }}]"
        )).unwrap().robot;
        for (packet, truth) in drive(&world, seed) {
            truth.validate().unwrap();
            for reading in packet.readings {
                prop_assert!((0.149..=5.001).contains(&reading.range_m), "{reading:?}");
            }
        }
    }
}

/// The camera looks from where the sonars are: the robot stands before it drives, for both.
#[test]
fn camera_and_sonars_share_one_way() {
    let world = world(
        "walker = [{ from_m = [3, 0], way = [{ to_m = [3, 0], stop_s = 60 }] }]\n[robot]\nstart_m = [0, 0]\nspeed_m_s = 0.5\nway = [{ to_m = [2, 0] }]\n",
    );
    let optics = Optics::default();
    let (mut camera, mut picture) = (Camera::new(&world, &optics, &Flaws::NONE, 1), Picture::default());
    let poses: Vec<(u64, f64)> = drive(&world, 1).iter().map(|(packet, truth)| (packet.stamp_ns, truth.pose.x_m)).collect();
    let focal_px = 80.0 / (optics.field_of_view_rad / 2.0).tan();
    let mut compared = 0;
    for frame in 1..=camera.total_frames() {
        camera.take(frame, &mut picture);
        let stamp_ns = camera.stamp_ns(frame);
        let rows: Vec<&[u8]> = picture.labels.chunks(160).collect();
        let Some(last) =
            rows.iter().rposition(|row| row.iter().any(|label| [LABEL_EDGE, LABEL_WALKER].contains(label))).filter(|row| *row < 119)
        else {
            continue;
        };
        // The foot of the shin, 0.07 m before its middle, by the ground cue.
        let seen_from_m = 3.0 - 0.07 - focal_px * optics.height_m / (last as f64 + 1.0 - 60.0);
        let (_, driven_m) = poses.iter().min_by_key(|(at_ns, _)| at_ns.abs_diff(stamp_ns)).unwrap();
        // Half a row at the far end of the way, and what is driven between packet and frame.
        assert!((seen_from_m - driven_m).abs() < 0.2, "at {stamp_ns} ns: {seen_from_m} m and {driven_m} m");
        compared += 1;
    }
    assert!(compared > 30, "{compared}");
}
