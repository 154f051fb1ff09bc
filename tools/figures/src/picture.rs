//! Grey pictures inside a figure.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use crate::scenes::Error;
use crate::svg::Svg;

/// Draws a grey picture, row by row from its top; `edge` is that of a pixel.
pub(crate) fn draw(svg: &mut Svg, at: [f64; 2], edge: f64, width: u32, pixels: &[u8]) -> Result<(), Error> {
    let height = u32::try_from(pixels.len())? / width.max(1);
    let mut png = Vec::new();
    PngEncoder::new_with_quality(&mut png, CompressionType::Best, FilterType::Adaptive).write_image(
        pixels,
        width,
        height,
        ExtendedColorType::L8,
    )?;
    svg.image(at, [edge * f64::from(width), edge * f64::from(height)], &data_encoding::BASE64.encode(&png));
    Ok(())
}
