//! From settings to what the state machine needs.

use crate::lifecycle::{Plan, Role};
use crate::policy::Policy;
use settings::{BuiltIn, Pace, Process, Program, Settings};
use std::time::Duration;

/// The processes in start order.
pub(crate) fn plans(settings: &Settings) -> Vec<Plan> {
    settings.process.iter().map(|process| plan(process, settings.pace)).collect()
}

/// A foreign process is taken for a source: it may be a driver, and then the run cannot end before it is asked to stop.
///
/// Live, the run continues without any process that does not bring the scans. In lockstep every process waits for the slowest, so that
/// a process that is gone for good would be waited for without end; no process waits for the viewer.
fn plan(process: &Process, pace: Pace) -> Plan {
    let (role, brings_scans) = match process.program {
        Program::BuiltIn(BuiltIn::Pioneer | BuiltIn::Simulator | BuiltIn::Playback) => (Role::Source, true),
        Program::BuiltIn(
            BuiltIn::Recorder | BuiltIn::Mapping | BuiltIn::Std | BuiltIn::Sbs | BuiltIn::Fti | BuiltIn::Localisation | BuiltIn::Viewer,
        ) => (Role::Consumer, false),
        // Without it nothing comes through.
        Program::BuiltIn(BuiltIn::Injector) => (Role::Consumer, true),
        // Without its pictures the sonars continue.
        Program::BuiltIn(BuiltIn::Camera) | Program::Command(_) => (Role::Source, false),
    };
    let essential = brings_scans || (pace == Pace::Lockstep && !process.runs(BuiltIn::Viewer));
    Plan { name: process.name.as_str().to_owned(), role, ends_run: process.ends_run, essential }
}

pub(crate) fn policy(settings: &settings::Supervisor) -> Policy {
    let s = Duration::from_secs_f64;
    Policy {
        startup_deadline: s(settings.startup_deadline_s.get()),
        heartbeat_timeout: s(settings.heartbeat_timeout_s.get()),
        restarts: settings.restarts.get(),
        within: s(settings.within_s.get()),
        backoff_first: s(settings.backoff_first_s.get()),
        backoff_last: s(settings.backoff_last_s.get()),
        stop_deadline: s(settings.stop_deadline_s.get()),
    }
}
