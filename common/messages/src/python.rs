//! The wire contract as a Python module: every payload as a structure of `ctypes`, from the registry and the layouts.

use core::convert::Infallible;
use core::fmt::Write as _;
use std::collections::BTreeSet;

use crate::numbered::Numbers;
use crate::reference::{NUMBERS, plain};
use crate::{Field, FrameHeader, Header, Layout, Payload, Pictures, Service, ServiceVisitor, Shape, visit_services};

const HEAD: &str = r#""""The wire contract of stillmap: every payload on the bus as a structure of ctypes.

Generated from the registry: stillmap check --python > examples/stillmap_wire.py
docs/wire.md has the rules and the ranges of all fields.
"""

import ctypes
"#;

/// The wire contract as a Python module; `examples/stillmap_wire.py` is this text. A structure of a service has its name, its contract and
/// its delivery as attributes; enums are classes of constants.
///
/// ```
/// let module = stillmap_messages::python_module();
/// assert!(module.contains("class SonarScan(ctypes.Structure):"));
/// ```
#[must_use]
pub fn python_module() -> String {
    let mut module = Module { text: HEAD.to_owned(), written: BTreeSet::new() };
    NUMBERS.iter().for_each(|numbers| module.numbers(numbers));
    module.structure(&Header::SHAPE, "", None, "stillmap/header");
    module.structure(&FrameHeader::SHAPE, "", None, "stillmap/frame-header");
    let Ok(()) = visit_services(&mut module);
    module.text
}

struct Module {
    text: String,
    /// Names of the structures.
    written: BTreeSet<&'static str>,
}

impl Module {
    fn line(&mut self, words: core::fmt::Arguments<'_>) {
        // Writing into a string does not fail.
        let _ = self.text.write_fmt(words);
        self.text.push('\n');
    }

    fn numbers(&mut self, numbers: &Numbers) {
        self.line(format_args!("\n\nclass {}:", numbers.name));
        for (number, name, meaning) in numbers.values {
            self.line(format_args!("    {} = {number}  # {}", constant(name), plain(meaning)));
        }
    }

    /// A structure, after those that it contains.
    fn structure(&mut self, shape: &Shape, doc: &str, service: Option<(&Service, u64)>, type_name: &str) {
        let Shape::Struct { name, fields, size } = shape else { return };
        if self.written.contains(name) {
            return;
        }
        for field in *fields {
            self.structure(innermost(&field.shape), "", None, "");
        }
        self.written.insert(name);
        self.line(format_args!("\n\nclass {name}(ctypes.Structure):"));
        if !doc.is_empty() {
            self.line(format_args!("    \"\"\"{}\"\"\"\n", plain(doc)));
        }
        if let Some((service, hash)) = service {
            self.attributes(service, hash);
        }
        self.text += "    _fields_ = [\n";
        for Field { name, doc, shape, .. } in *fields {
            self.line(format_args!("        (\"{name}\", {}),  # {}", type_of(shape), plain(doc)));
        }
        self.text += "    ]\n";
        if !type_name.is_empty() {
            self.line(format_args!("\n    @staticmethod\n    def type_name():\n        return \"{type_name}\""));
        }
        self.line(format_args!("\n\nassert ctypes.sizeof({name}) == {size}"));
    }

    /// What a program needs to open a service.
    fn attributes(&mut self, service: &Service, hash: u64) {
        self.line(format_args!("    SERVICE = \"{}\"", service.name));
        self.line(format_args!("    CONTRACT = \"{}\"", service.contract(hash)));
        self.line(format_args!("    NUMBERED = {}", truth(service.sequenced)));
        self.line(format_args!("    WAKES = {}", truth(service.wakes)));
    }
}

impl ServiceVisitor for Module {
    type Error = Infallible;

    fn message<T: Payload>(&mut self) -> Result<(), Infallible> {
        self.structure(&T::SHAPE, T::SERVICE.doc, Some((&T::SERVICE, T::HASH)), T::SERVICE.name);
        Ok(())
    }

    fn pictures<P: Pictures>(&mut self) -> Result<(), Infallible> {
        let name = core::any::type_name::<P>().rsplit("::").next().unwrap_or_default();
        self.line(format_args!(
            "\n\nclass {name}:\n    \"\"\"{} The bytes of a picture under a FrameHeader.\"\"\"\n",
            plain(P::SERVICE.doc)
        ));
        self.attributes(&P::SERVICE, FrameHeader::HASH);
        self.line(format_args!("    MAX_BYTES = {}", P::MAX_BYTES));
        Ok(())
    }
}

/// What an array consists of.
fn innermost(shape: &Shape) -> &Shape {
    match shape {
        Shape::Array(entry, _) => innermost(entry),
        other => other,
    }
}

fn type_of(shape: &Shape) -> String {
    match shape {
        Shape::U8 => "ctypes.c_uint8".to_owned(),
        Shape::U32 => "ctypes.c_uint32".to_owned(),
        Shape::U64 => "ctypes.c_uint64".to_owned(),
        Shape::I32 => "ctypes.c_int32".to_owned(),
        Shape::F32 => "ctypes.c_float".to_owned(),
        Shape::F64 => "ctypes.c_double".to_owned(),
        Shape::Text(bytes) => format!("ctypes.c_char * {bytes}"),
        Shape::Array(entry @ Shape::Array(..), count) => format!("({}) * {count}", type_of(entry)),
        Shape::Array(entry, count) => format!("{} * {count}", type_of(entry)),
        Shape::Struct { name, .. } => (*name).to_owned(),
    }
}

fn truth(is: bool) -> &'static str {
    if is { "True" } else { "False" }
}

/// A name of an enum's value as that of a constant.
fn constant(name: &str) -> String {
    let mut constant = String::new();
    for (at, letter) in name.char_indices() {
        if at > 0 && letter.is_uppercase() {
            constant.push('_');
        }
        constant.extend(letter.to_uppercase());
    }
    constant
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn the_python_module_of_the_wire_contract_is_current() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/stillmap_wire.py");
        let found = std::fs::read_to_string(&path).unwrap_or_default();
        assert!(
            found == python_module(),
            "examples/stillmap_wire.py is out of date: cargo run -- check --python > examples/stillmap_wire.py"
        );
    }

    #[test]
    fn names_of_values_become_constants() {
        assert_eq!(constant("NoEcho"), "NO_ECHO");
    }
}
