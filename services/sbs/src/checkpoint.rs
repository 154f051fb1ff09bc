//! The state as bytes, to resume after a restart as if nothing had happened. What can be computed from the rest is left out.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};
use state::{DecodeError, Packed, decode, encode};

use crate::field::Field;
use crate::learning::Training;
use crate::model::{Gaussians, LearnedShadow, Model};
use crate::motion::Motion;
use crate::parameters::Parameters;
use crate::picture::{HEIGHT_RANGE, WIDTH_RANGE};
use crate::plane::Plane;
use crate::pyramid::Pyramid;
use crate::scene::{Scene, base_size, still_field};
use crate::state::State;
use crate::transform::Transform;
use crate::working::Working;

/// Most frames of training.
const TRAINING_MAX: usize = 1024;

/// Bytes that are no state.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CheckpointError {
    /// They are of another version or damaged.
    #[error(transparent)]
    Bytes(#[from] DecodeError),
    /// A value is not valid.
    #[error("{what} of the state is not valid")]
    Value {
        /// What it is.
        what: &'static str,
    },
}

#[derive(Serialize, Deserialize, Schema)]
struct SavedState<'a> {
    last_stamp_ns: Option<u64>,
    scene: Option<SavedScene<'a>>,
}

#[derive(Serialize, Deserialize, Schema)]
struct SavedScene<'a> {
    /// Size of the pictures.
    width: u32,
    height: u32,
    base: SavedPlane<'a, f32>,
    background: SavedGaussians<'a>,
    candidate: SavedGaussians<'a>,
    /// Ratio and σ.
    shadow: Option<(SavedPlane<'a, f32>, SavedPlane<'a, f32>)>,
    carry: Packed<'a, [f32; 2]>,
    transform: [f64; 9],
    field: Packed<'a, [f32; 2]>,
    foreground: SavedPlane<'a, u8>,
    age: SavedPlane<'a, u8>,
    yaw_rad: Option<f64>,
    failures: u32,
    training: Option<Vec<SavedPlane<'a, u8>>>,
}

#[derive(Serialize, Deserialize, Schema)]
struct SavedGaussians<'a> {
    mean: SavedPlane<'a, f32>,
    variance: SavedPlane<'a, f32>,
    count: SavedPlane<'a, u8>,
}

/// The values of a plane; its size follows from that of the pictures.
type SavedPlane<'a, T> = Packed<'a, T>;

impl State {
    /// The state as bytes.
    #[must_use]
    pub fn save(&self) -> Vec<u8> {
        self.save_to(Vec::new())
    }

    /// The bytes with the state behind them.
    #[must_use]
    pub fn save_to(&self, bytes: Vec<u8>) -> Vec<u8> {
        let scene = self.scene.as_ref().map(|(working, scene)| SavedScene::new(working, scene));
        encode(&SavedState { last_stamp_ns: self.last_stamp_ns, scene }, bytes)
    }

    /// The state of bytes that [`State::save`] made, under the same parameters.
    ///
    /// # Errors
    /// [`CheckpointError`]: the bytes are not a state of this version, intact and valid.
    pub fn restore(parameters: Parameters, bytes: &[u8]) -> Result<Self, CheckpointError> {
        let saved: SavedState<'_> = decode(bytes)?;
        let scene = saved.scene.map(SavedScene::restore).transpose()?;
        Ok(Self { parameters, last_stamp_ns: saved.last_stamp_ns, scene })
    }
}

impl<'a> SavedScene<'a> {
    fn new(working: &Working, scene: &'a Scene) -> Self {
        let Model { background, candidate, shadow } = &scene.model;
        Self {
            width: working.width as u32,
            height: working.height as u32,
            base: plane(&scene.pyramid.base().image),
            background: SavedGaussians::new(background),
            candidate: SavedGaussians::new(candidate),
            shadow: shadow.as_ref().map(|shadow| (plane(&shadow.ratio), plane(&shadow.sigma))),
            carry: Packed::from(scene.carry.cells()),
            transform: scene.motion.transform.rows(),
            field: Packed::from(scene.motion.field.cells()),
            foreground: plane(&scene.foreground),
            age: plane(&scene.age),
            yaw_rad: scene.yaw_rad,
            failures: scene.failures,
            training: scene.training.as_ref().map(|training| training.frames.iter().map(plane).collect()),
        }
    }

