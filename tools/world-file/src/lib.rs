//! World files of the simulator: TOML into a [`World`], and random worlds.
//!
//! The simulator itself reads no files, so that it is built without a parser.

#![cfg_attr(test, allow(clippy::unwrap_used, reason = "tests fail by panicking"))]

mod generate;

use std::path::Path;

use document::{DocumentError, Fault};
pub use generate::random_world;
use simulator::World;

/// Reads a world from TOML text; `file` is the name of the text in errors.
///
/// ```
/// let world = stillmap_world_file::parse("empty.toml", "robot = { start_m = [0, 0], way = [{ to_m = [1, 0] }] }")?;
/// assert_eq!(world.robot.path.len(), 1);
/// let error = stillmap_world_file::parse("empty.toml", "robot = { start_m = [0, 0] }").unwrap_err();
/// assert_eq!(error.to_string(), "empty.toml:1: robot.way: missing, expected this key");
/// # Ok::<(), document::DocumentError>(())
/// ```
///
/// # Errors
/// The first problem of the text, in one line with file, line, key, value and what was expected.
pub fn parse(file: &str, text: &str) -> Result<World, DocumentError> {
    document::parse_checked(file, text, |world: &World| world.check().map_err(|fault| Fault::new(fault.key, fault.expected)))
}

/// Reads a world's file.
///
/// # Errors
/// When the file cannot be read; otherwise as [`parse`].
pub fn read(path: &Path) -> Result<World, DocumentError> {
    parse(&path.display().to_string(), &document::read_text(path)?)
}
