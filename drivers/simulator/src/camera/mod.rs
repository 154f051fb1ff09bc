//! The robot's camera: pictures of the world, and the truth of every pixel.
//!
//! A picture is painted column by column, from what is far to what is near: floor and ceiling, the shadows of walkers on the floor,
//! what stands still (`scene`, `decor`), and the walkers' limbs between (`figure`). Everything has a texture that stays where it is
//! in the world (`materials`, `texture`), and everything is smoothed over the pixel that shows it, so that nothing flickers when
//! the camera moves by less than a pixel. Then come the flaws of a camera on wheels: it shakes with the floor, its light drifts,
//! and its pixels are noisy.
//!
//! A picture is a function of world, optics, seed, and the frame's number. The same function gives the same bytes everywhere,
//! but for the last bit of sines and cosines in a pose, which the rounding of places to single precision takes away in all but
//! one case in many millions.

mod canvas;
mod column;
mod decor;
mod figure;
mod lattice;
mod materials;
mod scene;
mod shadow;
mod texture;
mod view;

use messages::Pose;
use rand::Rng;

use crate::chance::of_grain;
use crate::journey::Journey;
use crate::optics::Optics;
use crate::walker::Walker;
use crate::world::{MAX_WALKERS, World};
use canvas::Canvas;
use column::Pixel;
use figure::Clothes;
use lattice::wave;
use materials::Materials;
use scene::Scene;
use view::View;

/// Truth of a pixel: it shows what stands still.
pub const LABEL_BACKGROUND: u8 = 0;
/// Truth of a pixel: the floor in a walker's shadow.
pub const LABEL_SHADOW: u8 = 50;
/// Truth of a pixel: the edge of a walker, which is only part of it.
pub const LABEL_EDGE: u8 = 170;
/// Truth of a pixel: a walker.
pub const LABEL_WALKER: u8 = 255;

/// A pixel shows no walker, or nothing but a walker, when this much at most is of the other.
const EDGE_SHARE: f32 = 0.1;
/// Less of the light missing than this is no shadow.
const SHADOW_SHARE: f32 = 0.04;
/// Time in which the light changes, s.
const DRIFT_S: f64 = 4.0;
/// Way on which the floor is uneven, m.
const UNEVEN_M: f64 = 0.06;

/// How the camera falls short of a perfect one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flaws {
    /// Spread of a pixel's noise, grey levels.
    pub noise: f64,
    /// The light drifts by this share at most.
    pub drift: f64,
    /// Driving over the floor tilts the camera up or down by this much at most, rad,
    pub pitch_rad: f64,
    /// and to either side by this much.
    pub roll_rad: f64,
}

impl Flaws {
    /// Every picture as geometry has it.
    pub const NONE: Self = Self { noise: 0.0, drift: 0.0, pitch_rad: 0.0, roll_rad: 0.0 };
}

impl Default for Flaws {
    /// A webcam of the cheaper kind on a robot that drives over tiles.
    fn default() -> Self {
        Self { noise: 2.2, drift: 0.08, pitch_rad: 0.003, roll_rad: 0.002 }
    }
}

/// A picture and its truth, row by row from the top.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Picture {
    /// Grey level of each pixel.
    pub grey: Vec<u8>,
    /// What each pixel shows: one of the labels above, in the convention of the ChangeDetection benchmark.
    pub labels: Vec<u8>,
}

/// A moment of a drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// Time since the start of the drive, s.
    pub time_s: f64,
    /// Where the robot is, in the world's frame.
    pub robot: Pose,
    /// The way that it has covered, m.
    pub covered_m: f64,
}

/// The camera of the robot on its way through a world.
#[derive(Debug, Clone)]
pub struct Camera {
    optics: Optics,
    flaws: Flaws,
    seed: u64,
    /// Of what is decided once: textures, clothes.
    look_seed: u32,
    journey: Journey,
    walkers: Vec<(Walker, Clothes)>,
    scene: Scene,
    materials: Materials,
    canvas: Canvas,
}

