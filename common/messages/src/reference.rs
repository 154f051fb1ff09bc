//! The wire contract as a page: every service and payload, from the registry and the layouts.

use core::convert::Infallible;
use core::fmt::Write as _;
use core::mem::offset_of;

use crate::numbered::Numbers;
use crate::range::{frame_layout_ranges, ranges};
use crate::{
    CameraStatus, EchoLabel, EstimateStatus, Field, FilterAction, FrameHeader, Header, Kind, Layer, Layout, LogLevel, Payload, Phase,
    Pictures, PixelFormat, ProcessState, Qos, Recorded, Replay, SERVICES, Service, ServiceVisitor, Shape, Trajectory, visit_services,
};

const HEAD: &str = include_str!("wire.md");

/// The enums that travel as numbers.
pub(crate) const NUMBERS: &[Numbers] = &[
    Kind::NUMBERS,
    PixelFormat::NUMBERS,
    CameraStatus::NUMBERS,
    FilterAction::NUMBERS,
    Layer::NUMBERS,
    Trajectory::NUMBERS,
    EstimateStatus::NUMBERS,
    Phase::NUMBERS,
    LogLevel::NUMBERS,
    ProcessState::NUMBERS,
    EchoLabel::NUMBERS,
];

/// The wire contract in Markdown: the rules for a driver, the services with their delivery, and every field of every payload with its place,
/// type, range and meaning. `docs/wire.md` is this text.
///
/// ```
/// let page = stillmap_messages::reference();
/// assert!(page.contains("| 48 | `readings[0].range_m` | f64 | 0 to 10 m |"));
/// ```
#[must_use]
pub fn reference() -> String {
    let mut page = Page { text: HEAD.to_owned() };
    page.services();
    page.text += "\n## Headers\n";
    page.table("Header", Header::SHAPE, &|_| None);
    let layout = frame_layout_ranges();
    let range = |offset: usize| layout.get(offset.checked_sub(offset_of!(FrameHeader, layout))? / size_of::<u32>()).copied()?;
    page.table("FrameHeader", FrameHeader::SHAPE, &range);
    page.text += "\n## Payloads\n";
    let Ok(()) = visit_services(&mut page);
    page.text += "\n## Numbers with a meaning\n";
    NUMBERS.iter().for_each(|numbers| page.numbers(numbers));
    page.text
}

struct Page {
    text: String,
}

impl Page {
    fn line(&mut self, words: core::fmt::Arguments<'_>) {
        // Writing into a string does not fail.
        let _ = self.text.write_fmt(words);
        self.text.push('\n');
    }

    fn services(&mut self) {
        self.text += "\n## Services\n\n| service | version | from | to |\n| --- | --- | --- | --- |\n";
        for Service { name, version, from, to, .. } in SERVICES {
            self.line(format_args!("| `{name}` | {version} | {} | {} |", listed(from), listed(to)));
        }
        self.text += "\nDelivery. *History*: messages that a late or restarted reader receives. *Buffer*: messages that wait for a slow reader. \
            *Window*, *checkpoint*, *reserve*: see below.\n\n\
            | service | history | buffer | senders | readers | numbered | wakes readers | window | checkpoint | reserve |\n\
            | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";
        for Service { name, qos, sequenced, wakes, replay, .. } in SERVICES {
            let Qos { history, buffer, publishers, subscribers } = qos;
            let replay = replay.map_or("– | – | –".to_owned(), |Replay { window, checkpoint, reserve, .. }| {
                format!("{window} | {checkpoint} | {reserve}")
            });
            let (sequenced, wakes) = (yes(*sequenced), yes(*wakes));
            self.line(format_args!(
                "| `{name}` | {history} | {buffer} | {publishers} | {subscribers} | {sequenced} | {wakes} | {replay} |"
            ));
        }
        self.text += "\n| service | recorded | played back | injectable | shown |\n| --- | --- | --- | --- | --- |\n";
        for Service { name, recorded, replay, injectable, shown, .. } in SERVICES {
            let recorded = match recorded {
                Recorded::No => "–",
                Recorded::AtStamp => "at its stamp",
                Recorded::AsReport => "where it arrives",
            };
            let (played, injectable, shown) = (yes(replay.is_some()), yes(*injectable), yes(*shown));
            self.line(format_args!("| `{name}` | {recorded} | {played} | {injectable} | {shown} |"));
        }
    }

