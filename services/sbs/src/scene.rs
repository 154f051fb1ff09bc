//! What is known of the scene, and the way of one picture through the steps of section 5 of the paper.

use messages::CameraStatus;

use crate::agreement::{Agreement, agreement};
use crate::alignment::{Covariance, region};
use crate::blobs::{self, Evidence};
use crate::compensation::{self, Found};
use crate::components::{Component, Run, components, runs};
use crate::field::Field;
use crate::frames::Frames;
use crate::learning::Training;
use crate::local;
use crate::model::{Model, SET};
use crate::morphology;
use crate::motion::{Motion, Places};
use crate::parameters::Parameters;
use crate::plane::Plane;
use crate::pyramid::{self, Pyramid};
use crate::samples::strongest;
use crate::shadow;
use crate::transform::Transform;

/// After this many frames in a row that were not compensated, the model starts anew.
const FAILURES_MAX: u32 = 3;
/// The local field starts from this share of the last one.
const FIELD_SHARE: f32 = 0.9;

/// A carry of less than this may be nothing but noise, base px.
const CARRY_STILL_PX: f32 = 0.1;
/// The support of the model may be this much below that of the frame before while the camera stands still.
const SUPPORT_STILL: f64 = 0.01;

/// What a picture came to.
#[derive(Debug)]
pub(crate) struct Outcome {
    pub(crate) status: CameraStatus,
    pub(crate) found: Found,
    /// Largest first.
    pub(crate) blobs: Vec<Component>,
    /// The model starts anew with this picture.
    pub(crate) restarted: bool,
}

/// What is known of the scene: everything in the frame of the last compensated picture.
#[derive(Debug, Clone)]
pub(crate) struct Scene {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Its finest level is the base picture: what motion is estimated in.
    pub(crate) pyramid: Pyramid,
    pub(crate) model: Model,
    /// Memory of the model before the last resampling, for the next one.
    pub(crate) reused: Model,
    /// Memory of the pyramid before the last one, for the next.
    pub(crate) spare_pyramid: Pyramid,
    /// From the last picture's frame to the model's, base px: what has not been worth a resampling yet.
    pub(crate) carry: Field,
    /// The last motion; the prediction of the next.
    pub(crate) motion: Motion,
    /// The cleaned foreground before the tests of blobs.
    pub(crate) foreground: Plane<u8>,
    /// For how many frames each pixel's blob has been one; 0 where there is none.
    pub(crate) age: Plane<u8>,
    pub(crate) yaw_rad: Option<f64>,
    pub(crate) failures: u32,
    /// While it is there, the status is `Learning`.
    pub(crate) training: Option<Training>,
}

/// Halvings from a picture to its base picture, about 160 to 320 wide: subpixel motion does not need more.
fn halvings(width: usize) -> u32 {
    if width < 320 { 0 } else { 1 }
}

/// Width and height of the base picture.
pub(crate) fn base_size(width: usize, height: usize) -> (usize, usize) {
    (width >> halvings(width), height >> halvings(width))
}

/// The local field of a base picture in which nothing moves: cells of 8 px, larger ones in larger pictures.
pub(crate) fn still_field(base_width: usize, base_height: usize) -> Field {
    Field::zero(base_width, base_height, if base_width < 240 { 8 } else { 16 })
}

/// A frame on its way through the steps.
struct Current<'a> {
    picture: &'a Plane<f32>,
    /// Of the base picture.
    pyramid: Pyramid,
    /// Base pixels that take no part in motion compensation: the last foreground, dilated 5 × 5.
    moving: Plane<u8>,
    /// Its brightness over the previous frame's.
    gain: f32,
}

impl<'a> Current<'a> {
    fn new(picture: &'a Plane<f32>, scene: &mut Scene) -> Self {
        let halvings = halvings(scene.width);
        let mut pyramid = std::mem::take(&mut scene.spare_pyramid);
        pyramid.rebuild(pyramid::base(picture, halvings));
        let moving = morphology::dilated(&morphology::dilated(&morphology::reduced(&scene.foreground, 1 << halvings)));
        let gain = compensation::gain(&pyramid.base().image, &scene.pyramid.base().image, &moving);
        Self { picture, pyramid, moving, gain }
    }
}

impl Outcome {
    /// Of the first picture.
    pub(crate) fn first() -> Self {
        let agreement = Agreement { inliers: 0.0, support: 0.0, sigma: Covariance { uu: 0.0, uv: 0.0, vv: 0.0 } };
        let found = Found { transform: Transform::identity(), agreement };
        Self { status: CameraStatus::Learning, found, blobs: Vec::new(), restarted: false }
    }
}

