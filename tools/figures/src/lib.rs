#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

//! The paper's figures from this project's own code, and one of what the paper leaves to future work.
//!
//! Each figure is an SVG that is a function of nothing but the code: the same command gives the same bytes. What a figure
//! shows is computed by the very libraries that map, with the parameters that its caption names.

mod chart;
mod detection;
mod drift;
mod maps;
mod membership;
mod panels;
mod picture;
mod pixel;
mod raster;
mod scenes;
mod sensor;
mod study;
mod svg;
mod tvm;

/// A figure as a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Figure {
    /// Name of the file.
    pub name: &'static str,
    /// What it shows, in words.
    pub title: &'static str,
    /// The picture.
    pub svg: String,
}

/// A figure that could not be made.
#[derive(Debug, thiserror::Error)]
#[error("{figure}: {source}")]
pub struct FigureError {
    /// The figure's file.
    figure: &'static str,
    /// Which part refused what, or did not come out.
    source: Box<dyn std::error::Error + Send + Sync>,
}

type Maker = fn() -> Result<String, Box<dyn std::error::Error + Send + Sync>>;

/// Every figure, those of the paper first: file, what it shows, how it is made.
const FIGURES: [(&str, &str, Maker); 8] = [
    ("fig01-sensor-model.svg", "Fig. 1: the sensor model, an echo from 0.7 m", sensor::figure),
    ("fig03-time-variant-maps.svg", "Fig. 3: time-variant maps and sonar temporal difference", tvm::figure),
    ("fig03b-pixel-process.svg", "Fig. 3 of section 5: a pixel's values and the mixture learned from them", pixel::figure),
    ("fig05-detection.svg", "Fig. 5: what moves in the picture of a camera", detection::figure),
    ("fig06-membership-functions.svg", "Fig. 6: the sets of Tables 3 to 5", membership::figure),
    ("fig07-moved-obstacle.svg", "Fig. 7: an obstacle that is moved twice", study::figure),
    ("fig10-maps.svg", "Fig. 10: a hall with people, without and with the filter", maps::figure),
    ("drift.svg", "A drive whose odometry drifts, without and with localisation", drift::figure),
];

/// Makes every figure, the paper's in its order.
///
/// # Errors
/// The first figure that could not be made, and why.
pub fn all() -> impl Iterator<Item = Result<Figure, FigureError>> {
    FIGURES.into_iter().map(|(name, title, make)| {
        let svg = make().map_err(|source| FigureError { figure: name, source })?;
        Ok(Figure { name, title, svg })
    })
}
