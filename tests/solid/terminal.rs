//! Terminals that close, colour or take nothing, and text that would act on them.

use std::fs::{self, File, OpenOptions};
use std::io::Read;
use std::os::fd::OwnedFd;
use std::os::unix::fs::OpenOptionsExt;
use std::path::PathBuf;
use std::process::Command;

use drivelog::{Preamble, Recording};
use messages::{Pose, SonarReading, SonarScan};
use rustix::fs::OFlags;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

use super::harness::replays::{DRIVE, replay_settings};
use super::harness::{Bench, Run, text};

/// A terminal of 100 columns.
struct Terminal {
    /// The side of the person in front of it.
    person: File,
    /// The side of the programs.
    programs: File,
}

impl Terminal {
    fn new() -> Self {
        let person: OwnedFd = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&person).unwrap();
        unlockpt(&person).unwrap();
        let name = PathBuf::from(ptsname(&person, Vec::new()).unwrap().into_string().unwrap());
        let flags = OFlags::NOCTTY.bits() as i32;
        let programs = OpenOptions::new().read(true).write(true).custom_flags(flags).open(name).unwrap();
        let size = rustix::termios::Winsize { ws_row: 30, ws_col: 100, ws_xpixel: 0, ws_ypixel: 0 };
        rustix::termios::tcsetwinsize(&programs, size).unwrap();
        Self { person: person.into(), programs }
    }

    /// Has the command write to this terminal.
    fn show(&self, command: &mut Command) {
        let side = || self.programs.try_clone().unwrap();
        command.stdin(side()).stdout(side()).stderr(side()).env("TERM", "xterm").env_remove("NO_COLOR");
    }

    /// Reads until these words have come.
    #[track_caller]
    fn read_until(&mut self, words: &str) {
        let mut shown = Vec::new();
        while !text(&shown).contains(words) {
            let mut buffer = [0; 4096];
            let count = self.person.read(&mut buffer).unwrap_or(0);
            assert!(count > 0, "{words:?} does not come: {}", text(&shown));
            shown.extend_from_slice(&buffer[..count]);
        }
    }

    /// Everything that is shown until the last program has closed its side.
    fn read_to_end(self) -> String {
        let Self { mut person, programs } = self;
        drop(programs);
        let mut shown = Vec::new();
        // The end is an error of its own here (EIO).
        let _ = person.read_to_end(&mut shown);
        text(&shown)
    }
}

/// A replay in lockstep of the recorded drive; its outputs come into `NAME-out`.
fn replay(bench: &Bench, name: &str, pace: &str) -> Command {
    let settings = bench.write(&format!("{name}.toml"), &replay_settings(name, &DRIVE.1, "").replace("\"lockstep\"", pace));
    bench.stillmap(["run", settings.to_str().unwrap(), "--speed", "2"])
}

/// The map of the undisturbed replay, as its file.
fn undisturbed_map() -> Vec<u8> {
    fs::read(DRIVE.0.path("undisturbed-out").join("map.pgm")).unwrap()
}

#[test]
fn a_closed_terminal_leaves_run_and_map_whole() {
    let bench = Bench::new();
    let mut terminal = Terminal::new();
    let mut command = replay(&bench, "closed", "\"lockstep\"");
    terminal.show(&mut command);
    let mut child = command.spawn().unwrap();
    drop(command);
    terminal.read_until("playback   is up");
    drop(terminal);
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(fs::read(bench.path("closed-out").join("map.pgm")).unwrap(), undisturbed_map());
    assert_eq!(bench.left_behind(), Vec::<PathBuf>::new());
}

#[test]
fn a_hangup_ends_the_run_in_order() {
    let bench = Bench::new();
    let mut terminal = Terminal::new();
    let run = replay(&bench, "hangup", "\"live\"");
    // The leader of a session gets SIGHUP when its terminal closes.
    let mut command = bench.stillmap_by("setsid");
    command.args(["--ctty"]).arg(run.get_program()).args(run.get_args());
    terminal.show(&mut command);
    let mut child = command.spawn().unwrap();
    drop(command);
    terminal.read_until("playback   is up");
    drop(bench.wait_for("mapping", "it maps", |it| it["received"].as_u64() > Some(20)));
    drop(terminal);
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert!(bench.path("hangup-out").join("map.pgm").exists());
    assert_eq!(bench.left_behind(), Vec::<PathBuf>::new());
}

#[test]
fn results_that_cannot_be_written_leave_the_run_as_it_was() {
    let bench = Bench::new();
    let mut command = replay(&bench, "full", "\"lockstep\"");
    command.stdout(OpenOptions::new().write(true).open("/dev/full").unwrap());
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("warning: standard output: No space left"), "{}", text(&output.stderr));
    assert_eq!(fs::read(bench.path("full-out").join("map.pgm")).unwrap(), undisturbed_map());
}