impl Scene {
    pub(crate) fn new(picture: &Plane<f32>, yaw_rad: Option<f64>, parameters: &Parameters) -> Self {
        let (width, height) = (picture.width(), picture.height());
        let base = pyramid::base(picture, halvings(width));
        let still = still_field(base.width(), base.height());
        let mut pyramid = Pyramid::default();
        pyramid.rebuild(base);
        let mut model = Model::unknown(picture, &parameters.background);
        model.match_values(picture, 1.0, &parameters.background);
        let mut training = Training::default();
        training.push(picture, 1.0);
        Self {
            width,
            height,
            pyramid,
            model,
            reused: Model::default(),
            spare_pyramid: Pyramid::default(),
            carry: still.clone(),
            motion: Motion { transform: Transform::identity(), field: still },
            foreground: Plane::filled(width, height, 0),
            age: Plane::filled(width, height, 0),
            yaw_rad,
            failures: 0,
            training: (parameters.training_frames > 1).then_some(training),
        }
    }

    /// The mask of the blobs.
    pub(crate) fn mask(&self) -> Plane<u8> {
        let mut mask = self.age.clone();
        mask.values_mut().iter_mut().for_each(|age| *age = if *age > 0 { SET } else { 0 });
        mask
    }

    /// The next motion is sought from standstill.
    pub(crate) fn forget_motion(&mut self) {
        self.motion = Motion { transform: Transform::identity(), field: self.motion.field.times(0.0) };
    }

    /// One frame, in the paper's order: motion compensation, detection, update, shadow, blobs.
    pub(crate) fn step(&mut self, picture: &Plane<f32>, yaw_rad: Option<f64>, parameters: &Parameters) -> Outcome {
        let now = Current::new(picture, self);
        let frames = Frames { current: &now.pyramid, previous: &self.pyramid, moving: &now.moving, gain: now.gain };
        let focal_px = 0.5 * now.pyramid.base().image.width() as f64 / (0.5 * parameters.field_of_view_rad).tan();
        let turned = self.yaw_rad.zip(yaw_rad).and_then(|(before, now)| compensation::turned(now - before, focal_px));
        let (found, is_plausible) = compensation::transform(&frames, self.motion.transform, turned, parameters);
        if !is_plausible {
            return self.not_compensated(picture, yaw_rad, parameters, found.scaled(1 << halvings(self.width)));
        }
        self.failures = 0;
        self.yaw_rad = yaw_rad;
        let gain_model = self.compensate(&now, &found, parameters);
        let found = found.scaled(1 << halvings(self.width));
        if self.training.is_some() {
            self.learn(picture, gain_model, parameters);
            self.keep(now);
            return Outcome { status: CameraStatus::Learning, found, blobs: Vec::new(), restarted: false };
        }
        let known = morphology::dilated(&self.mask());
        let (foreground, moved) = self.detect(&now, gain_model, found.agreement.sigma, &known, parameters);
        let first = (parameters.horizon * self.height as f32).clamp(0.0, self.height as f32) as usize;
        let k = parameters.background.k;
        let lit = shadow::dropped(&foreground, picture, &self.model, first, k, &parameters.shadow);
        let cleaned = morphology::closed(&morphology::median(&lit));
        // In a base picture as large as the frame this is what took no part in motion compensation.
        let enlarged = (halvings(self.width) > 0).then(|| morphology::dilated(&morphology::dilated(&self.foreground)));
        let last = enlarged.as_ref().unwrap_or(&now.moving);
        let evidence = Evidence { mask: &cleaned, last, blobs: &known, age: &self.age, moved: &moved, picture, model: &self.model, k };
        let (blobs, age) = blobs::select(&components(&cleaned), &evidence, &parameters.blobs);
        self.foreground = cleaned;
        self.age = age;
        self.keep(now);
        Outcome { status: CameraStatus::Compensated, found, blobs, restarted: false }
    }

    /// The current frame becomes the previous one.
    fn keep(&mut self, now: Current<'_>) {
        self.spare_pyramid = std::mem::replace(&mut self.pyramid, now.pyramid);
    }

