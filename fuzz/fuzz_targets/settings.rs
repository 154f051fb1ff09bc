//! Damaged settings and worlds: rejected with one line, or written and read again as the same.
#![no_main]

mod common;

use libfuzzer_sys::fuzz_target;
use settings::{DocumentError, Settings};

const HALL: &str = include_str!("../../config/worlds/hall.toml");

fuzz_target!(|bytes: &[u8]| {
    let Some((how, bytes)) = bytes.split_first() else { return };
    let text = |sound: &str| match how & 0x80 {
        0 => String::from_utf8_lossy(&common::changed(sound.as_bytes(), bytes)).into_owned(),
        _ => String::from_utf8_lossy(bytes).into_owned(),
    };
    if how % 2 == 0 {
        deployment(&text(common::DEMO));
    } else if let Err(error) = world_file::parse("fuzzing.toml", &text(HALL)) {
        in_one_line(&error);
    }
});

fn deployment(text: &str) {
    match Settings::parse("fuzzing.toml", text) {
        Ok(settings) => {
            let written = settings.to_toml().unwrap();
            assert_eq!(Settings::parse("written.toml", &written).unwrap(), settings);
        }
        Err(error) => in_one_line(&error),
    }
}

fn in_one_line(error: &DocumentError) {
    assert!(!error.to_string().contains('\n'), "{error}");
}
