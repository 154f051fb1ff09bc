//! Damaged bytes from a robot: the session continues, and its scans are valid and in order.
#![no_main]

mod common;

use libfuzzer_sys::fuzz_target;
use messages::Payload;
use pioneer::{Input, Output, Parameters, Session};

const RECORDED: [&[u8]; 3] = [
    include_bytes!("../../tests/data/pioneer/raw-sync-while-open_mobilesim.s2c.bin"),
    include_bytes!("../../tests/data/pioneer/aria291-simpleConnect-pty_mobilesim-pion1x.s2c.bin"),
    include_bytes!("../../tests/data/pioneer/aria291-wander_mobilesim-pion1x.s2c.bin"),
];

/// Splits the bytes into packets with valid checksums: each is a length and as many bytes of data.
fn packets(mut bytes: &[u8]) -> Vec<u8> {
    let mut line = Vec::new();
    while let Some((&length, rest)) = bytes.split_first() {
        let (data, rest) = rest.split_at(usize::from(length).min(rest.len()));
        line.extend(psos::encode_frame(data).unwrap_or_default());
        bytes = rest;
    }
    line
}

fuzz_target!(|bytes: &[u8]| {
    let Some(([how, piece], bytes)) = bytes.split_first_chunk() else { return };
    let line = match how % 5 {
        0 => bytes.to_vec(),
        1 => packets(bytes),
        recorded => {
            let sound = RECORDED[usize::from(recorded) - 2];
            common::changed(&sound[..sound.len().min(4096)], bytes)
        }
    };
    let mut session = Session::new(Parameters::default(), None);
    let (mut now_ns, mut last) = (1_000_000_000, (0, 0));
    let mut outputs = session.step(Input::Opened, now_ns);
    for piece in line.chunks(usize::from(*piece) + 1) {
        now_ns += 20_000_000;
        outputs.extend(session.step(Input::Bytes(piece), now_ns));
        outputs.extend(session.step(Input::Tick, now_ns));
        for output in outputs.drain(..) {
            match output {
                Output::Publish(kept) => {
                    kept.scan.validate().unwrap();
                    assert!(kept.seq > last.0 && kept.stamp_ns > last.1);
                    last = (kept.seq, kept.stamp_ns);
                }
                Output::Reopen => drop(session.step(Input::Opened, now_ns)),
                _ => {}
            }
        }
    }
});