    /// The local field on top of T, and the model carried into the current frame. Gives the frame's brightness over the model's.
    fn compensate(&mut self, now: &Current<'_>, found: &Found, parameters: &Parameters) -> f32 {
        let (rule, transform) = (&parameters.local, found.transform);
        let model_base = pyramid::base(&self.model.background.mean, halvings(self.width));
        let gain_model = compensation::gain(&now.pyramid.base().image, &model_base, &now.moving);
        if self.stands_still(now, found, &model_base, gain_model) {
            self.motion = Motion { transform, field: self.motion.field.times(0.0) };
            self.carry = self.carry.times(0.0);
            return gain_model;
        }
        let reference = compensation::reference(&self.pyramid.base().image, now.gain, &model_base, gain_model, rule.model_share);
        // The reference lies a share of the carry away from the previous frame.
        let start = Motion { transform, field: self.motion.field.times(FIELD_SHARE).plus(&self.carry, rule.model_share) };
        let to_reference = local::estimate(now.pyramid.base(), &reference, &now.moving, start, rule);
        let to_previous = Motion { transform, field: to_reference.field.plus(&self.carry, -rule.model_share) };
        let to_model = Motion { transform, field: to_previous.field.plus(&self.carry, 1.0) };
        let displacement = to_model.displacement();
        let factor = 1_usize << halvings(self.width);
        if displacement.rms() * factor as f32 > parameters.resample_px {
            if let Some(motion) = to_model.scaled(factor) {
                std::mem::swap(&mut self.model, &mut self.reused);
                self.model.resample(&self.reused, &motion, now.picture, &parameters.background);
            }
            self.carry = displacement.times(0.0);
            // What was seen before is not what these pixels see now.
            self.training = None;
        } else {
            self.carry = displacement;
        }
        self.motion = to_previous;
        gain_model
    }

    /// A camera that stands still sees no parallax, and a walker close by cannot bend the model: when the frame agrees
    /// with the model as it lies as well as it does with the frame before, there is no field to look for.
    fn stands_still(&self, now: &Current<'_>, found: &Found, model_base: &Plane<f32>, gain_model: f32) -> bool {
        if found.transform != Transform::identity() || self.carry.rms() > CARRY_STILL_PX {
            return false;
        }
        let samples = strongest(now.pyramid.base(), 0, &now.moving).thinned(compensation::THINNED);
        let with_model = agreement(&samples, model_base, gain_model, &found.transform);
        with_model.support >= found.agreement.support - SUPPORT_STILL
    }

    fn learn(&mut self, picture: &Plane<f32>, gain: f32, parameters: &Parameters) {
        let Some(training) = &mut self.training else { return };
        training.push(picture, gain);
        if training.frames.len() >= parameters.training_frames {
            self.model = training.model(picture, &parameters.background);
            self.training = None;
        }
    }

    /// Labels every pixel and updates the model; `known` marks where the last blobs were. Gives the foreground and where the
    /// compensated frame difference is not still.
    fn detect(
        &mut self,
        now: &Current<'_>,
        gain_model: f32,
        sigma_hat: Covariance,
        known: &Plane<u8>,
        parameters: &Parameters,
    ) -> (Plane<u8>, Plane<u8>) {
        let rule = &parameters.background;
        let mut foreground = self.model.match_values(now.picture, gain_model, rule);
        let around = neighbours(sigma_hat.times(parameters.beta), parameters.h_bar);
        let mut moved = Plane::filled(self.width, self.height, 0_u8);
        let halvings = halvings(self.width);
        let (mut places, mut places_of) = (Places::default(), usize::MAX);
        let (base, before) = (&now.pyramid.base().image, &self.pyramid.base().image);
        for Run { row: v, start, end, .. } in runs(&foreground) {
            let base_v = (v >> halvings).min(base.height() - 1);
            if places_of != base_v {
                self.motion.places(base_v, base.width(), &mut places);
                places_of = base_v;
            }
            for u in start..end {
                let at = v * self.width + u;
                let z = now.picture.values()[at];
                if !around.is_empty() && self.model.explained_around(u, v, z, &around, rule.k) {
                    foreground.values_mut()[at] = 0;
                    continue;
                }
                let base_u = (u >> halvings).min(base.width() - 1);
                let difference = base.row(base_v)[base_u] - now.gain * before.bilinear(places.u[base_u], places.v[base_u]);
                let still = difference.abs() < parameters.still_level;
                moved.values_mut()[at] = if still { 0 } else { SET };
                self.model.feed_candidate(at, z, still & (known.values()[at] == 0), rule);
            }
        }
        (foreground, moved)
    }

    /// The frame before stays the one to compare with: after a spoilt frame nothing has changed.
    fn not_compensated(&mut self, picture: &Plane<f32>, yaw_rad: Option<f64>, parameters: &Parameters, found: Found) -> Outcome {
        self.failures += 1;
        self.forget_motion();
        self.age.values_mut().fill(0);
        let restarted = self.failures >= FAILURES_MAX;
        if restarted {
            *self = Self { training: None, ..Self::new(picture, yaw_rad, parameters) };
        }
        Outcome { status: CameraStatus::NotCompensated, found, blobs: Vec::new(), restarted }
    }
}

/// The pixels of the region of a place (eq. 6) besides its own, as offsets; T is resampled into whole pixels already.
fn neighbours(sigma: Covariance, h_bar: f64) -> Vec<(isize, isize)> {
    region([0.0, 0.0], sigma, h_bar).iter().map(|p| (p.u as isize, p.v as isize)).filter(|&o| o != (0, 0)).collect()
}
