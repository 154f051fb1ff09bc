//! Any bytes as a Y4M file: each frame has the size that the header states, and the reader stops at the end.
#![no_main]

use libfuzzer_sys::fuzz_target;
use sbs::y4m::Y4mReader;

fuzz_target!(|bytes: &[u8]| {
    let Ok(mut reader) = Y4mReader::new(bytes) else { return };
    assert!(reader.period_ns() > 0 && reader.width() > 0 && reader.height() > 0);
    let mut luma = Vec::new();
    while let Ok(true) = reader.read(&mut luma) {
        assert_eq!(luma.len(), reader.width() * reader.height());
    }
    assert!(reader.offset() <= bytes.len() as u64);
});
