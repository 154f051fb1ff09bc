//! The settings of a whole deployment.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    Camera, Fti, Injector, Localisation, Mapping, Name, Pioneer, PlannedFault, Playback, Process, Recorder, Robot, Sbs, Simulator, Std,
    Supervisor, Viewer,
};

/// What sets the pace of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Pace {
    /// The sensors set the pace, and deadlines hold.
    #[default]
    Live,
    /// The slowest process sets the pace: nothing is skipped, no deadline holds, and the result is the same every time.
    Lockstep,
}

/// Settings of a deployment of stillmap: one TOML file each.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct Settings {
    /// Name of the deployment. Deployments of different names can run at the same time.
    pub name: Name,
    /// What sets the pace: the sensors, or the slowest process when a log is replayed.
    #[serde(default)]
    pub pace: Pace,
    /// Folder for the log and the map, relative to the settings file.
    #[serde(default = "default_out", deserialize_with = "crate::text::path")]
    #[schemars(extend("x-form" = "path"))]
    pub out: PathBuf,
    /// `[[process]]`: the processes in the order of starting. Each has exactly one of `run` and `command`.
    #[schemars(length(min = 1, max = 23))]
    pub process: Vec<Process>,
    /// `[supervisor]`: how processes are watched and restarted.
    #[serde(default)]
    pub supervisor: Supervisor,
    /// `[robot]`: the robot's body and sonars.
    #[serde(default)]
    pub robot: Robot,
    /// `[camera]`: the camera on the robot.
    #[serde(default)]
    pub camera: Camera,
    /// `[pioneer]`: the driver of a robot that speaks the PSOS or P2OS protocol.
    #[serde(default)]
    pub pioneer: Pioneer,
    /// `[simulator]`: a simulated world with its robot.
    #[serde(default)]
    pub simulator: Simulator,
    /// `[mapping]`: the fuzzy-tuned grid map.
    #[serde(default)]
    pub mapping: Mapping,
    /// `[std]`: sonar temporal difference.
    #[serde(default)]
    pub std: Std,
    /// `[sbs]`: statistical background subtraction.
    #[serde(default)]
    pub sbs: Sbs,
    /// `[fti]`: fuzzy-tuned integration.
    #[serde(default)]
    pub fti: Fti,
    /// `[localisation]`: where the robot is in the map.
    #[serde(default)]
    pub localisation: Localisation,
    /// `[recorder]`: the log of a run.
    #[serde(default)]
    pub recorder: Recorder,
    /// `[playback]`: a log in place of the robot.
    #[serde(default)]
    pub playback: Playback,
    /// `[viewer]`: the page that a browser shows.
    #[serde(default)]
    pub viewer: Viewer,
    /// `[injector]`: faults between the processes.
    #[serde(default)]
    pub injector: Injector,
    /// `[[fault]]`: faults on purpose, for which a process must run `"injector"`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 64))]
    pub fault: Vec<PlannedFault>,
}

fn default_out() -> PathBuf {
    PathBuf::from("out")
}

impl Default for Settings {
    /// A deployment named `stillmap` that has no process yet: a base to add processes to.
    fn default() -> Self {
        Self {
            name: Name::literal("stillmap"),
            pace: Pace::default(),
            out: default_out(),
            process: Vec::new(),
            supervisor: Supervisor::default(),
            robot: Robot::default(),
            camera: Camera::default(),
            pioneer: Pioneer::default(),
            simulator: Simulator::default(),
            mapping: Mapping::default(),
            std: Std::default(),
            sbs: Sbs::default(),
            fti: Fti::default(),
            localisation: Localisation::default(),
            recorder: Recorder::default(),
            playback: Playback::default(),
            viewer: Viewer::default(),
            injector: Injector::default(),
            fault: Vec::new(),
        }
    }
}
