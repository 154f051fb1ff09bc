//! The registry names the senders and readers of each service: compared with the ports that the wiring of each process declares.

use core::convert::Infallible;
use messages::{Payload, Pictures, Recorded, Service, ServiceVisitor, visit_services};
use settings::BuiltIn;
use std::fs;
use std::path::{Path, PathBuf};

const SOURCES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/src/process");

/// The source of a process without its tests.
fn source(kind: BuiltIn) -> String {
    let folder = Path::new(SOURCES).join(kind.word());
    let files: Vec<PathBuf> = match fs::read_dir(&folder) {
        Ok(entries) => entries.map(|entry| entry.expect("readable").path()).collect(),
        Err(_) => vec![folder.with_extension("rs")],
    };
    let text = files.iter().map(|file| fs::read_to_string(file).expect("a source"));
    text.map(|text| text.split("#[cfg(test)]").next().unwrap_or_default().to_owned()).collect()
}

struct Wiring(Vec<(BuiltIn, String)>);

impl Wiring {
    /// Checks a service whose type has this path.
    fn check(&self, service: &Service, path: &str) {
        let name = path.rsplit("::").next().unwrap_or_default();
        let with = |ports: &[&str]| {
            let declared: Vec<String> = ports.iter().map(|port| format!("{port}<{name}>")).collect();
            let declares = move |source: &str| declared.iter().any(|port| source.contains(port));
            self.0.iter().filter(move |(_, source)| declares(source)).map(|(kind, _)| kind.word())
        };
        let mut from: Vec<&str> = with(&["Writer", "Answers"]).chain(service.replay.map(|_| "playback")).collect();
        let mut to: Vec<&str> = with(&["Reader"]).filter(|kind| *kind != "injector").collect();
        to.extend((service.recorded != Recorded::No).then_some("recorder"));
        to.extend(service.shown.then_some("viewer"));
        let declared = |names: &[&'static str]| {
            let mut names: Vec<&str> = names.iter().copied().filter(|name| BuiltIn::ALL.iter().any(|kind| kind.word() == *name)).collect();
            names.sort_unstable();
            names
        };
        from.sort_unstable();
        to.sort_unstable();
        assert_eq!((declared(service.from), declared(service.to)), (from, to), "{}: senders and readers", service.name);
    }
}

impl ServiceVisitor for Wiring {
    type Error = Infallible;

    fn message<T: Payload>(&mut self) -> Result<(), Infallible> {
        // The shell of every process sends and reads these.
        if !T::SERVICE.name.starts_with("health/") {
            self.check(&T::SERVICE, core::any::type_name::<T>());
        }
        Ok(())
    }

    fn pictures<P: Pictures>(&mut self) -> Result<(), Infallible> {
        self.check(&P::SERVICE, core::any::type_name::<P>());
        Ok(())
    }
}

#[test]
fn the_registry_names_the_senders_and_readers() {
    let mut wiring = Wiring(BuiltIn::ALL.map(|kind| (kind, source(kind))).into());
    let Ok(()) = visit_services(&mut wiring);
}
