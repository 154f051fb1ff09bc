//! `[injector]` and `[[fault]]`: faults on purpose, for tests and rehearsals.

use messages::SERVICES;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Error as _, Unexpected};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;

use crate::bounded::bounded;
use crate::text::Name;

bounded! {
    /// A share of messages or of time.
    FaultRate: f64 in 0.0..=1.0, "", default 1.0;
    /// A time from the start of a run or of a stream.
    FaultStart: f64 in 0.0..=86400.0, "s", default 0.0;
    /// How long a fault lasts.
    FaultLength: f64 in 0.0..=86400.0, "s", default 86400.0;
    /// A delay, or the time between two bursts or kills.
    FaultPeriod: f64 in 0.001..=3600.0, "s", default 1.0;
    /// Decides which messages a fault hits.
    FaultSeed: u32 in 0..=4294967295, "", default 1;
}

/// A service that can go through the injector: one that the registry of the bus declares injectable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct RoutedService(&'static str);

/// `[injector]`: the services between whose publishers and readers the injector stands.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Injector {
    /// Services that go through the injector, in addition to those of every `[[fault]]`. `stillmap inject` can disturb only these.
    pub services: Vec<RoutedService>,
}

/// What a fault does to the messages of a service.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StreamFault {
    /// Drops messages.
    Drop,
    /// Holds messages back for `by_s`; those behind them wait, too.
    Delay,
    /// Sends messages twice.
    Duplicate,
    /// Sends messages after the one that follows them.
    Reorder,
    /// Flips bits of the payload and leaves its checksum.
    Corrupt,
    /// Holds everything back until the fault is over.
    Stall,
    /// Holds everything back and lets it go at once every `by_s`.
    Burst,
    /// Puts stamps forward by `by_s`, as a clock that is set does; at the end of the fault it is set back.
    Clock,
}

/// What a fault does to a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProcessFault {
    /// Kills it (SIGKILL), again every `by_s` if that is given.
    Kill,
    /// Stops it (SIGSTOP), and resumes it at the end of the fault (SIGCONT).
    Stop,
    /// Stops it for a share of the time, its rate, many times a second.
    Slow,
    /// Lets no file of it grow, as a full disk does.
    Disk,
}

/// The target of a fault, and what it does.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Disturbance {
    /// The messages of a service.
    Service {
        /// Which.
        service: RoutedService,
        /// What happens to them.
        fault: StreamFault,
    },
    /// A process.
    Process {
        /// Its name in the deployment.
        process: Name,
        /// What happens to it.
        fault: ProcessFault,
    },
    /// Shared memory: all of it is taken.
    Memory,
}

/// `[[fault]]`: a fault on purpose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "Entry", into = "Entry")]
pub struct PlannedFault {
    /// Its target, and what it does.
    pub disturbance: Disturbance,
    /// The share of messages that it hits; for `slow`, the share of time.
    pub rate: FaultRate,
    /// When it begins.
    pub from_s: FaultStart,
    /// How long it lasts.
    pub for_s: FaultLength,
    /// By how much it delays, or how often it happens.
    pub by_s: Option<FaultPeriod>,
    /// Decides which messages it hits.
    pub seed: FaultSeed,
}

/// A fault as it is written.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct Entry {
    /// Service that is disturbed. Give exactly one of `service` and `process`, and neither for "memory".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    service: Option<RoutedService>,
    /// Name of the process that is disturbed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    process: Option<Name>,
    /// Kind of fault. A service takes drop, delay, duplicate, reorder, corrupt, stall, burst or clock. A process takes kill, stop, slow
    /// or disk. The fault "memory" takes the free part of `/dev/shm`, up to 1 GiB.
    kind: FaultKind,
    /// Share of the messages that are hit. For "slow", share of the time for which the process is stopped.
    #[serde(default)]
    rate: FaultRate,
    /// Start of the fault: sensor time since the first message of the service, or time since the start of the run.
    #[serde(default)]
    from_s: FaultStart,
    /// Duration of the fault.
    #[serde(default)]
    for_s: FaultLength,
    /// Delay of "delay", time by which "clock" is set forward, or period of "burst", 1 s by default. For "kill", period of the kills, by
    /// default none for a single kill.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    by_s: Option<FaultPeriod>,
    /// Seed that decides which messages are hit.
    #[serde(default)]
    seed: FaultSeed,
}

