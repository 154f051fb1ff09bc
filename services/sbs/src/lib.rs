//! Statistical background subtraction on a moving camera (SBS).

mod agreement;
pub mod alignment;
pub mod background;
mod blobs;
mod compensation;
pub mod components;
mod corners;
mod direct;
pub mod estimation;
pub mod field;
mod icp;
mod learning;
mod local;
pub mod mixture;
mod model;
mod morphology;
pub mod motion;
mod order;
mod picture;
pub mod plane;
mod pyramid;
mod resample;
mod samples;
pub mod score;
mod settings;
mod shadow;
mod step;
pub mod table2;
pub mod transform;
pub mod y4m;

pub use blobs::BlobRule;
pub use local::LocalRule;
pub use picture::Refusal;
pub use settings::{Method, Settings};
pub use shadow::ShadowRule;
pub use step::{Answer, Frame, Odometry, Remark, State};
