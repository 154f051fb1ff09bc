//! The state in a checkpoint, damaged: refused, or a state that goes on.
#![no_main]

mod common;

use std::sync::LazyLock;

use fti::Fti;
use libfuzzer_sys::fuzz_target;
use mapping::Mapper;
use messages::{Payload, SonarScan};
use settings::Pace;
use stillmap_std::Std;

/// The states of mapping, STD and FTI after a drive.
static SOUND: LazyLock<[Vec<u8>; 3]> = LazyLock::new(|| {
    let mut services = common::services();
    common::drive(&mut services, &common::scans());
    [services.0.save(), services.1.to_bytes(), services.2.to_bytes()]
});

static SCANS: LazyLock<Vec<SonarScan>> = LazyLock::new(common::scans);

fuzz_target!(|bytes: &[u8]| {
    let Some((how, bytes)) = bytes.split_first() else { return };
    let which = usize::from(how % 3);
    let state = if how & 0x80 == 0 { common::changed(&SOUND[which], bytes) } else { bytes.to_vec() };
    match which {
        0 => map(&state),
        1 => tracks(&state),
        _ => verdicts(&state),
    }
});

fn map(state: &[u8]) {
    let parameters = mapping::Parameters::new(&common::SETTINGS.mapping, Pace::Lockstep).unwrap();
    let Ok(mut mapper) = Mapper::restore(parameters, state) else { return };
    assert!(mapper.save() == state);
    let (seq, stamp_ns) = mapper.last_scan();
    for (k, scan) in (1..).zip(&SCANS[..3]) {
        let _ = mapper.step(mapping::Input::Scan { seq: seq.saturating_add(k), stamp_ns: stamp_ns.saturating_add(k), scan });
    }
    let _ = mapper.step(mapping::Input::End);
    mapper.refresh();
    mapper.summary().validate().unwrap();
}

fn tracks(state: &[u8]) {
    let Ok(mut std) = Std::from_bytes(stillmap_std::Parameters::of_settings(&common::SETTINGS), state) else { return };
    for (k, scan) in (1..).zip(&SCANS[..3]) {
        std.step(1_000_000_000_000 + k * 100_000_000, scan).validate().unwrap();
    }
    let _ = std.to_bytes();
}

fn verdicts(state: &[u8]) {
    let Ok(mut fti) = Fti::from_bytes(fti::Parameters::of_settings(&common::SETTINGS), state) else { return };
    let last = fti.last_scan().map_or(0, |(seq, _)| seq);
    for (k, scan) in (1..).zip(&SCANS[..3]) {
        fti.take(fti::Input::Scan { seq: last.saturating_add(k), stamp_ns: 1_000_000_000_000 + k * 100_000_000, scan });
    }
    fti.take(fti::Input::ScansEnded);
    let mut given = Vec::new();
    while fti.advance(&mut given) {}
    assert!(given.iter().all(|given| given.verdict.validate().is_ok()));
    let _ = fti.to_bytes();
}
