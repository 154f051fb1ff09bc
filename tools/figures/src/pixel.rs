//! Fig. 3 of section 5: the values of one pixel over time, and the mixture that EM learns from them (eq. 4).

use messages::{Pose, seconds};
use sbs::mixture::{EmRule, GREY_LEVELS, learn};
use simulator::camera::{Camera, Flaws, LABEL_SHADOW, LABEL_WALKER, Moment, Picture};

use crate::chart::{Axis, Chart, legend};
use crate::detection::optics;
use crate::scenes::{CORRIDOR, Error};
use crate::svg::{LINES, Svg};

/// A minute at 15 Hz.
const FRAMES: usize = 900;
const SEED: u64 = 1;
/// Where the camera stands, in the world's frame.
const PLACE: Pose = Pose { x_m: 0.9, y_m: 1.0, yaw_rad: 0.0 };

pub(crate) fn figure() -> Result<String, Error> {
    let samples = pixel_process()?;
    let fit = learn(&samples, &EmRule::default()).ok_or("a mixture of the samples")?;
    let mut svg = Svg::new(1080.0, 330.0);

    let mut counts = [0_u32; GREY_LEVELS as usize];
    for sample in &samples {
        if let Some(count) = counts.get_mut(*sample as usize) {
            *count += 1;
        }
    }
    let most = counts.iter().copied().max().unwrap_or(1);
    let top = f64::from(most.div_ceil(20) * 20);
    let histogram = Chart { at: [60.0, 40.0], size: [450.0, 220.0], x: [0.0, 256.0], y: [0.0, top] };
    let grey = Axis { name: "grey level", spaces: 8 };
    histogram.axes(&mut svg, "(a) a pixel of a standing simulated camera, one minute", grey, Axis { name: "frames", spaces: 4 });
    for (level, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
        let [x, y] = histogram.place(level as f64, f64::from(*count));
        let [_, bottom] = histogram.place(0.0, 0.0);
        svg.rectangle([x, y], [histogram.size[0] / 256.0, bottom - y], "#667085");
    }

    // Shadows and people are rare: without the logarithm only the background would be seen.
    let model = Chart { at: [590.0, 40.0], size: [450.0, 220.0], x: [0.0, 256.0], y: [-6.0, 0.0] };
    model.axes(&mut svg, "(b) the mixture learned from them", grey, Axis { name: "log₁₀ of the density", spaces: 6 });
    for (class, colour) in LINES.into_iter().enumerate().take(3) {
        let density = |z: f64| fit.mixture.classes(z).get(class).copied().unwrap_or_default();
        let log = |z: f64| density(z).log10().clamp(-6.0, 0.0);
        model.line(&mut svg, (0..=512).map(|half| f64::from(half) / 2.0).map(|z| [z, log(z)]), colour);
    }
    let b = fit.mixture.background;
    let s = fit.mixture.shadow;
    let names = [
        "foreground".to_owned(),
        format!("background: {:.1} ± {:.1}", b.mean, b.sigma),
        format!("in shadow: {:.1} ± {:.1}", s.mean, s.sigma),
    ];
    let entries: Vec<(&str, &str)> = LINES.into_iter().zip(names.iter().map(String::as_str)).collect();
    legend(&mut svg, [560.0, 316.0], &entries);
    Ok(svg.finish())
}

/// The values of the pixel of a standing camera that shows both people and their shadows most often.
fn pixel_process() -> Result<Vec<f64>, Error> {
    let world = world_file::parse("corridor.toml", CORRIDOR)?;
    let mut camera = Camera::new(&world, &optics(), &Flaws { drift: 0.0, ..Flaws::default() }, SEED);
    let mut picture = Picture::default();
    let mut pictures = Vec::with_capacity(FRAMES);
    let mut shown: Vec<[u32; 2]> = Vec::new();
    for number in 1..=FRAMES as u64 {
        let time_s = seconds(camera.stamp_ns(number));
        camera.take_from(number, &Moment { time_s, robot: PLACE, covered_m: 0.0 }, &mut picture);
        shown.resize(picture.labels.len(), [0, 0]);
        for (counts, label) in shown.iter_mut().zip(&picture.labels) {
            counts[0] += u32::from(*label == LABEL_WALKER);
            counts[1] += u32::from(*label == LABEL_SHADOW);
        }
        pictures.push(picture.grey.clone());
    }
    let busiest = shown.iter().enumerate().max_by_key(|(_, [walker, shadow])| walker.min(shadow)).map(|(pixel, _)| pixel);
    let pixel = busiest.ok_or("a pixel")?;
    Ok(pictures.iter().filter_map(|grey| grey.get(pixel)).map(|grey| f64::from(*grey)).collect())
}