    fn heading(&mut self, name: &str, service: &Service, size: usize) {
        self.line(format_args!("\n### `{}`: {name}, {size} bytes\n\n{}", service.name, plain(service.doc)));
    }

    /// The fields of a struct, with those of the structs within it. `range` tells the values that are accepted at an offset.
    fn table(&mut self, name: &str, shape: Shape, range: &dyn Fn(usize) -> Option<&'static str>) {
        if !name.is_empty() {
            self.line(format_args!("\n### {name}, {} bytes", shape.size()));
        }
        self.text += "\n| offset | field | type | range | meaning |\n| --- | --- | --- | --- | --- |\n";
        self.fields(shape.fields(), "", 0, range);
    }

    fn fields(&mut self, fields: &[Field], path: &str, at: usize, range: &dyn Fn(usize) -> Option<&'static str>) {
        for field in fields {
            let (offset, name) = (at + field.offset, format!("{path}{}", field.name));
            let is_number = !matches!(field.shape, Shape::Struct { .. } | Shape::Array(Shape::Struct { .. }, _) | Shape::Text(_));
            let values = if is_number { range(offset).unwrap_or("any") } else { "–" };
            self.line(format_args!("| {offset} | `{name}` | {} | {values} | {} |", type_of(&field.shape), plain(field.doc)));
            match field.shape {
                Shape::Struct { fields, .. } => self.fields(fields, &format!("{name}."), offset, range),
                Shape::Array(Shape::Struct { fields, .. }, _) => self.fields(fields, &format!("{name}[0]."), offset, range),
                _ => {}
            }
        }
    }

    fn numbers(&mut self, numbers: &Numbers) {
        self.line(format_args!("\n### {}\n\n| number | name | meaning |\n| --- | --- | --- |", numbers.name));
        for (number, name, meaning) in numbers.values {
            self.line(format_args!("| {number} | {name} | {} |", plain(meaning)));
        }
    }
}

impl ServiceVisitor for Page {
    type Error = Infallible;

    fn message<T: Payload>(&mut self) -> Result<(), Infallible> {
        let name = core::any::type_name::<T>().rsplit("::").next().unwrap_or_default();
        self.heading(name, &T::SERVICE, size_of::<T>());
        let ranges = ranges::<T>();
        self.table("", T::SHAPE, &|offset| ranges.get(&offset).copied());
        Ok(())
    }

    fn pictures<P: Pictures>(&mut self) -> Result<(), Infallible> {
        let name = core::any::type_name::<P>().rsplit("::").next().unwrap_or_default();
        self.heading(name, &P::SERVICE, P::MAX_BYTES);
        self.text += "\nAt most so many bytes of a picture, under a `FrameHeader`.\n";
        Ok(())
    }
}

fn listed(names: &[&str]) -> String {
    if names.is_empty() { "–".to_owned() } else { names.join(", ") }
}

fn yes(is: bool) -> &'static str {
    if is { "yes" } else { "–" }
}

/// Documentation without links of rustdoc, in one line.
pub(crate) fn plain(doc: &str) -> String {
    doc.replace("[`", "`").replace("`]", "`").replace('\n', " ").split_whitespace().collect::<Vec<_>>().join(" ")
}

fn type_of(shape: &Shape) -> String {
    match shape {
        Shape::U8 => "u8".to_owned(),
        Shape::U32 => "u32".to_owned(),
        Shape::U64 => "u64".to_owned(),
        Shape::I32 => "i32".to_owned(),
        Shape::F32 => "f32".to_owned(),
        Shape::F64 => "f64".to_owned(),
        Shape::Text(bytes) => format!("text, {bytes} bytes"),
        Shape::Array(of @ Shape::Struct { .. }, count) => format!("{count} × {} bytes", of.size()),
        Shape::Array(of, count) => format!("{count} × {}", type_of(of)),
        Shape::Struct { size, .. } => format!("{size} bytes"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn the_page_of_the_wire_contract_is_current() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/wire.md");
        let found = std::fs::read_to_string(&path).unwrap_or_default();
        assert!(found == reference(), "docs/wire.md is out of date; renew it: cargo run -- check --wire > docs/wire.md");
    }

    #[test]
    fn every_number_with_a_meaning_is_explained() {
        let page = reference();
        let named = page.split("` as a number").filter_map(|before| before.rsplit_once('`')).map(|(_, name)| name);
        for name in named.filter(|name| name.chars().all(char::is_alphanumeric)) {
            assert!(name.is_empty() || page.contains(&format!("\n### {name}\n")), "{name}");
        }
    }
}
