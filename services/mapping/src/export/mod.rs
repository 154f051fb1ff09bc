//! The map as files: for ROS and nav2, and as a picture for people. Contents are made here; writing them is the shell's.

mod canvas;
mod comparison;
mod copy;
mod extent;
mod font;
mod picture;
mod rectangle;
mod ros;

pub use copy::{LeftOut, MapCopy, MapFiles};
pub use rectangle::RectangleError;

/// A map that cannot be made into files.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// It does not fit one picture.
    #[error(transparent)]
    Rectangle(#[from] RectangleError),
    /// The encoder of pictures failed.
    #[error("cannot encode {file}: {source}")]
    Encode {
        /// The picture.
        file: &'static str,
        /// What the encoder says.
        source: image::ImageError,
    },
}

/// A file by its name and contents.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MapFile {
    /// Its name.
    pub name: &'static str,
    /// What is in it.
    pub contents: Vec<u8>,
}
