//! The two frames of motion compensation.

use crate::plane::Plane;
use crate::pyramid::Pyramid;

/// The frames between which motion is sought, both as base pyramids.
pub(crate) struct Frames<'a> {
    pub(crate) current: &'a Pyramid,
    pub(crate) previous: &'a Pyramid,
    /// Pixels that take no part.
    pub(crate) moving: &'a Plane<u8>,
    /// Brightness of the current frame over the previous one.
    pub(crate) gain: f32,
}
