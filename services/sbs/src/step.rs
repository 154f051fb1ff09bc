//! The service as a fold: `step` takes a frame and gives its answer.

use messages::{Blob, CameraMotion, CameraStatus, FrameLayout, MAX_BLOBS};

use crate::alignment::{Covariance, region};
use crate::blobs::{self, Evidence};
use crate::compensation::{self, Found, Frames};
use crate::components::{Component, components};
use crate::field::Field;
use crate::learning::Training;
use crate::local;
use crate::model::{Model, SET};
use crate::morphology;
use crate::motion::{Motion, Places};
use crate::picture::{Refusal, luminance};
use crate::plane::Plane;
use crate::pyramid::{self, Pyramid};
use crate::settings::Settings;
use crate::shadow;
use crate::transform::Transform;

/// Pose of the robot by its odometry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Odometry {
    /// Heading, rad, counter-clockwise.
    pub yaw_rad: f64,
}

/// One picture of the camera.
#[derive(Debug, Clone, Copy)]
pub struct Frame<'a> {
    /// Sensor time, ns.
    pub stamp_ns: u64,
    /// Shape of the bytes.
    pub layout: FrameLayout,
    /// The pixels.
    pub bytes: &'a [u8],
    /// The pose at that time, if it is known.
    pub odometry: Option<Odometry>,
}

/// What there is to say about a frame besides its status.
#[derive(Debug, Clone, PartialEq)]
pub enum Remark {
    /// Nothing.
    None,
    /// It was refused; the state is as before.
    Refused(Refusal),
    /// The pictures have another size than before: everything starts anew.
    NewSize,
    /// So much time lay between this frame and the last one that the motion before says nothing any more.
    Gap {
        /// That time, s.
        seconds: f64,
    },
    /// The odometry is no number and was not used.
    BadOdometry,
    /// Too many frames in a row were not compensated: the model starts anew with this one.
    ModelRestarted,
}

/// The answer to a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// As it goes out on the bus.
    pub motion: CameraMotion,
    /// What else there is to say.
    pub remark: Remark,
}

/// After a gap longer than this, ns, prediction says nothing.
const GAP_NS: u64 = 1_000_000_000;
/// After this many frames in a row that were not compensated, the model starts anew.
const FAILURES_MAX: u32 = 3;
/// The local field starts from this share of the last one.
const FIELD_KEPT: f32 = 0.9;

/// Everything SBS remembers between frames.
#[derive(Debug, Clone)]
pub struct State {
    pub(crate) settings: Settings,
    pub(crate) last_stamp_ns: Option<u64>,
    pub(crate) scene: Option<Scene>,
}

/// What is known of the scene: everything in the frame of the last compensated picture.
#[derive(Debug, Clone)]
pub(crate) struct Scene {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// The base picture: what motion is estimated in.
    pub(crate) base: Plane<f32>,
    pub(crate) pyramid: Pyramid,
    pub(crate) model: Model,
    /// From the last picture's frame to the model's, base px: what has not been worth a resampling yet.
    pub(crate) carry: Field,
    /// The last motion; the prediction of the next.
    pub(crate) motion: Motion,
    /// The cleaned foreground before the tests of blobs.
    pub(crate) foreground: Plane<u8>,
    /// The mask of the blobs.
    pub(crate) mask: Plane<u8>,
    pub(crate) yaw_rad: Option<f64>,
    pub(crate) failures: u32,
    /// While it is there, the status is `Learning`.
    pub(crate) training: Option<Training>,
}

impl State {
    /// Nothing seen yet.
    #[must_use]
    pub fn new(settings: Settings) -> Self {
        Self { settings, last_stamp_ns: None, scene: None }
    }

    /// The mask of the last frame's blobs: 255 where something moves.
    #[must_use]
    pub fn mask(&self) -> Option<&Plane<u8>> {
        self.scene.as_ref().map(|s| &s.mask)
    }

    /// The background picture, grey levels.
    #[must_use]
    pub fn background(&self) -> Option<Plane<u8>> {
        let mean = &self.scene.as_ref()?.model.background.mean;
        Plane::from_values(mean.width(), mean.height(), mean.values().iter().map(|&m| (m + 0.5) as u8).collect())
    }

