//! `[[process]]`: the processes of a deployment.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::text::Name;

/// A built-in process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum BuiltIn {
    /// Writes the streams to a log.
    Recorder,
    /// Makes the map from the scans.
    Mapping,
    /// Detects motion with the sonars.
    Std,
    /// Detects motion with the camera.
    Sbs,
    /// Decides which readings people caused.
    Fti,
    /// Estimates where the robot is in the map.
    Localisation,
    /// Drives a Pioneer.
    Pioneer,
    /// Takes pictures with a camera.
    Camera,
    /// Simulates a world with a robot.
    Simulator,
    /// Replays a log in place of the robot.
    Playback,
    /// Shows the live page in a browser.
    Viewer,
    /// Injects faults.
    Injector,
}

/// A stream that another executable publishes in place of a built-in process, and that built-in processes wait for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Published {
    /// Verdicts on readings, in place of `run = "fti"`.
    #[serde(rename = "map/verdict")]
    Verdicts,
    /// Motion in the camera's pictures, in place of `run = "sbs"`.
    #[serde(rename = "motion/camera")]
    CameraMotion,
}

/// What a process runs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Program {
    /// A part of `stillmap` itself.
    BuiltIn(BuiltIn),
    /// Any other executable: program and arguments; never empty when read from a file.
    Command(Vec<String>),
}

/// `[[process]]`: one process of the deployment.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "Entry", into = "Entry")]
pub struct Process {
    /// Its name, unique in the deployment.
    pub name: Name,
    /// What it runs.
    pub program: Program,
    /// When it ends successfully, the run ends.
    pub ends_run: bool,
    /// Streams of another executable that built-in processes wait for; empty for a built-in process.
    pub publishes: Vec<Published>,
}

/// A process as it is written.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct Entry {
    /// Name of the process, unique in the deployment.
    name: Name,
    /// Built-in process that is run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    run: Option<BuiltIn>,
    /// Another executable that is run: the program and its arguments. It joins the deployment by the variables `STILLMAP_*`, which the
    /// supervisor sets.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    command: Option<Vec<String>>,
    /// Whether the run ends when the process ends successfully. The default is true for simulator and playback, false otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    ends_run: Option<bool>,
    /// Streams that `command` publishes in place of "fti" or "sbs". The built-in processes wait for them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    publishes: Vec<Published>,
}

/// A process whose keys contradict each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
enum Contradiction {
    #[error("expected exactly one of run and command")]
    NotOneProgram,
    #[error("expected no publishes beside run: a built-in process publishes what it always does")]
    BuiltInPublishes,
}

impl BuiltIn {
    /// Every built-in process.
    pub const ALL: [Self; 12] = [
        Self::Recorder,
        Self::Mapping,
        Self::Std,
        Self::Sbs,
        Self::Fti,
        Self::Localisation,
        Self::Pioneer,
        Self::Camera,
        Self::Simulator,
        Self::Playback,
        Self::Viewer,
        Self::Injector,
    ];

    /// Its word in settings and on the command line.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Recorder => "recorder",
            Self::Mapping => "mapping",
            Self::Std => "std",
            Self::Sbs => "sbs",
            Self::Fti => "fti",
            Self::Localisation => "localisation",
            Self::Pioneer => "pioneer",
            Self::Camera => "camera",
            Self::Simulator => "simulator",
            Self::Playback => "playback",
            Self::Viewer => "viewer",
            Self::Injector => "injector",
        }
    }

    /// Whether a run ends with it unless the settings differ: a source of scans that has an end.
    #[must_use]
    pub fn ends_run(self) -> bool {
        matches!(self, Self::Simulator | Self::Playback)
    }
}

impl Process {
    /// A built-in process under its own name.
    #[must_use]
    pub fn built_in(kind: BuiltIn) -> Self {
        Self { name: Name::literal(kind.word()), program: Program::BuiltIn(kind), ends_run: kind.ends_run(), publishes: Vec::new() }
    }

    /// Whether it runs this built-in process.
    #[must_use]
    pub fn runs(&self, kind: BuiltIn) -> bool {
        self.program == Program::BuiltIn(kind)
    }
}

impl TryFrom<Entry> for Process {
    type Error = Contradiction;

    fn try_from(entry: Entry) -> Result<Self, Contradiction> {
        let program = match (entry.run, entry.command) {
            (Some(kind), None) => Program::BuiltIn(kind),
            (None, Some(command)) => Program::Command(command),
            _ => return Err(Contradiction::NotOneProgram),
        };
        if matches!(program, Program::BuiltIn(_)) && !entry.publishes.is_empty() {
            return Err(Contradiction::BuiltInPublishes);
        }
        let by_default = matches!(program, Program::BuiltIn(kind) if kind.ends_run());
        Ok(Self { name: entry.name, program, ends_run: entry.ends_run.unwrap_or(by_default), publishes: entry.publishes })
    }
}

impl From<Process> for Entry {
    fn from(process: Process) -> Self {
        let (run, command) = match process.program {
            Program::BuiltIn(kind) => (Some(kind), None),
            Program::Command(command) => (None, Some(command)),
        };
        Self { name: process.name, run, command, ends_run: Some(process.ends_run), publishes: process.publishes }
    }
}
