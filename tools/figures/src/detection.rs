//! Fig. 5: what moves in the pictures of a camera that drives (section 5).

use messages::{FrameLayout, PixelFormat, Pose, seconds};
use sbs::{Frame, Parameters, State};
use simulator::Optics;
use simulator::camera::{Camera, Flaws, LABEL_WALKER, Picture};

use crate::picture;
use crate::scenes::{CORRIDOR, Error};
use crate::svg::{Anchor, DIM, INK, Svg};

const WIDTH: u32 = 160;
const HEIGHT: u32 = 120;
const SEED: u64 = 1;
/// Moments shown: their number, their distance in frames, and the share of the picture that a walker covers.
const MOMENTS: usize = 4;
const APART_FRAMES: u64 = 60;
const FIRST_FRAME: u64 = 60;
const WALKER_SHARE: f64 = 0.06;
/// Common background subtraction: a running mean without compensation, and how far from it is foreground.
const LEARNING_RATE: f32 = 0.05;
const THRESHOLD: f32 = 25.0;

/// A row of pictures: its name on two lines, and which picture of a moment it shows.
type Row = (&'static str, &'static str, fn(&Moment) -> &Vec<u8>);

/// One moment of the drive.
struct Moment {
    time_s: f64,
    picture: Vec<u8>,
    background: Vec<u8>,
    common: Vec<u8>,
    statistical: Vec<u8>,
}

pub(crate) fn figure() -> Result<String, Error> {
    let moments = moments()?;
    let mut svg = Svg::new(120.0 + 180.0 * MOMENTS as f64, 610.0);
    let rows: [Row; 4] = [
        ("(a) what the", "camera sees", |moment| &moment.picture),
        ("(b) background", "of the mixture", |moment| &moment.background),
        ("(c) common", "subtraction", |moment| &moment.common),
        ("(d) statistical,", "compensated", |moment| &moment.statistical),
    ];
    for (row, (first, second, pixels)) in rows.into_iter().enumerate() {
        let top = 40.0 + 134.0 * row as f64;
        svg.text([12.0, top + 56.0], Anchor::Start, 13.0, INK, first);
        svg.text([12.0, top + 74.0], Anchor::Start, 13.0, INK, second);
        for (column, moment) in moments.iter().enumerate() {
            let left = 120.0 + 176.0 * column as f64;
            picture::draw(&mut svg, [left, top], 1.0, WIDTH, pixels(moment))?;
            if row == 0 {
                svg.text([left + 80.0, 28.0], Anchor::Middle, 12.0, DIM, &format!("after {:.1} s", moment.time_s));
            }
        }
    }
    let words = "A simulated camera drives through config/worlds/corridor.toml, 160 × 120 at 15 Hz. White: taken for moving.";
    svg.text([12.0, 594.0], Anchor::Start, 12.0, DIM, words);
    Ok(svg.finish())
}

/// The drive up to its last moment that is shown.
fn moments() -> Result<Vec<Moment>, Error> {
    let world = world_file::parse("corridor.toml", CORRIDOR)?;
    let mut camera = Camera::new(&world, &optics(), &Flaws::default(), SEED);
    let mut sbs = State::new(Parameters::default());
    let mut mean: Vec<f32> = Vec::new();
    let mut seen = Picture::default();
    let mut moments: Vec<Moment> = Vec::new();
    let mut not_before = FIRST_FRAME;
    for number in 1..=camera.total_frames() {
        camera.take(number, &mut seen);
        let stamp_ns = camera.stamp_ns(number);
        let layout = FrameLayout { width: WIDTH, height: HEIGHT, stride: WIDTH, format: PixelFormat::Grey as u32 };
        sbs.step(&Frame { stamp_ns, layout, bytes: &seen.grey, odometry: None });
        mean.resize(seen.grey.len(), 128.0);
        let common = subtract(&mut mean, &seen.grey);
        let walker = seen.labels.iter().filter(|label| **label == LABEL_WALKER).count();
        if number < not_before || (walker as f64) < WALKER_SHARE * seen.labels.len() as f64 {
            continue;
        }
        not_before = number + APART_FRAMES;
        moments.push(Moment {
            time_s: seconds(stamp_ns),
            picture: seen.grey.clone(),
            background: sbs.background().ok_or("a background")?.values().to_vec(),
            common,
            statistical: sbs.mask().ok_or("a mask")?.values().to_vec(),
        });
        if moments.len() == MOMENTS {
            return Ok(moments);
        }
    }
    Err(format!("{} moments with a walker in the picture, expected {MOMENTS}", moments.len()).into())
}

/// What a subtraction that knows nothing of the camera's own motion takes for moving; the mean takes the picture in.
fn subtract(mean: &mut [f32], picture: &[u8]) -> Vec<u8> {
    let each = mean.iter_mut().zip(picture).map(|(mean, grey)| {
        let off = f32::from(*grey) - *mean;
        *mean += LEARNING_RATE * off;
        if off.abs() > THRESHOLD { u8::MAX } else { 0 }
    });
    each.collect()
}

/// The simulated camera of the figures.
pub(crate) fn optics() -> Optics {
    Optics {
        mount: Pose::default(),
        height_m: 0.3,
        field_of_view_rad: 70.0_f64.to_radians(),
        horizon_share: 0.5,
        size_px: [WIDTH, HEIGHT],
        interval_ns: 1_000_000_000 / 15,
    }
}