    fn restore(self) -> Result<(Working, Scene), CheckpointError> {
        if !(WIDTH_RANGE.0..=WIDTH_RANGE.1).contains(&self.width) || !(HEIGHT_RANGE.0..=HEIGHT_RANGE.1).contains(&self.height) {
            return Err(CheckpointError::Value { what: "the size of the pictures" });
        }
        let working = Working::new(self.width as usize, self.height as usize);
        let size = working.size();
        let (width, height) = size;
        let base_size = base_size(width, height);
        let base = numbers(self.base, base_size)?;
        let (background, candidate) = (self.background.restore(size)?, self.candidate.restore(size)?);
        let shadow = match self.shadow {
            Some((ratio, sigma)) => Some(LearnedShadow { ratio: numbers(ratio, size)?, sigma: numbers(sigma, size)? }),
            None => None,
        };
        let still = still_field(base_size.0, base_size.1);
        let carry = field(self.carry, &still)?;
        let transform = Transform::new(self.transform).ok_or(CheckpointError::Value { what: "the transform" })?;
        let motion = Motion { transform, field: field(self.field, &still)? };
        let (foreground, age) = (values(self.foreground, size)?, values(self.age, size)?);
        if self.yaw_rad.is_some_and(|yaw| !yaw.is_finite()) {
            return Err(CheckpointError::Value { what: "the heading" });
        }
        let training = self.training.map(|frames| training(frames, size)).transpose()?;
        let mut pyramid = Pyramid::default();
        pyramid.rebuild(base);
        let model = Model { background, candidate, shadow };
        let (reused, spare_pyramid) = (Model::default(), Pyramid::default());
        let (yaw_rad, failures) = (self.yaw_rad, self.failures);
        Ok((
            working,
            Scene { width, height, pyramid, model, reused, spare_pyramid, carry, motion, foreground, age, yaw_rad, failures, training },
        ))
    }
}

impl<'a> SavedGaussians<'a> {
    fn new(gaussians: &'a Gaussians) -> Self {
        Self { mean: plane(&gaussians.mean), variance: plane(&gaussians.variance), count: plane(&gaussians.count) }
    }

    fn restore(self, size: (usize, usize)) -> Result<Gaussians, CheckpointError> {
        Ok(Gaussians { mean: numbers(self.mean, size)?, variance: numbers(self.variance, size)?, count: values(self.count, size)? })
    }
}

fn plane<T: Copy>(plane: &Plane<T>) -> SavedPlane<'_, T> {
    Packed::from(plane.values())
}

fn values<T: Copy>(saved: SavedPlane<'_, T>, (width, height): (usize, usize)) -> Result<Plane<T>, CheckpointError> {
    Plane::from_values(width, height, saved.into_vec()).ok_or(CheckpointError::Value { what: "the size of a plane" })
}

fn numbers(saved: SavedPlane<'_, f32>, size: (usize, usize)) -> Result<Plane<f32>, CheckpointError> {
    let plane = values(saved, size)?;
    if plane.values().iter().all(|value| value.is_finite()) { Ok(plane) } else { Err(CheckpointError::Value { what: "a number" }) }
}

fn field(saved: Packed<'_, [f32; 2]>, shape: &Field) -> Result<Field, CheckpointError> {
    let (mut field, cells) = (shape.clone(), saved.into_vec());
    if cells.len() != shape.cells().len() {
        return Err(CheckpointError::Value { what: "the size of a field" });
    }
    if !cells.as_flattened().iter().all(|value| value.is_finite()) {
        return Err(CheckpointError::Value { what: "a displacement" });
    }
    field.cells_mut().copy_from_slice(&cells);
    Ok(field)
}

fn training(frames: Vec<SavedPlane<'_, u8>>, size: (usize, usize)) -> Result<Training, CheckpointError> {
    if frames.len() > TRAINING_MAX {
        return Err(CheckpointError::Value { what: "the number of training frames" });
    }
    Ok(Training { frames: frames.into_iter().map(|frame| values(frame, size)).collect::<Result<_, _>>()? })
}