#[test]
fn a_result_that_cannot_be_written_is_an_error() {
    let bench = Bench::new();
    let mut command = bench.stillmap(["log", "info", DRIVE.1.to_str().unwrap()]);
    command.stdout(OpenOptions::new().write(true).open("/dev/full").unwrap());
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(text(&output.stderr), "error: standard output: No space left on device (os error 28)\n");
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let output = bench.stillmap(["log", "info", DRIVE.1.to_str().unwrap()]).stdout(writer).output().unwrap();
    assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), String::new()), "a reader such as head may leave");
}

#[test]
fn no_color_and_dumb_terminals_get_what_they_ask_for() {
    let bench = Bench::new();
    let shown = |variable: &str, value: &str| {
        let terminal = Terminal::new();
        let mut command = bench.stillmap(["replay", DRIVE.1.to_str().unwrap(), "--out", bench.path("out").to_str().unwrap()]);
        terminal.show(&mut command);
        let mut child = command.env(variable, value).spawn().unwrap();
        drop(command);
        let reading = std::thread::spawn(move || terminal.read_to_end());
        assert_eq!(child.wait().unwrap().code(), Some(0));
        let shown = reading.join().unwrap();
        assert!(shown.contains(&DRIVE.2), "{shown}");
        shown
    };
    assert!(shown("TERM", "xterm").contains("\x1b[0m"), "coloured by default");
    let plain = shown("NO_COLOR", "1");
    assert!(plain.contains("\x1b[2K"), "the bar is drawn: {plain:?}");
    assert!(!plain.contains("\x1b[0m") && !plain.contains("\x1b[3"), "{plain:?}");
    let dumb = shown("TERM", "dumb");
    assert!(!dumb.contains('\x1b') && dumb.contains("% done"), "{dumb:?}");
}

/// Sets the title of a terminal, clears it, and forges a line.
const ACTS: &str = "\u{1b}]0;owned\u{7}\u{1b}[2J\u{9b}31m\r\nfile      all is well";

/// A log whose names act on a terminal.
fn acting_log(bench: &Bench) -> PathBuf {
    let settings = "name = \"x\"\n[[process]]\nname = \"mapping\"\nrun = \"mapping\"\n".to_owned();
    let preamble = Preamble { run: 1, robot: ACTS.to_owned(), sonars: Vec::new(), origin: ACTS.to_owned(), settings };
    let mut recording = Recording::new(&preamble).unwrap();
    let reading = SonarReading { range_m: 1.0, echo: 1, ..SonarReading::default() };
    for seq in 1..=20 {
        recording.scan(seq, seq * 100_000_000, &SonarScan::new(Pose::default(), &[reading], false)).unwrap();
    }
    recording.end::<SonarScan>(20, 2_000_000_000).unwrap();
    let log = bench.path("acts\u{1b}[7m.mcap");
    fs::write(&log, recording.finish().unwrap()).unwrap();
    log
}

#[track_caller]
fn assert_harmless(shown: &str) {
    assert!(!shown.chars().any(|c| c.is_control() && c != '\n'), "{shown:?}");
    assert!(!shown.lines().any(|line| line == "file      all is well"), "{shown:?}");
}

#[test]
fn text_from_a_log_does_not_act_on_the_terminal() {
    let bench = Bench::new();
    let log = acting_log(&bench);
    for arguments in [vec!["log", "info"], vec!["replay"], vec!["log", "recover"], vec!["evaluate"], vec!["check"], vec!["run"]] {
        let arguments: Vec<&str> = arguments.into_iter().chain([log.to_str().unwrap()]).collect();
        let output = bench.output(&arguments);
        let (out, err) = (text(&output.stdout), text(&output.stderr));
        assert!(out.contains("u{1b}") || err.contains("u{1b}"), "{arguments:?} shows it: {out}{err}");
        assert_harmless(&out);
        assert_harmless(&err);
    }
}

#[test]
fn text_from_a_process_does_not_act_on_the_terminal() {
    let bench = Bench::new();
    let settings = format!(
        "name = \"acts\"\n[[process]]\nname = \"talks\"\ncommand = [\"printf\", {ACTS:?}]\nends_run = true\n[supervisor]\nrestarts = 0\n"
    )
    .replace("\\u{1b}", "\\u001b")
    .replace("\\u{7}", "\\u0007")
    .replace("\\u{9b}", "\\u009b");
    let settings = bench.write("acts.toml", &settings);
    let output = Run::start(bench.stillmap(["run", settings.to_str().unwrap()])).end();
    let shown = text(&output.stderr);
    assert!(shown.contains("\\u{1b}]0;owned") && shown.contains("talks"), "{shown}");
    assert_harmless(&shown);
    let checked = bench.output(["check", settings.to_str().unwrap()]);
    assert_harmless(&text(&checked.stdout));
}