    /// Takes a frame.
    pub fn step(&mut self, frame: &Frame<'_>) -> Answer {
        let picture = match self.accepted(frame) {
            Ok(picture) => picture,
            Err(refusal) => return refused(frame, refusal),
        };
        let gap_ns = self.last_stamp_ns.map_or(0, |last| frame.stamp_ns - last);
        self.last_stamp_ns = Some(frame.stamp_ns);
        let mut remark = Remark::None;
        let yaw_rad = frame.odometry.map(|o| o.yaw_rad).filter(|yaw| yaw.is_finite());
        if frame.odometry.is_some() && yaw_rad.is_none() {
            remark = Remark::BadOdometry;
        }
        if let Some(scene) = &mut self.scene {
            if (scene.width, scene.height) != (picture.width(), picture.height()) {
                remark = Remark::NewSize;
                self.scene = None;
            } else if gap_ns > GAP_NS {
                remark = Remark::Gap { seconds: gap_ns as f64 * 1e-9 };
                scene.forget_motion();
            }
        }
        let Some(scene) = &mut self.scene else {
            self.scene = Some(Scene::new(&picture, yaw_rad, &self.settings));
            return answer(CameraStatus::Learning, &picture, None, &[], remark);
        };
        scene.step(&picture, yaw_rad, &self.settings, remark)
    }

    fn accepted(&self, frame: &Frame<'_>) -> Result<Plane<f32>, Refusal> {
        match self.last_stamp_ns {
            Some(last_ns) if frame.stamp_ns <= last_ns => Err(Refusal::Time { stamp_ns: frame.stamp_ns, last_ns }),
            _ => luminance(&frame.layout, frame.bytes),
        }
    }
}

/// Halvings from a picture to its base picture, about 160 to 320 wide: subpixel motion does not need more.
pub(crate) fn halvings(width: usize) -> u32 {
    if width < 320 { 0 } else { 1 }
}

/// Edge of the local field's cells, base px.
pub(crate) fn cell_edge(base_width: usize) -> usize {
    if base_width < 240 { 8 } else { 16 }
}

/// A frame on its way through the steps.
struct Current<'a> {
    picture: &'a Plane<f32>,
    /// The base picture and its pyramid.
    base: Plane<f32>,
    pyramid: Pyramid,
    /// Base pixels that take no part in motion compensation: the last foreground, dilated 5 × 5.
    moving: Plane<u8>,
    /// Its brightness over the previous frame's.
    gain: f32,
}

impl<'a> Current<'a> {
    fn new(picture: &'a Plane<f32>, scene: &Scene) -> Self {
        let halvings = halvings(scene.width);
        let base = pyramid::base(picture, halvings);
        let mut pyramid = Pyramid::default();
        pyramid.rebuild(&base);
        let moving = morphology::dilated(&morphology::dilated(&morphology::reduced(&scene.foreground, 1 << halvings)));
        let gain = compensation::gain(&base, &scene.base, &moving);
        Self { picture, base, pyramid, moving, gain }
    }
}

impl Scene {
    fn new(picture: &Plane<f32>, yaw_rad: Option<f64>, settings: &Settings) -> Self {
        let (width, height) = (picture.width(), picture.height());
        let base = pyramid::base(picture, halvings(width));
        let still = Field::zero(base.width(), base.height(), cell_edge(base.width()));
        let mut pyramid = Pyramid::default();
        pyramid.rebuild(&base);
        let mut model = Model::unknown(picture, &settings.background);
        model.match_values(picture, 1.0, &settings.background);
        let mut training = Training::default();
        training.push(picture, 1.0);
        Self {
            width,
            height,
            pyramid,
            base,
            model,
            carry: still.clone(),
            motion: Motion { transform: Transform::identity(), field: still },
            foreground: Plane::filled(width, height, 0),
            mask: Plane::filled(width, height, 0),
            yaw_rad,
            failures: 0,
            training: (settings.training_frames > 1).then_some(training),
        }
    }

