//! Every figure is made, and made the same again.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

use stillmap_figures::{Figure, all};

#[test]
fn figures_are_the_same_to_the_byte_every_time() {
    let made = || all().collect::<Result<Vec<Figure>, _>>().unwrap();
    let (first, again) = (made(), made());
    assert_eq!(first.len(), 8);
    for (first, again) in first.iter().zip(&again) {
        assert!(first.svg.starts_with("<svg ") && first.svg.ends_with("</svg>\n"), "{}", first.name);
        let mut drawn = first.svg.lines().filter(|line| !line.starts_with("<image"));
        assert!(!drawn.any(|line| line.contains("NaN") || line.contains("inf")), "{} has a number that is none", first.name);
        assert!(first == again, "{} is not the same again", first.name);
    }
}

/// Those that do not depend on how good the filter is.
#[test]
fn the_readmes_figures_are_those_that_the_command_makes() {
    for (name, shown) in [
        ("fig05-detection.svg", include_str!("../../../docs/fig05-detection.svg")),
        ("fig07-moved-obstacle.svg", include_str!("../../../docs/fig07-moved-obstacle.svg")),
    ] {
        let made = all().map(Result::unwrap).find(|figure| figure.name == name).unwrap();
        assert!(made.svg == shown, "docs/{name} is another than `stillmap figures` makes: copy it from there");
    }
}
