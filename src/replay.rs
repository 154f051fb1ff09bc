//! `stillmap replay`: a deployment with a log in place of the robot.

use crate::args::RunOptions;
use crate::drive::{drive, once, place_output, unique_name};
use crate::exit::BadInput;
use clap::{Args, ValueEnum};
use drivelog::{Entry, Log};
use indicatif::MultiProgress;
use messages::SonarScan;
use settings::{BuiltIn, Injector, Process, Program, Settings, Viewer};
use std::path::{Path, PathBuf};

/// Arguments of `stillmap replay`.
#[derive(Debug, Args)]
pub(crate) struct ReplayArgs {
    /// The log
    #[arg(value_name = "LOG")]
    log: PathBuf,
    /// How fast the log is played
    #[arg(long, value_enum, default_value_t = Pace::Lockstep)]
    pace: Pace,
    /// Settings file in place of the settings in the log
    #[arg(long, value_name = "FILE")]
    settings: Option<PathBuf>,
    #[command(flatten)]
    options: RunOptions,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Pace {
    /// As fast as every process can follow. No message is dropped, and the map is the same every time
    Lockstep,
    /// At the pace of the drive, multiplied by --speed
    Live,
}

/// Replays a log; the exit code.
pub(crate) fn replay(args: &ReplayArgs, bars: &MultiProgress) -> anyhow::Result<u8> {
    let ReplayArgs { log, pace, settings, options } = args;
    let recorded = read_settings(log)?;
    let recorded = match settings {
        Some(file) => Settings::read(file)?,
        None => recorded_settings(log, &recorded)?,
    };
    let mut settings = deployment(recorded, std::path::absolute(log)?, *pace)?;
    place_output(&mut settings, options)?;
    let how = match pace {
        Pace::Lockstep => "in lockstep, as fast as every process can follow",
        Pace::Live => "at the pace of the drive",
    };
    tracing::info!("replaying {} {how}", log.display());
    drive(&settings, &once(options.speed.unwrap_or(1.0))?, options.open, bars)
}

/// The deployment of a log, from the settings in it. Keys that this version does not know are named in a warning.
pub(crate) fn recorded_settings(log: &Path, text: &str) -> anyhow::Result<Settings> {
    let (settings, left_out) = Settings::parse_recorded(&format!("{}: its settings", log.display()), text)?;
    if !left_out.is_empty() {
        tracing::warn!("{}: its settings have keys that this version does not know, left out: {}", log.display(), left_out.join(", "));
    }
    Ok(settings)
}

/// The settings of the recorded deployment. Fails if the log has no scan.
fn read_settings(path: &Path) -> anyhow::Result<String> {
    let mut log = Log::open(path)?;
    match log.next_of::<SonarScan>()? {
        Some(Entry::Message { .. }) => Ok(log.preamble().settings.clone()),
        Some(Entry::End { .. }) | None => Err(BadInput(format!("{}: has no scan to replay", path.display())).into()),
    }
}

/// Whether a replay runs this process as the recorded deployment did. SBS needs pictures beside.
pub(crate) fn is_replayed(kind: BuiltIn) -> bool {
    matches!(kind, BuiltIn::Mapping | BuiltIn::Std | BuiltIn::Fti | BuiltIn::Localisation)
}

/// The recorded deployment with playback in place of its drivers. It records nothing and injects no fault, starts no program, and its
/// viewer has the default settings: a log from elsewhere must not open the page to a network.
fn deployment(mut settings: Settings, log: PathBuf, pace: Pace) -> anyhow::Result<Settings> {
    settings.name = unique_name("replay")?;
    settings.out = PathBuf::from("replay-out");
    settings.pace = match pace {
        Pace::Lockstep => settings::Pace::Lockstep,
        Pace::Live => settings::Pace::Live,
    };
    settings.playback.log = log;
    settings.viewer = Viewer::default();
    settings.injector = Injector::default();
    settings.fault.clear();
    settings.supervisor.on_event.clear();
    // Without pictures in the log, playback publishes the recorded motion of the camera.
    let has_pictures = settings.recorder.pictures;
    let has_motion = settings.expects_camera_motion();
    settings.process.retain(|process| match &process.program {
        Program::BuiltIn(BuiltIn::Sbs) => has_pictures,
        Program::BuiltIn(kind) => is_replayed(*kind),
        Program::Command(command) => {
            tracing::warn!("process {} is left out: {} may be a driver, which playback replaces", process.name, command.join(" "));
            false
        }
    });
    settings.playback.camera_motion = has_motion && !settings.runs(BuiltIn::Sbs);
    if !settings.runs(BuiltIn::Mapping) {
        settings.process.push(Process::built_in(BuiltIn::Mapping));
    }
    // In lockstep the run would end before a browser could connect.
    if pace == Pace::Live {
        settings.process.push(Process::built_in(BuiltIn::Viewer));
    }
    settings.process.push(Process::built_in(BuiltIn::Playback));
    Ok(settings)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_replay_has_playback_in_place_of_the_robot() {
        let recorded = Settings::parse("demo.toml", include_str!("../config/demo.toml")).unwrap();
        let replay = deployment(recorded.clone(), "/logs/drive.mcap".into(), Pace::Lockstep).unwrap();
        let names: Vec<&str> = replay.process.iter().map(|process| process.name.as_str()).collect();
        assert_eq!(names, ["mapping", "fti", "std", "sbs", "playback"]);
        assert!(replay.process.last().unwrap().ends_run);
        assert_eq!(replay.pace, settings::Pace::Lockstep);
        assert_eq!(replay.mapping, recorded.mapping, "the same settings give the same map");
        replay.check().unwrap();
    }

    #[test]
    fn faults_programs_and_viewer_of_a_log_are_ignored() {
        let more = "[[process]]\nname = \"faults\"\nrun = \"injector\"\n[[fault]]\nprocess = \"std\"\nkind = \"kill\"\n
            [[fault]]\nservice = \"robot/scan\"\nkind = \"drop\"\n";
        let viewer = "[viewer]\naddress = \"0.0.0.0\"\ntoken = \"known-to-strangers\"";
        let demo = include_str!("../config/demo.toml").replace("[robot]", &format!("{more}[robot]"));
        let mut recorded = Settings::parse("demo.toml", &demo.replace("[viewer]\naddress = \"127.0.0.1\"", viewer)).unwrap();
        recorded.supervisor.on_event = vec!["sh".into(), "-c".into(), "a program of strangers".into()];
        assert!(!recorded.viewer.address.get().is_loopback() && recorded.routed_services().len() == 1);
        let replay = deployment(recorded, "/logs/drive.mcap".into(), Pace::Live).unwrap();
        assert_eq!((replay.viewer.clone(), replay.fault.len(), replay.routed_services().len()), (Viewer::default(), 0, 0));
        assert!(replay.supervisor.on_event.is_empty());
        replay.check().unwrap();
    }

    #[test]
    fn a_log_without_a_map_can_be_mapped() {
        let text = "name = \"x\"\n[[process]]\nname = \"recorder\"\nrun = \"recorder\"\n[[process]]\nname = \"d\"\ncommand = [\"d\"]\n";
        let replay = deployment(Settings::parse("x.toml", text).unwrap(), "/logs/drive.mcap".into(), Pace::Live).unwrap();
        let names: Vec<&str> = replay.process.iter().map(|process| process.name.as_str()).collect();
        assert_eq!(names, ["mapping", "viewer", "playback"], "a live replay has a page");
        replay.check().unwrap();
    }
}
