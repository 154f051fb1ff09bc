//! Why a message of a log cannot be decoded.

use messages::Invalid;

/// Bytes in a log that are not the message they should be.
#[derive(Debug, thiserror::Error)]
pub enum DecodeError {
    /// Not the JSON of this message.
    #[error("the message cannot be read: {0}")]
    Json(#[from] serde_json::Error),
    /// Not a protobuf message.
    #[error("the message cannot be read: {0}")]
    Protobuf(#[from] prost::DecodeError),
    /// A grid that is no tile of a map.
    #[error("the grid is no tile: {what} is {found}, expected {expected}")]
    NoTile {
        /// What is wrong with it.
        what: &'static str,
        /// Its value.
        found: f64,
        /// What it should be.
        expected: f64,
    },
    /// A picture in an encoding that is not recorded.
    #[error("the picture's encoding is {0:?}, expected mono8, yuyv or rgb8")]
    Encoding(String),
    /// A message of a numbered stream without its number.
    #[error("its sequence number is missing, expected 1 or more{0}")]
    Unnumbered(&'static str),
    /// Invalid numbers.
    #[error(transparent)]
    Invalid(#[from] Invalid),
}
