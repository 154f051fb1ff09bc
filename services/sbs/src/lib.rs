//! Statistical background subtraction on a moving camera (SBS): what moves in the picture of a camera that moves itself.
//!
//! Section 5 of the paper. The service is a fold: [`State::step`] takes a frame and gives its answer, a
//! [`messages::CameraMotion`]; it opens no file, clock or thread. One frame goes this way (`scene`):
//!
//! 1. motion compensation: T, from the current frame to the background frame (`compensation`: `direct`, or `icp`, the paper's
//!    way), and the [`field`] of what T cannot explain, parallax above all (`local`);
//! 2. the model is carried into the current frame (`resample`, `model`) and takes the frame's brightness;
//! 3. every pixel is compared with its background Gaussian, or those of its region in the alignment Gaussian model
//!    ([`alignment`], eqs. 5–10), and updates it or its candidate ([`background`], Table 2);
//! 4. shadow is dropped (`shadow`, S of eq. 4), the mask cleaned (`morphology`), and what passes the tests is a blob (`blobs`).
//!
//! While the robot stands still at the start, the pixels' mixtures are learned by EM ([`mixture`], eq. 4; `learning`).
//!
//! Terms: *base picture*: the smoothed picture, at most 320 wide, that motion is estimated in. *Carry*: the displacement from the
//! last frame to the model that has not been worth a resampling yet. Pictures from 320 wide on are worked on at half size
//! (`working`); all that goes out is in the camera's pixels.
//!
//! What takes most of the time is compiled for two vector units and chosen when it runs; both give the same bytes (`vectorised`).
//!
//! [`y4m`] and [`score`] read sequences with truth and tell how good a mask is.
#![cfg_attr(test, allow(clippy::unwrap_used, reason = "tests fail by panicking"))]

mod agreement;
pub mod alignment;
pub mod background;
mod blobs;
mod checkpoint;
mod compensation;
pub mod components;
mod corners;
mod direct;
pub mod estimation;
pub mod field;
mod frames;
mod icp;
mod learning;
mod local;
pub mod mixture;
mod model;
mod morphology;
pub mod motion;
mod order;
mod parameters;
mod picture;
pub mod plane;
mod pyramid;
mod resample;
mod rounding;
mod samples;
mod scene;
pub mod score;
mod shadow;
mod state;
pub mod table2;
pub mod transform;
mod vectorised;
mod working;
pub mod y4m;

pub use blobs::BlobRule;
pub use checkpoint::CheckpointError;
pub use local::LocalRule;
pub use parameters::{Method, Parameters};
pub use picture::FrameError;
pub use shadow::ShadowRule;
pub use state::{Answer, Frame, Odometry, Remark, State};
