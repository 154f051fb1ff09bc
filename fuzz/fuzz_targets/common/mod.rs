//! Valid inputs, and the services that process them.
#![allow(dead_code, reason = "each target uses its part")]

use std::sync::LazyLock;

use fti::Fti;
use mapping::Mapper;
use messages::{Pose, SonarReading, SonarScan};
use settings::Settings;
use stillmap_std::Std;

/// The settings that the targets run with.
pub const DEMO: &str = include_str!("../../../config/demo.toml");

/// The same, parsed.
pub static SETTINGS: LazyLock<Settings> = LazyLock::new(|| Settings::parse("demo.toml", DEMO).unwrap());

/// Applies changes of six bytes each: kind, offset, length, value. A mostly valid input reaches deeper into a parser than random bytes.
pub fn changed(sound: &[u8], changes: &[u8]) -> Vec<u8> {
    let mut changed = sound.to_vec();
    for [kind, a, b, c, length, value] in changes.as_chunks::<6>().0 {
        let at = u32::from_le_bytes([*a, *b, *c, 0]) as usize % (changed.len() + 1);
        let end = (at + usize::from(*length)).min(changed.len());
        match kind % 6 {
            0 => changed.truncate(at),
            1 => drop(changed.drain(at..end)),
            2 => {
                let piece = changed[at..end].to_vec();
                changed.splice(at..at, piece);
            }
            3 => changed.insert(at, *value),
            4 if at < changed.len() => changed[at] ^= 1 << (value % 8),
            _ if at < changed.len() => changed[at] = *value,
            _ => {}
        }
    }
    changed
}

/// A drive past a wall with an object that appears and disappears.
pub fn scans() -> Vec<SonarScan> {
    let range_m = |step: u32, sonar: u32| if step / 9 % 2 == 1 && sonar == 3 { 0.7 } else { 1.0 + f64::from(sonar) * 0.2 };
    let reading = |step: u32, sonar: u32| SonarReading {
        mount: Pose { x_m: 0.1, y_m: 0.0, yaw_rad: f64::from(sonar) * 0.3 - 0.9 },
        range_m: range_m(step, sonar),
        sonar,
        echo: 1,
    };
    let pose = |step: u32| Pose { x_m: f64::from(step) * 0.02, y_m: 0.1, yaw_rad: f64::from(step) * 0.01 };
    (0..60).map(|step| SonarScan::new(pose(step), &[reading(step, 3), reading(step, step % 7)], false)).collect()
}

/// Both map layers and a verdict on every scan, so that a state holds everything it can.
pub fn mapper_parameters() -> mapping::Parameters {
    mapping::Parameters { commit: mapping::CommitRule::Verdict, keep_unfiltered: true, ..mapping::Parameters::default() }
}

/// The services before their first scan.
pub fn services() -> (Mapper, Std, Fti) {
    let mapper = Mapper::new(&mapper_parameters()).unwrap();
    let std = Std::new(stillmap_std::Parameters::default()).unwrap();
    (mapper, std, Fti::new(fti::Parameters::default()).unwrap())
}

/// Feeds scans, each with the answer of STD.
pub fn drive(services: &mut (Mapper, Std, Fti), scans: &[SonarScan]) {
    let (mapper, std, fti) = services;
    let mut verdicts = Vec::new();
    for (seq, scan) in (1..).zip(scans) {
        let stamp_ns = seq * 100_000_000;
        let _ = mapper.step(mapping::Input::Scan { seq, stamp_ns, scan });
        let motion = std.step(stamp_ns, scan);
        fti.take(fti::Input::Scan { seq, stamp_ns, scan });
        fti.take(fti::Input::Sonar { seq, motion: &motion });
        while fti.advance(&mut verdicts) {}
    }
}
