//! TOML files into types. An error is one line: file, line, key, the value found and the value expected.
//!
//! | item | does |
//! | --- | --- |
//! | [`read_text`] | reads a file as text, up to [`MAX_BYTES`] |
//! | [`parse()`], [`parse_checked`] | deserialize a text into a type, and check relations between its values |
//! | [`bounded!`], [`one_of!`] | declare numbers that cannot leave their limits |
//!
//! ```
//! # use stillmap_document as document;
//! use serde::Deserialize;
//!
//! document::bounded! {
//!     /// Width of a door.
//!     DoorWidth: f64 in 0.5..=3.0, "m", default 0.9;
//! }
//!
//! #[derive(Debug, Deserialize)]
//! #[serde(deny_unknown_fields)]
//! struct Door {
//!     #[serde(default)]
//!     width_m: DoorWidth,
//! }
//!
//! let door: Door = document::parse("door.toml", "")?;
//! assert_eq!(door.width_m.get(), 0.9);
//!
//! let error = document::parse::<Door>("door.toml", "width_m = 0.2").unwrap_err();
//! assert_eq!(error.to_string(), "door.toml:1: width_m = 0.2: expected 0.5 to 3 m");
//! # Ok::<(), document::DocumentError>(())
//! ```

mod bounded;
mod error;
mod located;
mod parse;

#[doc(hidden)]
pub use bounded::deserialize_bounded;
pub use bounded::{Bounded, Number, OutOfRange};
pub use error::{DocumentError, Fault};
pub use parse::{MAX_BYTES, parse, parse_checked, read_text};
