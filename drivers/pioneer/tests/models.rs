//! Robots of every type: their own factors, those of the settings, and rings of more sonars than a scan holds readings.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

mod support;

use psos::{MODELS, RawReading};
use stillmap_pioneer::{Event, Factors, Parameters, Session};
use support::{Drive, Robot, S};

#[test]
fn every_public_type_maps_at_its_own_scale() {
    for subclass in MODELS.iter().flat_map(psos::Model::names) {
        let mut drive = Drive::new(Robot { sonars: true, ..Robot { subclass, ..Robot::pioneer_1() } });
        drive.run(5 * S);
        assert!(!drive.events.iter().any(|event| matches!(event, Event::UnknownModel { .. })), "{subclass}: {:?}", drive.events);
        let way_m = 0.03 * (drive.scans.len() - 1) as f64;
        assert!((drive.pose_x_m() - way_m).abs() < 0.01, "{subclass}: {} of {way_m} m", drive.pose_x_m());
    }
}

#[test]
fn factors_of_the_settings_hold_for_any_robot() {
    let factors = Factors { distance_mm: Some(0.485), range_mm: Some(2.0), heading_units: Some(4096) };
    // A variant of a P3-DX that no list knows, which counts in units of 0.485 mm.
    let robot = Robot { subclass: "p3dx-own", unit_mm: Some(0.485), ..Robot::pioneer_1() };
    let mut drive = Drive::new(robot);
    drive.session = Session::new(Parameters { factors, ..Parameters::default() }, None);
    drive.run(5 * S);
    assert!((drive.pose_x_m() - 0.03 * (drive.scans.len() - 1) as f64).abs() < 1e-2, "{}", drive.pose_x_m());
    assert!((drive.scans.last().unwrap().scan.readings()[0].range_m - 2.0).abs() < 1e-9, "1000 units of 2 mm");
}

#[test]
fn all_readings_of_a_large_ring_are_published() {
    let mut drive = Drive::new(Robot { subclass: "peoplebot-sh", ..Robot::pioneer_1() });
    drive.robot.readings = (0..32).map(|sonar| RawReading { sonar, range: 1000 + u16::from(sonar) }).collect();
    drive.run(3 * S);
    drive.check_stream();
    let scans = &drive.scans[drive.scans.len() - 2..];
    let ranges: Vec<_> = scans
        .iter()
        .flat_map(|saved| saved.scan.readings())
        .map(|reading| (reading.sonar, (1e3 * reading.range_m).round() as u32))
        .collect();
    assert_eq!(ranges, (0..32).map(|sonar| (sonar, 1000 + sonar)).collect::<Vec<_>>());
    assert_eq!(scans[0].scan.pose, scans[1].scan.pose);
}