/// The kind of a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum FaultKind {
    /// Messages are dropped.
    Drop,
    /// Messages are delayed.
    Delay,
    /// Messages are duplicated.
    Duplicate,
    /// Messages overtake each other.
    Reorder,
    /// Bits of the payload are flipped.
    Corrupt,
    /// No message arrives until the fault is over.
    Stall,
    /// Messages arrive in bursts.
    Burst,
    /// The clock that stamps the messages is set forward, and back at the end.
    Clock,
    /// The process is killed.
    Kill,
    /// The process is stopped.
    Stop,
    /// The process is stopped for a share of the time.
    Slow,
    /// The process can write to no file.
    Disk,
    /// Shared memory is used up.
    Memory,
}

/// A fault without a target, or one that its target cannot have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "expected a service with drop, delay, duplicate, reorder, corrupt, stall, burst or clock, or a process with kill, stop, slow or disk, or neither with memory"
)]
pub struct NoSuchFault;

/// How many services are injectable.
const ROUTED: usize = {
    let (mut count, mut at) = (0, 0);
    while at < SERVICES.len() {
        count += SERVICES[at].injectable as usize;
        at += 1;
    }
    count
};

impl RoutedService {
    /// Every service that can go through the injector.
    pub const ALL: [Self; ROUTED] = {
        let mut all = [Self(""); ROUTED];
        let (mut count, mut at) = (0, 0);
        while at < SERVICES.len() {
            if SERVICES[at].injectable {
                all[count] = Self(SERVICES[at].name);
                count += 1;
            }
            at += 1;
        }
        all
    };

    /// The service of this name, if it can go through the injector.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|service| service.0 == name)
    }

    /// Its name on the bus.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.0
    }
}

impl Serialize for RoutedService {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.0)
    }
}

impl<'de> Deserialize<'de> for RoutedService {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        let expected = Self::ALL.map(Self::name).join(", ");
        Self::named(&name).ok_or_else(|| D::Error::invalid_value(Unexpected::Str(&name), &expected.as_str()))
    }
}

impl JsonSchema for RoutedService {
    fn schema_name() -> Cow<'static, str> {
        "RoutedService".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let routed = SERVICES.iter().filter(|service| service.injectable);
        let choices: Vec<_> =
            routed.map(|service| serde_json::json!({ "type": "string", "const": service.name, "description": service.doc })).collect();
        json_schema!({ "oneOf": choices, "description": "A service that can go through the injector." })
    }
}

impl FaultKind {
    /// Every kind.
    pub const ALL: [Self; 13] = [
        Self::Drop,
        Self::Delay,
        Self::Duplicate,
        Self::Reorder,
        Self::Corrupt,
        Self::Stall,
        Self::Burst,
        Self::Clock,
        Self::Kill,
        Self::Stop,
        Self::Slow,
        Self::Disk,
        Self::Memory,
    ];

    /// Its word in settings.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Drop => "drop",
            Self::Delay => "delay",
            Self::Duplicate => "duplicate",
            Self::Reorder => "reorder",
            Self::Corrupt => "corrupt",
            Self::Stall => "stall",
            Self::Burst => "burst",
            Self::Clock => "clock",
            Self::Kill => "kill",
            Self::Stop => "stop",
            Self::Slow => "slow",
            Self::Disk => "disk",
            Self::Memory => "memory",
        }
    }
}

impl Disturbance {
    /// The disturbance of a service, of a process, or where neither is given of the computer.
    ///
    /// # Errors
    /// When both are given, or it cannot happen to what is given.
    pub fn new(service: Option<RoutedService>, process: Option<Name>, kind: FaultKind) -> Result<Self, NoSuchFault> {
        let on_service = |fault| match (service, &process) {
            (Some(service), None) => Ok(Self::Service { service, fault }),
            _ => Err(NoSuchFault),
        };
        let on_process = |fault| match (service, &process) {
            (None, Some(process)) => Ok(Self::Process { process: process.clone(), fault }),
            _ => Err(NoSuchFault),
        };
        match kind {
            FaultKind::Drop => on_service(StreamFault::Drop),
            FaultKind::Delay => on_service(StreamFault::Delay),
            FaultKind::Duplicate => on_service(StreamFault::Duplicate),
            FaultKind::Reorder => on_service(StreamFault::Reorder),
            FaultKind::Corrupt => on_service(StreamFault::Corrupt),
            FaultKind::Stall => on_service(StreamFault::Stall),
            FaultKind::Burst => on_service(StreamFault::Burst),
            FaultKind::Clock => on_service(StreamFault::Clock),
            FaultKind::Kill => on_process(ProcessFault::Kill),
            FaultKind::Stop => on_process(ProcessFault::Stop),
            FaultKind::Slow => on_process(ProcessFault::Slow),
            FaultKind::Disk => on_process(ProcessFault::Disk),
            FaultKind::Memory if service.is_none() && process.is_none() => Ok(Self::Memory),
            FaultKind::Memory => Err(NoSuchFault),
        }
    }