    /// The next motion is sought from standstill.
    fn forget_motion(&mut self) {
        self.motion = Motion { transform: Transform::identity(), field: self.motion.field.times(0.0) };
    }

    /// One frame, in the paper's order: motion compensation, detection, update, shadow, blobs.
    fn step(&mut self, picture: &Plane<f32>, yaw_rad: Option<f64>, settings: &Settings, remark: Remark) -> Answer {
        let now = Current::new(picture, self);
        let frames = Frames { current: &now.pyramid, previous: &self.pyramid, moving: &now.moving, gain: now.gain };
        let focal_px = 0.5 * now.base.width() as f64 / (0.5 * settings.field_of_view_rad).tan();
        let turned = self.yaw_rad.zip(yaw_rad).and_then(|(before, now)| compensation::turned(now - before, focal_px));
        let (found, believed) = compensation::transform(&frames, self.motion.transform, turned, settings);
        if !believed {
            return self.not_compensated(picture, yaw_rad, settings, found, remark);
        }
        self.failures = 0;
        self.yaw_rad = yaw_rad;
        let gain_model = self.compensate(&now, found.transform, settings);
        if self.training.is_some() {
            self.learn(picture, gain_model, settings);
            self.keep(now);
            return answer(CameraStatus::Learning, picture, Some(found), &[], remark);
        }
        let (foreground, moved) = self.detect(&now, gain_model, found.agreement.sigma, settings);
        let first = (settings.horizon * self.height as f32).clamp(0.0, self.height as f32) as usize;
        let k = settings.background.k;
        let lit = shadow::dropped(&foreground, picture, &self.model, first, k, &settings.shadow);
        let cleaned = morphology::closed(&morphology::median(&lit));
        let last = morphology::dilated(&morphology::dilated(&self.foreground));
        let evidence = Evidence { mask: &cleaned, last: &last, moved: &moved, picture, model: &self.model, k };
        let (blobs, mask) = blobs::select(&components(&cleaned), &evidence, &settings.blobs);
        self.foreground = cleaned;
        self.mask = mask;
        self.keep(now);
        answer(CameraStatus::Compensated, picture, Some(found), &blobs, remark)
    }

    /// The current frame becomes the previous one.
    fn keep(&mut self, now: Current<'_>) {
        self.pyramid = now.pyramid;
        self.base = now.base;
    }

    /// The local field on top of T, and the model carried into the current frame. Gives the frame's brightness over the model's.
    fn compensate(&mut self, now: &Current<'_>, transform: Transform, settings: &Settings) -> f32 {
        let rule = &settings.local;
        let model_base = pyramid::base(&self.model.background.mean, halvings(self.width));
        let gain_model = compensation::gain(&now.base, &model_base, &now.moving);
        let reference = compensation::reference(&self.base, now.gain, &model_base, gain_model, rule.model_share);
        // The reference lies a share of the carry away from the previous frame.
        let start = Motion { transform, field: self.motion.field.times(FIELD_KEPT).plus(&self.carry, rule.model_share) };
        let to_reference = local::estimate(now.pyramid.base(), &reference, &now.moving, start, rule);
        let to_previous = Motion { transform, field: to_reference.field.plus(&self.carry, -rule.model_share) };
        let to_model = Motion { transform, field: to_previous.field.plus(&self.carry, 1.0) };
        let whole = to_model.displacement();
        let factor = 1_usize << halvings(self.width);
        if whole.rms() * factor as f32 > settings.resample_px {
            if let Some(motion) = to_model.scaled(factor) {
                self.model = self.model.resampled(&motion, now.picture, &settings.background);
            }
            self.carry = whole.times(0.0);
            // What was seen before is not what these pixels see now.
            self.training = None;
        } else {
            self.carry = whole;
        }
        self.motion = to_previous;
        gain_model
    }

    fn learn(&mut self, picture: &Plane<f32>, gain: f32, settings: &Settings) {
        let Some(training) = &mut self.training else { return };
        training.push(picture, gain);
        if training.frames.len() >= settings.training_frames {
            self.model = training.model(picture, &settings.background);
            self.training = None;
        }
    }

