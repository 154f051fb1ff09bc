//! `stillmap replay`: a deployment with a log in place of the robot.

use crate::args::{RunOptions, seconds};
use crate::drive::{drive, once, place_output, unique_name};
use crate::exit::BadInput;
use crate::process::playback;
use clap::{Args, ValueEnum};
use drivelog::Entry;
use indicatif::MultiProgress;
use messages::SonarScan;
use settings::{BuiltIn, Injector, LogTime, Playback, Process, Program, Settings, Viewer};
use std::path::{Path, PathBuf};
use std::time::Duration;
use supervisor::StopAsked;

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
    /// Start of what is replayed, in seconds from the start of the log. The map begins empty there
    #[arg(long, value_name = "S", value_parser = seconds, default_value = "0")]
    from: Duration,
    /// End of what is replayed, in seconds from the start of the log. The default is the end of the log
    #[arg(long, value_name = "S", value_parser = seconds)]
    to: Option<Duration>,
    /// Replay again and again until stopped. Each round is a new deployment, whose map replaces that of the round before
    #[arg(long = "loop")]
    repeats: bool,
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
    let ReplayArgs { log, pace, settings, from, to, repeats, options } = args;
    let (from_s, to_s) = (log_time(*from)?, to.map(log_time).transpose()?);
    let played = Playback { log: std::path::absolute(log)?, from_s, to_s, ..Playback::default() };
    let recorded = read_settings(&played)?;
    let recorded = match settings {
        Some(file) => Settings::read(file)?,
        None => recorded_settings(log, &recorded)?,
    };
    let mut settings = deployment(recorded, played, *pace)?;
    place_output(&mut settings, options)?;
    let how = match pace {
        Pace::Lockstep => "in lockstep, as fast as every process can follow",
        Pace::Live => "at the pace of the drive",
    };
    tracing::info!("replaying {} {how}", log.display());
    // It may come when a round has ended by itself.
    let stop = StopAsked::watch()?;
    let run = once(options.speed.unwrap_or(1.0))?;
    let mut driven = drive(&settings, &run, options.open, bars)?;
    // The page of the first round stays open and joins the next ones.
    while *repeats && driven.is_complete && !stop.has_come() {
        tracing::info!("replaying {} again", log.display());
        driven = drive(&settings, &run, false, bars)?;
    }
    Ok(driven.exit_code)
}

fn log_time(time: Duration) -> Result<LogTime, BadInput> {
    LogTime::try_from(time.as_secs_f64()).map_err(|error| BadInput(format!("a time in the log: {error}")))
}

/// The deployment of a log, from the settings in it. Keys that this version does not know are named in a warning.
pub(crate) fn recorded_settings(log: &Path, text: &str) -> anyhow::Result<Settings> {
    let (settings, left_out) = Settings::parse_recorded(&format!("{}: its settings", log.display()), text)?;
    if !left_out.is_empty() {
        tracing::warn!("{}: its settings have keys that this version does not know, left out: {}", log.display(), left_out.join(", "));
    }
    Ok(settings)
}

/// The settings of the recorded deployment. Fails if the log has no scan in what is played.
fn read_settings(played: &Playback) -> anyhow::Result<String> {
    let mut log = playback::open(played)?;
    match log.next_of::<SonarScan>()? {
        Some(Entry::Message { .. }) => Ok(log.preamble().settings.clone()),
        Some(Entry::End { .. }) | None => {
            let to = played.to_s.map(|to_s| format!(" to {} s", to_s.get())).unwrap_or_default();
            let from = if played.from_s > LogTime::MIN { format!(" from {} s on", played.from_s.get()) } else { String::new() };
            Err(BadInput(format!("{}: has no scan to replay{from}{to}", played.log.display())).into())
        }
    }
}

/// Whether a replay runs this process as the recorded deployment did. SBS needs pictures beside.
pub(crate) fn is_replayed(kind: BuiltIn) -> bool {
    matches!(kind, BuiltIn::Mapping | BuiltIn::Std | BuiltIn::Fti | BuiltIn::Localisation)
}

/// The recorded deployment with playback in place of its drivers. It records nothing and injects no fault, starts no program, and its
/// viewer has the default settings: a log from elsewhere must not open the page to a network.
fn deployment(mut settings: Settings, played: Playback, pace: Pace) -> anyhow::Result<Settings> {
    settings.name = unique_name("replay")?;
    settings.out = PathBuf::from("replay-out");
    settings.pace = match pace {
        Pace::Lockstep => settings::Pace::Lockstep,
        Pace::Live => settings::Pace::Live,
    };
    settings.playback = Playback { window: settings.playback.window, ..played };
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
        let replay =
            deployment(recorded.clone(), Playback { log: "/logs/drive.mcap".into(), ..Playback::default() }, Pace::Lockstep).unwrap();
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
        let replay = deployment(recorded, Playback { log: "/logs/drive.mcap".into(), ..Playback::default() }, Pace::Live).unwrap();
        assert_eq!((replay.viewer.clone(), replay.fault.len(), replay.routed_services().len()), (Viewer::default(), 0, 0));
        assert!(replay.supervisor.on_event.is_empty());
        replay.check().unwrap();
    }

    #[test]
    fn a_log_without_a_map_can_be_mapped() {
        let text = "name = \"x\"\n[[process]]\nname = \"recorder\"\nrun = \"recorder\"\n[[process]]\nname = \"d\"\ncommand = [\"d\"]\n";
        let replay = deployment(
            Settings::parse("x.toml", text).unwrap(),
            Playback { log: "/logs/drive.mcap".into(), ..Playback::default() },
            Pace::Live,
        )
        .unwrap();
        let names: Vec<&str> = replay.process.iter().map(|process| process.name.as_str()).collect();
        assert_eq!(names, ["mapping", "viewer", "playback"], "a live replay has a page");
        replay.check().unwrap();
    }
}
