//! Whatever a file holds, reading it ends in settings or in one line.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use std::path::Path;

use proptest::prelude::*;
use stillmap_settings::Settings;

fn demo() -> Vec<u8> {
    std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/demo.toml")).unwrap()
}

/// Reads the bytes as a file's and returns the error's line, if there is one.
fn read(bytes: &[u8]) -> Option<String> {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), bytes).unwrap();
    let line = Settings::read(file.path()).err()?.to_string();
    let name = file.path().display().to_string();
    assert!(line.starts_with(&name), "{line}");
    assert!(!line.contains(char::is_control), "{line:?}");
    assert!(line.chars().count() < name.len() + 500, "{line}");
    Some(line)
}

/// A file cut within its comments or after a section is still a whole file; everything else is refused.
#[test]
fn cut_at_every_length() {
    let demo = demo();
    let refused = (0..demo.len()).filter(|length| read(&demo[..*length]).is_some()).count();
    assert!(refused > demo.len() / 4, "{refused} of {}", demo.len());
}

#[test]
fn every_bit_flipped() {
    let demo = demo();
    let mut refused = 0;
    for offset in 0..demo.len() {
        for bit in [0, 3, 6, 7] {
            let mut flipped = demo.clone();
            flipped[offset] ^= 1 << bit;
            refused += usize::from(read(&flipped).is_some());
        }
    }
    // The highest bit makes invalid UTF-8 of any byte.
    assert!(refused >= demo.len(), "{refused} of {}", demo.len());
}

#[test]
fn large_and_deep() {
    let most = 1 << 20;
    let dots = "a.".repeat(70);
    let nested = format!("a = {}1{}", format!("{{ {dots}a = ").repeat(70), "}".repeat(70));
    let long = |piece: &str| piece.repeat(most / piece.len());
    let texts = [
        nested,
        long("["),
        long("[["),
        long("a."),
        long("[[process]]\n"),
        long("a = {"),
        long("\""),
        long("'''"),
        long("#\n"),
        long(" "),
        format!("a = {}", "9".repeat(most - 4)),
        format!("name = \"{}\"", "n".repeat(most - 9)),
        format!("{} = 1", "k".repeat(most - 4)),
        (0..60_000).map(|number| format!("k{number} = {number}\n")).collect(),
    ];
    for text in texts {
        assert!(text.len() <= most, "{}", text.len());
        assert!(read(text.as_bytes()).is_some(), "{:?}", text.get(..40));
    }
}

proptest! {
    #[test]
    fn any_bytes(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        read(&bytes);
    }

    #[test]
    fn words_of_the_language(words in proptest::collection::vec(prop::sample::select(vec![
        "name", "process", "[[", "]]", "[", "]", "{", "}", "=", ".", ",", "\n", "\"", "'''", "mapping", "tuning", "robot", "sonar", "k_e",
        "0.5", "-1", "nan", "0x", "1e9", "true", "1979-05-27", "\"demo\"", "run", "é", "\r", "\0", "#", " ",
    ]), 0..60)) {
        read(words.concat().as_bytes());
    }

    #[test]
    fn damaged_files(damage in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..3), 1..20)) {
        let mut bytes = demo();
        for (place, byte, kind) in damage {
            let at = place.index(bytes.len());
            match kind {
                0 => bytes[at] = byte,
                1 => bytes.insert(at, byte),
                _ => { bytes.remove(at); }
            }
        }
        read(&bytes);
    }
}
