//! A checkpoint with a damaged head or tile: rejected, or restored and able to process the next scans.
#![no_main]

mod common;

use std::sync::LazyLock;

use fti::Fti;
use libfuzzer_sys::fuzz_target;
use mapping::Mapper;
use messages::{Payload, SonarScan, StreamCursor};
use stillmap_std::Std;

/// Head and tiles of a state.
type Parts = (Vec<u8>, Vec<([i32; 3], Vec<u8>)>);

/// The states of mapping, STD and FTI after a drive. STD has a head only.
static SOUND: LazyLock<[Parts; 3]> = LazyLock::new(|| {
    let mut services = common::services();
    common::drive(&mut services, &common::scans());
    let (mapper, std, fti) = services;
    [mapper_parts(&mapper), (std.to_bytes(), Vec::new()), fti_parts(&fti)]
});

fn mapper_parts(mapper: &Mapper) -> Parts {
    (mapper.save_head(), tiles(mapper.saved_parts(), |key, bytes| mapper.save_part(key, bytes)))
}

fn fti_parts(fti: &Fti) -> Parts {
    (fti.save_head(Vec::new()), tiles(fti.saved_tiles(), |key, bytes| fti.save_tile(key, bytes)))
}

fn tiles(keys: Vec<[i32; 3]>, save: impl Fn([i32; 3], &mut Vec<u8>)) -> Vec<([i32; 3], Vec<u8>)> {
    let tile = |key| {
        let mut bytes = Vec::new();
        save(key, &mut bytes);
        (key, bytes)
    };
    keys.into_iter().map(tile).collect()
}

static SCANS: LazyLock<Vec<SonarScan>> = LazyLock::new(common::scans);

fuzz_target!(|bytes: &[u8]| {
    let Some(([how, place], bytes)) = bytes.split_first_chunk() else { return };
    let which = usize::from(how % 3);
    let (mut head, mut tiles) = SOUND[which].clone();
    let count = tiles.len();
    let part = match how >> 3 & 1 {
        1 if count > 0 => &mut tiles[usize::from(*place) % count].1,
        _ => &mut head,
    };
    *part = if how & 0x80 == 0 { common::changed(part, bytes) } else { bytes.to_vec() };
    match which {
        0 => map(head, tiles),
        1 => tracks(&head),
        _ => verdicts(&head, &tiles),
    }
});

fn borrowed(tiles: &[([i32; 3], Vec<u8>)]) -> impl Iterator<Item = ([i32; 3], &[u8])> {
    tiles.iter().map(|(key, tile)| (*key, tile.as_slice()))
}

fn map(head: Vec<u8>, tiles: Vec<([i32; 3], Vec<u8>)>) {
    let Ok(mut mapper) = Mapper::new(&common::mapper_parameters()).unwrap().restore(&head, borrowed(&tiles)) else { return };
    let (head, tiles) = mapper_parts(&mapper);
    assert!(Mapper::new(&common::mapper_parameters()).unwrap().restore(&head, borrowed(&tiles)).is_ok());
    let StreamCursor { seq, stamp_ns } = mapper.last_scan();
    for (k, scan) in (1..).zip(&SCANS[..3]) {
        let _ = mapper.step(mapping::Input::Scan { seq: seq.saturating_add(k), stamp_ns: stamp_ns.saturating_add(k), scan });
    }
    let _ = mapper.step(mapping::Input::End);
    mapper.refresh();
    mapper.summary().validate().unwrap();
}

fn tracks(state: &[u8]) {
    let Ok(mut std) = Std::from_bytes(stillmap_std::Parameters::default(), state) else { return };
    for (k, scan) in (1..).zip(&SCANS[..3]) {
        std.step(1_000_000_000_000 + k * 100_000_000, scan).validate().unwrap();
    }
    let _ = std.to_bytes();
}

fn verdicts(head: &[u8], tiles: &[([i32; 3], Vec<u8>)]) {
    let Ok(mut fti) = Fti::restore(fti::Parameters::default(), head, borrowed(tiles)) else { return };
    let last = fti.last_scan().map_or(0, |scan| scan.seq);
    for (k, scan) in (1..).zip(&SCANS[..3]) {
        fti.take(fti::Input::Scan { seq: last.saturating_add(k), stamp_ns: 1_000_000_000_000 + k * 100_000_000, scan });
    }
    fti.take(fti::Input::ScansEnded);
    let mut given = Vec::new();
    while fti.advance(&mut given) {}
    assert!(given.iter().all(|given| given.verdict.validate().is_ok()));
    let _ = fti_parts(&fti);
}
