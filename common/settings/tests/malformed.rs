//! Whatever a file holds, reading it ends in settings or in one line.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use std::path::Path;

use proptest::prelude::*;
use stillmap_settings::Settings;

fn demo() -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/demo.toml")).unwrap()
}

/// Reads the text and says whether it was refused, with one plain line.
fn refuses(text: &str) -> bool {
    match Settings::parse("x.toml", text) {
        Ok(_) => false,
        Err(error) => {
            let line = error.to_string();
            assert!(line.starts_with("x.toml:"), "{line}");
            assert!(!line.contains(char::is_control), "{line:?}");
            assert!(line.chars().count() < 500, "{line}");
            true
        }
    }
}

/// Reads the bytes as those of a file.
fn read(bytes: &[u8]) {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), bytes).unwrap();
    if let Err(error) = Settings::read(file.path()) {
        let line = error.to_string();
        assert!(line.starts_with(&file.path().display().to_string()), "{line}");
        assert!(!line.contains(char::is_control), "{line:?}");
    }
}

/// A file cut within a comment or after a section may still be a whole file; in between it is refused.
#[test]
fn cut_at_every_length() {
    let demo = demo();
    assert!(demo.is_ascii(), "every length is one of a text");
    let refused = (0..demo.len()).filter(|length| refuses(&demo[..*length])).count();
    assert!(refused > demo.len() / 4, "{refused} of {}", demo.len());
}

#[test]
fn every_bit_flipped() {
    let demo = demo();
    let mut refused = 0;
    for offset in 0..demo.len() {
        // The highest bit would end the text being UTF-8.
        for bit in 0..7 {
            let mut flipped = demo.clone().into_bytes();
            flipped[offset] ^= 1 << bit;
            refused += usize::from(refuses(&String::from_utf8(flipped).unwrap()));
        }
    }
    assert!(refused > demo.len(), "{refused} of {}", 7 * demo.len());
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
        assert!(refuses(&text), "{:?}", text.get(..40));
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
        refuses(&words.concat());
    }

    #[test]
    fn damaged_files(damage in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..3), 1..20)) {
        let mut bytes = demo().into_bytes();
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
