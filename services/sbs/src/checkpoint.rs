//! The state as bytes, to go on after a restart as if nothing had happened.
//!
//! Little-endian, in the order of [`State`]'s fields, behind a magic word and a version. A picture is its width, its height and
//! its values. Whatever can be computed from the rest is left out. Reading never panics and never makes more of a length than
//! the bytes that are there.

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

const MAGIC: [u8; 4] = *b"SBSs";
/// Version of the layout that is written and the only one that is read.
pub const CHECKPOINT_VERSION: u32 = 1;
/// No more frames of training than this are believed.
const TRAINING_MAX: u32 = 1024;

/// Why bytes are no state.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CheckpointError {
    /// They do not start with the magic word.
    #[error("no state of SBS")]
    Magic,
    /// They are of another version.
    #[error("version {found} of the state, expected {CHECKPOINT_VERSION}")]
    Version {
        /// Version found.
        found: u32,
    },
    /// They end too early.
    #[error("at byte {offset}: {needed} more bytes expected, {found} found")]
    Short {
        /// Where the value starts.
        offset: usize,
        /// Bytes of the value.
        needed: usize,
        /// Bytes that are there.
        found: usize,
    },
    /// A value cannot be.
    #[error("at byte {offset}: {what} cannot be")]
    Value {
        /// Behind the value.
        offset: usize,
        /// What it is.
        what: &'static str,
    },
    /// Bytes are left over.
    #[error("at byte {offset}: {left} bytes are left over")]
    Long {
        /// Where they start.
        offset: usize,
        /// How many.
        left: usize,
    },
}

impl State {
    /// The state as bytes.
    #[must_use]
    pub fn save(&self) -> Vec<u8> {
        let mut out = Vec::new();
        self.write_to(&mut out);
        out
    }

    /// Appends the state as bytes.
    pub fn write_to(&self, out: &mut Vec<u8>) {
        out.extend(MAGIC);
        out.extend(CHECKPOINT_VERSION.to_le_bytes());
        option(out, self.last_stamp_ns.map(u64::to_le_bytes));
        out.push(u8::from(self.scene.is_some()));
        if let Some((working, scene)) = &self.scene {
            out.extend((working.width as u32).to_le_bytes());
            out.extend((working.height as u32).to_le_bytes());
            write_scene(out, scene);
        }
    }

    /// The state of bytes that [`State::save`] made, under the same parameters.
    ///
    /// # Errors
    /// [`CheckpointError`]: the bytes are not a state of this version, whole and possible.
    pub fn restore(parameters: Parameters, bytes: &[u8]) -> Result<Self, CheckpointError> {
        let mut input = Input { bytes, offset: 0 };
        if input.array::<4>() != Ok(MAGIC) {
            return Err(CheckpointError::Magic);
        }
        match input.u32()? {
            CHECKPOINT_VERSION => {}
            found => return Err(CheckpointError::Version { found }),
        }
        let last_stamp_ns = if input.flag()? { Some(u64::from_le_bytes(input.array()?)) } else { None };
        let scene = if input.flag()? { Some(read_scene(&mut input)?) } else { None };
        match bytes.len() - input.offset {
            0 => Ok(Self { parameters, last_stamp_ns, scene }),
            left => Err(CheckpointError::Long { offset: input.offset, left }),
        }
    }
}

fn write_scene(out: &mut Vec<u8>, scene: &Scene) {
    numbers(out, &scene.pyramid.base().image);
    gaussians(out, &scene.model.background);
    gaussians(out, &scene.model.candidate);
    out.push(u8::from(scene.model.shadow.is_some()));
    if let Some(shadow) = &scene.model.shadow {
        numbers(out, &shadow.ratio);
        numbers(out, &shadow.sigma);
    }
    cells(out, &scene.carry);
    out.extend(scene.motion.transform.rows().iter().flat_map(|m| m.to_le_bytes()));
    cells(out, &scene.motion.field);
    bytes_of(out, &scene.foreground);
    bytes_of(out, &scene.age);
    option(out, scene.yaw_rad.map(f64::to_le_bytes));
    out.extend(scene.failures.to_le_bytes());
    out.push(u8::from(scene.training.is_some()));
    if let Some(training) = &scene.training {
        out.extend((training.frames.len() as u32).to_le_bytes());
        for frame in &training.frames {
            bytes_of(out, frame);
        }
    }
}

