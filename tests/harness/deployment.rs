//! Deployment files in the making.

use std::path::PathBuf;

use serde::Serialize;
use toml::{Table, Value};

use super::{Sandbox, worlds};

/// The settings of a deployment, to be changed key by key.
#[derive(Debug, Clone)]
pub(crate) struct Deployment(Table);

impl Deployment {
    /// A deployment of these built-in processes, each named after what it runs; its outputs are in `NAME-out`.
    pub(crate) fn new(name: &str, programs: &[&str]) -> Self {
        let empty = Self(Table::new()).set("name", name).set("out", format!("{name}-out"));
        programs.iter().fold(empty.set("process", [(); 0]), |deployment, program| deployment.with(program))
    }

    /// The deployment of `stillmap demo`, of which the outputs are in `demo-out`.
    pub(crate) fn demo() -> Self {
        let demo = Self(toml::from_str(include_str!("../../config/demo.toml")).unwrap());
        demo.set("out", "demo-out").set("simulator.world", worlds::path("hall"))
    }

    /// The demo in this world, with the sonars alone and with patience: a busy machine changes nothing then, since no picture is skipped
    /// and no deadline passes.
    pub(crate) fn sonar_only(world: impl Serialize) -> Self {
        let demo = Self::demo().without("sbs").without("viewer").set("simulator.world", world);
        demo.set("simulator.camera.provides", "off").set("fti.patience_s", 10)
    }

    /// Sets a key, of which the dots part the tables.
    pub(crate) fn set(mut self, key: &str, value: impl Serialize) -> Self {
        let (tables, last) = key.rsplit_once('.').unwrap_or(("", key));
        let parent = tables.split('.').filter(|name| !name.is_empty()).fold(&mut self.0, |table, name| {
            let inner = table.entry(name).or_insert_with(|| Value::Table(Table::new()));
            inner.as_table_mut().unwrap()
        });
        parent.insert(last.to_owned(), Value::try_from(value).unwrap());
        self
    }

    /// Adds a built-in process.
    pub(crate) fn with(self, program: &str) -> Self {
        self.push(
            "process",
            [("name", program), ("run", program)].map(|(key, value)| (key.to_owned(), Value::from(value))).into_iter().collect(),
        )
    }

    /// Adds a driver that is a program of its own, with which the run ends.
    pub(crate) fn with_driver(self, command: impl Serialize) -> Self {
        let driver = [("name", Value::from("driver")), ("ends_run", true.into()), ("command", Value::try_from(command).unwrap())];
        self.push("process", driver.map(|(key, value)| (key.to_owned(), value)).into_iter().collect())
    }

    /// Adds a `[[fault]]`.
    pub(crate) fn fault(self, fault: Table) -> Self {
        self.push("fault", fault)
    }

    fn push(mut self, list: &str, entry: Table) -> Self {
        let entries = self.0.entry(list).or_insert_with(|| Value::Array(Vec::new()));
        entries.as_array_mut().unwrap().push(Value::Table(entry));
        self
    }

    /// Takes out a process and the section of its name, which nothing reads without it.
    pub(crate) fn without(mut self, name: &str) -> Self {
        let processes = self.0["process"].as_array_mut().unwrap();
        let count = processes.len();
        processes.retain(|process| process["name"].as_str() != Some(name));
        assert_eq!(processes.len() + 1, count, "one process is named {name}");
        self.0.remove(name);
        self
    }

    /// With a supervisor that takes no process for hung, however slow the machine is.
    pub(crate) fn patient(self) -> Self {
        let keys = ["startup_deadline_s", "heartbeat_timeout_s", "stop_deadline_s"];
        keys.iter().fold(self, |deployment, key| deployment.set(&format!("supervisor.{key}"), 60))
    }

    /// With a supervisor that restarts without delay as often as needed.
    pub(crate) fn tireless(self) -> Self {
        let fast = self.set("supervisor.backoff_first_s", 0.001).set("supervisor.backoff_last_s", 0.01);
        fast.set("supervisor.restarts", 1000).set("supervisor.within_s", 1)
    }

    pub(crate) fn name(&self) -> &str {
        self.0["name"].as_str().unwrap()
    }

    pub(crate) fn to_toml(&self) -> String {
        toml::to_string(&self.0).unwrap()
    }

    /// Writes the file into the sandbox.
    pub(crate) fn write(&self, sandbox: &Sandbox) -> PathBuf {
        sandbox.write(&format!("{}.toml", self.name()), &self.to_toml())
    }
}