    /// What happens.
    #[must_use]
    pub fn kind(&self) -> FaultKind {
        match self {
            Self::Service { fault, .. } => match fault {
                StreamFault::Drop => FaultKind::Drop,
                StreamFault::Delay => FaultKind::Delay,
                StreamFault::Duplicate => FaultKind::Duplicate,
                StreamFault::Reorder => FaultKind::Reorder,
                StreamFault::Corrupt => FaultKind::Corrupt,
                StreamFault::Stall => FaultKind::Stall,
                StreamFault::Burst => FaultKind::Burst,
                StreamFault::Clock => FaultKind::Clock,
            },
            Self::Process { fault, .. } => match fault {
                ProcessFault::Kill => FaultKind::Kill,
                ProcessFault::Stop => FaultKind::Stop,
                ProcessFault::Slow => FaultKind::Slow,
                ProcessFault::Disk => FaultKind::Disk,
            },
            Self::Memory => FaultKind::Memory,
        }
    }
}

impl PlannedFault {
    /// A fault that hits everything from the beginning to the end.
    #[must_use]
    pub fn always(disturbance: Disturbance) -> Self {
        Self {
            disturbance,
            rate: FaultRate::default(),
            from_s: FaultStart::default(),
            for_s: FaultLength::default(),
            by_s: None,
            seed: FaultSeed::default(),
        }
    }
}

impl TryFrom<Entry> for PlannedFault {
    type Error = NoSuchFault;

    fn try_from(entry: Entry) -> Result<Self, NoSuchFault> {
        let disturbance = Disturbance::new(entry.service, entry.process, entry.kind)?;
        let Entry { rate, from_s, for_s, by_s, seed, .. } = entry;
        Ok(Self { disturbance, rate, from_s, for_s, by_s, seed })
    }
}

impl From<PlannedFault> for Entry {
    fn from(fault: PlannedFault) -> Self {
        let kind = fault.disturbance.kind();
        let (service, process) = match fault.disturbance {
            Disturbance::Service { service, .. } => (Some(service), None),
            Disturbance::Process { process, .. } => (None, Some(process)),
            Disturbance::Memory => (None, None),
        };
        let PlannedFault { rate, from_s, for_s, by_s, seed, .. } = fault;
        Self { service, process, kind, rate, from_s, for_s, by_s, seed }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Serialize, Deserialize)]
    struct File {
        fault: Vec<PlannedFault>,
    }

    #[test]
    fn every_kind_reads_as_it_was_written_and_no_other_goes() {
        let services = ["drop", "delay", "duplicate", "reorder", "corrupt", "stall", "burst", "clock"];
        let processes = ["kill", "stop", "slow", "disk"];
        for kind in services.into_iter().chain(processes) {
            let (good, bad) = if services.contains(&kind) {
                ("service = \"robot/scan\"", "process = \"mapping\"")
            } else {
                ("process = \"mapping\"", "service = \"robot/scan\"")
            };
            let text = |target: &str| format!("[[fault]]\nkind = \"{kind}\"\n{target}\nrate = 0.5\nseed = 7\n");
            let read: File = toml::from_str(&text(good)).unwrap();
            let again: File = toml::from_str(&toml::to_string(&read).unwrap()).unwrap();
            assert_eq!(read.fault, again.fault);
            for wrong in [bad, "", "service = \"robot/scan\"\nprocess = \"mapping\""] {
                assert!(toml::from_str::<File>(&text(wrong)).is_err(), "{kind}: {wrong}");
            }
        }
    }

    #[test]
    fn memory_has_no_target() {
        let read: File = toml::from_str("[[fault]]\nkind = \"memory\"\nfor_s = 3.0\n").unwrap();
        assert_eq!(read.fault[0].disturbance, Disturbance::Memory);
        assert_eq!(toml::from_str::<File>(&toml::to_string(&read).unwrap()).unwrap().fault, read.fault);
        for whose in ["service = \"robot/scan\"", "process = \"mapping\""] {
            assert!(toml::from_str::<File>(&format!("[[fault]]\nkind = \"memory\"\n{whose}\n")).is_err(), "{whose}");
        }
    }

    #[test]
    fn the_names_of_services_and_kinds_are_those_of_the_file() {
        for service in RoutedService::ALL {
            assert_eq!(toml::Value::try_from(service).unwrap().as_str(), Some(service.name()));
        }
        for kind in FaultKind::ALL {
            assert_eq!(toml::Value::try_from(kind).unwrap().as_str(), Some(kind.name()));
        }
    }
}