fn read_scene(input: &mut Input<'_>) -> Result<(Working, Scene), CheckpointError> {
    let (width, height) = (input.u32()?, input.u32()?);
    if !(WIDTH_RANGE.0..=WIDTH_RANGE.1).contains(&width) || !(HEIGHT_RANGE.0..=HEIGHT_RANGE.1).contains(&height) {
        return Err(input.refused("size of the picture"));
    }
    let working = Working::new(width as usize, height as usize);
    let (width, height) = working.size();
    let (base_width, base_height) = base_size(width, height);
    let base = input.numbers(base_width, base_height)?;
    let (background, candidate) = (input.gaussians(width, height)?, input.gaussians(width, height)?);
    let shadow = if input.flag()? {
        Some(LearnedShadow { ratio: input.numbers(width, height)?, sigma: input.numbers(width, height)? })
    } else {
        None
    };
    let still = still_field(base_width, base_height);
    let carry = input.field(&still)?;
    let mut rows = [0.0; 9];
    for m in &mut rows {
        *m = f64::from_le_bytes(input.array()?);
    }
    let transform = Transform::new(rows).ok_or_else(|| input.refused("the transform"))?;
    let motion = Motion { transform, field: input.field(&still)? };
    let (foreground, age) = (input.bytes_of(width, height)?, input.bytes_of(width, height)?);
    let yaw_rad = if input.flag()? { Some(f64::from_le_bytes(input.array()?)) } else { None };
    if yaw_rad.is_some_and(|yaw| !yaw.is_finite()) {
        return Err(input.refused("the heading"));
    }
    let failures = input.u32()?;
    let training = if input.flag()? { Some(input.training(width, height)?) } else { None };
    let mut pyramid = Pyramid::default();
    pyramid.rebuild(base);
    let model = Model { background, candidate, shadow };
    let (spare, spare_pyramid) = (Model::default(), Pyramid::default());
    Ok((
        working,
        Scene { width, height, pyramid, model, spare, spare_pyramid, carry, motion, foreground, age, yaw_rad, failures, training },
    ))
}

fn option<const N: usize>(out: &mut Vec<u8>, value: Option<[u8; N]>) {
    out.push(u8::from(value.is_some()));
    out.extend(value.into_iter().flatten());
}

fn size<T: Copy>(out: &mut Vec<u8>, plane: &Plane<T>) {
    out.extend((plane.width() as u32).to_le_bytes());
    out.extend((plane.height() as u32).to_le_bytes());
}

fn numbers(out: &mut Vec<u8>, plane: &Plane<f32>) {
    size(out, plane);
    out.extend(plane.values().iter().flat_map(|z| z.to_le_bytes()));
}

fn bytes_of(out: &mut Vec<u8>, plane: &Plane<u8>) {
    size(out, plane);
    out.extend(plane.values());
}

fn gaussians(out: &mut Vec<u8>, gaussians: &Gaussians) {
    numbers(out, &gaussians.mean);
    numbers(out, &gaussians.variance);
    bytes_of(out, &gaussians.count);
}

fn cells(out: &mut Vec<u8>, field: &Field) {
    out.extend(field.cells().iter().flatten().flat_map(|d| d.to_le_bytes()));
}

/// Bytes that are read from the front.
struct Input<'a> {
    bytes: &'a [u8],
    offset: usize,
}

impl Input<'_> {
    fn take(&mut self, needed: usize) -> Result<&[u8], CheckpointError> {
        let rest = self.bytes.get(self.offset..).unwrap_or(&[]);
        let found = rest.get(..needed).ok_or(CheckpointError::Short { offset: self.offset, needed, found: rest.len() })?;
        self.offset += needed;
        Ok(found)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], CheckpointError> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }

    fn u32(&mut self) -> Result<u32, CheckpointError> {
        self.array().map(u32::from_le_bytes)
    }

    fn flag(&mut self) -> Result<bool, CheckpointError> {
        match self.array()? {
            [0] => Ok(false),
            [1] => Ok(true),
            _ => Err(self.refused("a flag other than 0 and 1")),
        }
    }

    fn refused(&self, what: &'static str) -> CheckpointError {
        CheckpointError::Value { offset: self.offset, what }
    }

    fn floats(&mut self, count: usize) -> Result<Vec<f32>, CheckpointError> {
        let bytes = self.take(4 * count)?;
        let values: Vec<f32> = bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        if values.iter().all(|z| z.is_finite()) { Ok(values) } else { Err(self.refused("a number that is none")) }
    }

    fn size(&mut self, width: usize, height: usize) -> Result<(), CheckpointError> {
        let found = (self.u32()? as usize, self.u32()? as usize);
        if found == (width, height) { Ok(()) } else { Err(self.refused("size of a plane")) }
    }

    fn numbers(&mut self, width: usize, height: usize) -> Result<Plane<f32>, CheckpointError> {
        self.size(width, height)?;
        let values = self.floats(width * height)?;
        Plane::from_values(width, height, values).ok_or_else(|| self.refused("size of a plane"))
    }

    fn bytes_of(&mut self, width: usize, height: usize) -> Result<Plane<u8>, CheckpointError> {
        self.size(width, height)?;
        let values = self.take(width * height)?.to_vec();
        Plane::from_values(width, height, values).ok_or_else(|| self.refused("size of a plane"))
    }

    fn gaussians(&mut self, width: usize, height: usize) -> Result<Gaussians, CheckpointError> {
        Ok(Gaussians { mean: self.numbers(width, height)?, variance: self.numbers(width, height)?, count: self.bytes_of(width, height)? })
    }

    fn field(&mut self, shape: &Field) -> Result<Field, CheckpointError> {
        let mut field = shape.clone();
        let values = self.floats(2 * shape.cells().len())?;
        for (cell, d) in field.cells_mut().iter_mut().zip(values.chunks_exact(2)) {
            *cell = [d[0], d[1]];
        }
        Ok(field)
    }

    fn training(&mut self, width: usize, height: usize) -> Result<Training, CheckpointError> {
        let count = self.u32()?;
        if count > TRAINING_MAX {
            return Err(self.refused("number of training frames"));
        }
        let frames = (0..count).map(|_| self.bytes_of(width, height)).collect::<Result<_, _>>()?;
        Ok(Training { frames })
    }
}