impl Camera {
    /// Before the first frame; the seed decides the textures, what hangs where, and the noise.
    #[must_use]
    pub fn new(world: &World, optics: &Optics, flaws: &Flaws, seed: u64) -> Self {
        let look_seed = (seed ^ (seed >> 32)) as u32;
        let walkers = world.walkers.iter().take(MAX_WALKERS).enumerate();
        Self {
            optics: *optics,
            flaws: *flaws,
            seed,
            look_seed,
            journey: Journey::of_robot(&world.robot),
            walkers: walkers.map(|(number, walker)| (Walker::new(walker), Clothes::of(look_seed, number))).collect(),
            scene: Scene::of(world, look_seed),
            materials: Materials::of(look_seed),
            canvas: Canvas::default(),
        }
    }

    /// Frames of the whole drive; frame k is taken k intervals after its start.
    #[must_use]
    pub fn total_frames(&self) -> u64 {
        (self.journey.end_s() * 1e9) as u64 / self.optics.interval_ns.max(1)
    }

    /// When a frame is taken, by its number from 1, ns since the start of the drive.
    #[must_use]
    pub fn stamp_ns(&self, frame: u64) -> u64 {
        frame.saturating_mul(self.optics.interval_ns)
    }

    /// Takes a frame of the drive, by its number from 1.
    pub fn take(&mut self, frame: u64, picture: &mut Picture) {
        let time_s = self.stamp_ns(frame) as f64 * 1e-9;
        let moment = self.journey.at(time_s);
        self.take_from(frame, &Moment { time_s, robot: moment.pose, covered_m: moment.covered_m }, picture);
    }

    /// Takes a frame from any place; its number decides the noise.
    pub fn take_from(&mut self, frame: u64, moment: &Moment, picture: &mut Picture) {
        let uneven = (moment.covered_m / UNEVEN_M) as f32;
        let pitch_rad = self.flaws.pitch_rad as f32 * wave(self.look_seed ^ 1, uneven);
        let roll_rad = self.flaws.roll_rad as f32 * wave(self.look_seed ^ 2, uneven);
        let view = View::new(&self.optics, &moment.robot, pitch_rad, roll_rad);
        self.scene.seen_by(&view, &mut self.canvas.visible);
        self.canvas.limbs.clear();
        self.canvas.shadows.clear();
        for (walker, clothes) in &self.walkers {
            let Some((stance, legs)) = walker.stance(moment.time_s).zip(walker.legs(moment.time_s)) else { continue };
            figure::limbs(&view, &stance, clothes, &mut self.canvas.limbs);
            shadow::shadows(&view, &stance.place, &legs.map(|leg| leg.centre), &mut self.canvas.shadows);
        }
        let light = 1.0 + self.flaws.drift as f32 * wave(self.look_seed ^ 3, (moment.time_s / DRIFT_S) as f32);
        let pixels = self.canvas.paint(&view, &self.materials, self.optics.size_px);
        expose(pixels, self.optics.size_px, light, &mut Grain::new(self.seed, frame, self.flaws.noise), picture);
    }
}

/// What the sensor makes of the light, row by row, of pixels that come column by column.
fn expose(pixels: &[Pixel], size_px: [u32; 2], light: f32, grain: &mut Grain, picture: &mut Picture) {
    let [width, height] = size_px.map(|size| size as usize);
    picture.grey.clear();
    picture.labels.clear();
    for row in 0..height {
        for pixel in pixels.iter().skip(row).step_by(height).take(width) {
            picture.grey.push((pixel.grey * light + grain.next() + 0.5) as u8);
            picture.labels.push(label(pixel));
        }
    }
}

fn label(pixel: &Pixel) -> u8 {
    match pixel {
        pixel if pixel.walker >= 1.0 - EDGE_SHARE => LABEL_WALKER,
        pixel if pixel.walker > EDGE_SHARE => LABEL_EDGE,
        pixel if pixel.shadow >= SHADOW_SHARE => LABEL_SHADOW,
        _ => LABEL_BACKGROUND,
    }
}

/// The noise of one frame's pixels.
struct Grain {
    chance: rand_chacha::ChaCha8Rng,
    scale: f32,
}

impl Grain {
    fn new(seed: u64, frame: u64, spread: f64) -> Self {
        // The sum of four bytes has a variance of 4 · (256² − 1) / 12, and is normal enough.
        Self { chance: of_grain(seed, frame), scale: (spread / 147.801) as f32 }
    }

    fn next(&mut self) -> f32 {
        let sum: i32 = self.chance.next_u32().to_le_bytes().into_iter().map(i32::from).sum();
        (sum - 510) as f32 * self.scale
    }
}
