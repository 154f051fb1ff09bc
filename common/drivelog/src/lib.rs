//! The log of a drive: MCAP files of what was on the bus, written, read, recovered and imported.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, reason = "tests fail by panicking"))]

mod carry;
mod chunk;
mod damage;
#[cfg(test)]
mod damage_tests;
mod decode_error;
mod deframer;
mod ending;
mod fields;
mod gaps;
mod head;
mod image;
mod info;
mod json;
mod line;
mod log;
mod logged;
mod mcap_reader;
mod merge;
mod message_reader;
mod numbers;
mod part;
mod parts;
mod preamble;
mod recording;
mod records;
mod recover;
mod robond;
mod select;
mod table_row;
mod tables;
mod tile;
mod views;
mod writer;

pub use damage::{Damage, Fault, LogError, WriteError};
pub use decode_error::DecodeError;
pub use ending::Ending;
pub use gaps::{Gaps, Missing};
pub use image::Image;
pub use info::{ChannelInfo, Info, info};
pub use log::{Entry, Log, Outcome, Part, Step};
pub use logged::{Format, LogVisitor, Logged, foxglove_format, to_json, visit_logged};
pub use mcap_reader::McapReader;
pub use merge::merge;
pub use message_reader::RawMessage;
pub use parts::{following_parts, part_path};
pub use preamble::Preamble;
pub use recording::{Recording, Scene};
pub use records::Channel;
pub use recover::{Recovered, recover};
pub use robond::{Imported, import_robond};
pub use select::{Selection, select};
pub use tables::{Table, Tables, export_csv};
pub use tile::timestamp;
pub use views::{MapView, PoseView};