    /// Labels every pixel and updates the model. Gives the foreground and where the compensated frame difference is not still.
    fn detect(&mut self, now: &Current<'_>, gain_model: f32, sigma_hat: Covariance, settings: &Settings) -> (Plane<u8>, Plane<u8>) {
        let rule = &settings.background;
        let mut foreground = self.model.match_values(now.picture, gain_model, rule);
        let around = neighbours(sigma_hat.times(settings.beta), settings.h_bar);
        let mut moved = Plane::filled(self.width, self.height, 0_u8);
        let slow = morphology::dilated(&self.mask);
        let halvings = halvings(self.width);
        let (mut places, mut places_of) = (Places::default(), usize::MAX);
        let before = &self.base;
        for v in 0..self.height {
            let base_v = (v >> halvings).min(now.base.height() - 1);
            for u in 0..self.width {
                let at = v * self.width + u;
                if foreground.values()[at] == 0 {
                    continue;
                }
                let z = now.picture.values()[at];
                if !around.is_empty() && self.model.explained_around(u, v, z, &around, rule.k) {
                    foreground.values_mut()[at] = 0;
                    continue;
                }
                if places_of != base_v {
                    self.motion.places(base_v, now.base.width(), &mut places);
                    places_of = base_v;
                }
                let base_u = (u >> halvings).min(now.base.width() - 1);
                let difference = now.base.row(base_v)[base_u] - now.gain * before.bilinear(places.u[base_u], places.v[base_u]);
                let still = difference.abs() < settings.still_level;
                if !still {
                    moved.values_mut()[at] = SET;
                }
                self.model.feed_candidate(at, z, still && slow.values()[at] == 0, rule);
            }
        }
        (foreground, moved)
    }

    fn not_compensated(&mut self, picture: &Plane<f32>, yaw_rad: Option<f64>, settings: &Settings, found: Found, remark: Remark) -> Answer {
        self.failures += 1;
        self.forget_motion();
        self.mask = Plane::filled(self.width, self.height, 0);
        let mut remark = remark;
        if self.failures >= FAILURES_MAX {
            *self = Self::new(picture, yaw_rad, settings);
            self.training = None;
            remark = Remark::ModelRestarted;
        }
        answer(CameraStatus::NotCompensated, picture, Some(found), &[], remark)
    }
}

/// The pixels of the region of a place (eq. 6) besides its own, as offsets; T is resampled into whole pixels already.
fn neighbours(sigma: Covariance, h_bar: f64) -> Vec<(isize, isize)> {
    region([0.0, 0.0], sigma, h_bar).iter().map(|p| (p.u as isize, p.v as isize)).filter(|&o| o != (0, 0)).collect()
}

fn refused(frame: &Frame<'_>, refusal: Refusal) -> Answer {
    let motion = CameraMotion {
        transform: Transform::identity().rows(),
        status: CameraStatus::Refused as u32,
        width: frame.layout.width.min(640),
        height: frame.layout.height.min(480),
        ..CameraMotion::default()
    };
    Answer { motion, remark: Remark::Refused(refusal) }
}

fn answer(status: CameraStatus, picture: &Plane<f32>, found: Option<Found>, blobs: &[Component], remark: Remark) -> Answer {
    let mut motion = CameraMotion {
        transform: found.map_or(Transform::identity(), |f| f.transform).rows(),
        residual_px: found.map_or(0.0, |f| f.agreement.sigma.rms()),
        inliers: found.map_or(0.0, |f| f.agreement.inliers),
        status: status as u32,
        width: picture.width() as u32,
        height: picture.height() as u32,
        count: blobs.len().min(MAX_BLOBS) as u32,
        ..CameraMotion::default()
    };
    for (out, c) in motion.blobs.iter_mut().zip(blobs) {
        *out = Blob {
            u_px: (c.sum_u as f64 / f64::from(c.size)) as f32,
            v_px: (c.sum_v as f64 / f64::from(c.size)) as f32,
            size_px: c.size,
            left_px: c.left,
            top_px: c.top,
            right_px: c.right,
            bottom_px: c.bottom,
            reserved: 0,
        };
    }
    Answer { motion, remark }
}
