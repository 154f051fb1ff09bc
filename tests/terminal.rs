//! Terminals that close, show colours or take no output, and text with control sequences.

use std::fs::{self, File, OpenOptions};
use std::io::Read;
use std::os::fd::OwnedFd;
use std::os::unix::fs::OpenOptionsExt;
use std::path::PathBuf;
use std::process::Command;

use drivelog::{Preamble, Recording};
use messages::{Pose, SonarReading, SonarScan};
use rustix::fs::OFlags;
use rustix::process::Signal;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

use crate::harness::observer::Observer;
use crate::harness::processes::signal;
use crate::harness::replay::DRIVE;
use crate::harness::{Deployment, Run, Sandbox, WATCHDOG, is_running, text};

/// A terminal of 100 columns.
struct Terminal {
    /// The side of the user.
    user: File,
    /// The side of the programs.
    programs: File,
}

impl Terminal {
    fn new() -> Self {
        let user: OwnedFd = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&user).unwrap();
        unlockpt(&user).unwrap();
        let name = PathBuf::from(ptsname(&user, Vec::new()).unwrap().into_string().unwrap());
        let flags = OFlags::NOCTTY.bits() as i32;
        let programs = OpenOptions::new().read(true).write(true).custom_flags(flags).open(name).unwrap();
        let size = rustix::termios::Winsize { ws_row: 30, ws_col: 100, ws_xpixel: 0, ws_ypixel: 0 };
        rustix::termios::tcsetwinsize(&programs, size).unwrap();
        Self { user: user.into(), programs }
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
            let count = self.user.read(&mut buffer).unwrap_or(0);
            assert!(count > 0, "{words:?} does not come: {}", text(&shown));
            shown.extend_from_slice(&buffer[..count]);
        }
    }

    /// Everything that is shown until the last program has closed its side.
    fn read_to_end(self) -> String {
        let Self { mut user, programs } = self;
        drop(programs);
        let mut shown = Vec::new();
        // The end is an error of its own here (EIO).
        let _ = user.read_to_end(&mut shown);
        text(&shown)
    }
}

/// A replay of the recorded drive; its outputs are in `NAME-out`.
fn replay(sandbox: &Sandbox, name: &str, pace: &str) -> Command {
    sandbox.command(&DRIVE.replay(sandbox, name).set("pace", pace), &["--speed", "2"])
}

#[test]
fn a_closed_terminal_leaves_run_and_map_unchanged() {
    let sandbox = Sandbox::new();
    let mut terminal = Terminal::new();
    let mut command = replay(&sandbox, "closed", "lockstep");
    terminal.show(&mut command);
    let mut child = command.spawn().unwrap();
    drop(command);
    terminal.read_until("playback   is up");
    drop(terminal);
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(fs::read(sandbox.path("closed-out").join("map.pgm")).unwrap(), DRIVE.map_pgm);
    sandbox.assert_nothing_left();
}

#[test]
fn a_hangup_ends_the_run_in_order() {
    let sandbox = Sandbox::new();
    let mut terminal = Terminal::new();
    let run = replay(&sandbox, "hangup", "live");
    // The leader of a session gets SIGHUP when its terminal closes.
    let mut command = sandbox.program("setsid");
    command.args(["--ctty"]).arg(run.get_program()).args(run.get_args());
    terminal.show(&mut command);
    let mut child = command.spawn().unwrap();
    drop(command);
    terminal.read_until("playback   is up");
    let mut observer = Observer::join(sandbox.runtime(), Some("hangup")).unwrap();
    let maps = |it: &messages::ProcessStatus| it.process.as_str() == "mapping" && it.received > 20;
    while !observer.take(WATCHDOG).iter().any(|status| status.processes().iter().any(maps)) {}
    drop(observer);
    drop(terminal);
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert!(sandbox.path("hangup-out").join("map.pgm").exists());
    sandbox.assert_nothing_left();
}

/// A run that can be looked at with `stillmap top`.
fn observed_run(sandbox: &Sandbox) -> Run {
    let mut run = sandbox.run(&DRIVE.replay(sandbox, "observed").set("pace", "live"), &[]);
    run.wait_for("playback", "it runs", is_running);
    run
}

#[test]
fn top_ends_when_its_terminal_closes() {
    let sandbox = Sandbox::new();
    let run = observed_run(&sandbox);
    let mut terminal = Terminal::new();
    let mut command = sandbox.stillmap(["top"]);
    terminal.show(&mut command);
    // It is no session leader: no signal tells it.
    let mut child = command.spawn().unwrap();
    drop(command);
    terminal.read_until("q: quit");
    drop(terminal);
    assert_eq!(child.wait().unwrap().code(), Some(0));
    signal(run.pid(), Signal::TERM);
    run.end();
}

#[test]
fn top_that_is_told_to_end_leaves_the_terminal_as_it_was() {
    let sandbox = Sandbox::new();
    let run = observed_run(&sandbox);
    for told in [Signal::HUP, Signal::TERM] {
        let mut terminal = Terminal::new();
        let before = rustix::termios::tcgetattr(&terminal.programs).unwrap().local_modes;
        let mut command = sandbox.stillmap(["top"]);
        terminal.show(&mut command);
        let mut child = command.spawn().unwrap();
        drop(command);
        terminal.read_until("q: quit");
        signal(child.id(), told);
        assert_eq!(child.wait().unwrap().code(), Some(0));
        assert_eq!(rustix::termios::tcgetattr(&terminal.programs).unwrap().local_modes, before);
    }
    signal(run.pid(), Signal::TERM);
    run.end();
}

#[test]
fn a_run_succeeds_though_its_summary_cannot_be_written() {
    let sandbox = Sandbox::new();
    let mut command = replay(&sandbox, "full", "lockstep");
    command.stdout(OpenOptions::new().write(true).open("/dev/full").unwrap());
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("warning: standard output: No space left"), "{}", text(&output.stderr));
    assert_eq!(fs::read(sandbox.path("full-out").join("map.pgm")).unwrap(), DRIVE.map_pgm);
}

#[test]
fn a_command_fails_if_its_result_cannot_be_written() {
    let sandbox = Sandbox::new();
    let mut command = sandbox.stillmap(["log", "info", DRIVE.log(&sandbox).to_str().unwrap()]);
    command.stdout(OpenOptions::new().write(true).open("/dev/full").unwrap());
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(text(&output.stderr), "error: standard output: No space left on device (os error 28)\n");
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let output = sandbox.stillmap(["log", "info", DRIVE.log(&sandbox).to_str().unwrap()]).stdout(writer).output().unwrap();
    assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), String::new()), "a reader such as head may leave");
}

#[test]
fn no_color_and_dumb_terminals_get_plain_text() {
    let sandbox = Sandbox::new();
    let shown = |variable: &str, value: &str| {
        let terminal = Terminal::new();
        let mut command =
            sandbox.stillmap(["replay", DRIVE.log(&sandbox).to_str().unwrap(), "--out", sandbox.path("out").to_str().unwrap()]);
        terminal.show(&mut command);
        let mut child = command.env(variable, value).spawn().unwrap();
        drop(command);
        let reading = std::thread::spawn(move || terminal.read_to_end());
        assert_eq!(child.wait().unwrap().code(), Some(0));
        let shown = reading.join().unwrap();
        assert!(shown.contains(&DRIVE.map), "{shown}");
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
fn acting_log(sandbox: &Sandbox) -> PathBuf {
    let settings = "name = \"x\"\n[[process]]\nname = \"mapping\"\nrun = \"mapping\"\n".to_owned();
    let preamble = Preamble { run: 1, robot: ACTS.to_owned(), sonars: Vec::new(), origin: ACTS.to_owned(), settings };
    let mut recording = Recording::new(&preamble).unwrap();
    let reading = SonarReading { range_m: 1.0, echo: 1, ..SonarReading::default() };
    for seq in 1..=20 {
        recording.scan(seq, seq * 100_000_000, &SonarScan::new(Pose::default(), &[reading], false)).unwrap();
    }
    recording.end::<SonarScan>(20, 2_000_000_000).unwrap();
    let log = sandbox.path("acts\u{1b}[7m.mcap");
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
    let sandbox = Sandbox::new();
    let log = acting_log(&sandbox);
    for arguments in [vec!["log", "info"], vec!["replay"], vec!["log", "recover"], vec!["evaluate"], vec!["check"], vec!["run"]] {
        let arguments: Vec<&str> = arguments.into_iter().chain([log.to_str().unwrap()]).collect();
        let ended = sandbox.output(&arguments);
        let (out, err) = (ended.stdout, ended.stderr);
        assert!(out.contains("u{1b}") || err.contains("u{1b}"), "{arguments:?} shows it: {out}{err}");
        assert_harmless(&out);
        assert_harmless(&err);
    }
}

#[test]
fn text_from_a_process_does_not_act_on_the_terminal() {
    let sandbox = Sandbox::new();
    let acts = Deployment::new("acts", &[]).with_driver(["printf", ACTS]).set("supervisor.restarts", 0);
    let shown = sandbox.run(&acts, &[]).end().stderr;
    assert!(shown.contains("\\u{1b}]0;owned") && shown.contains("driver"), "{shown}");
    assert_harmless(&shown);
    let checked = sandbox.output(["check", acts.write(&sandbox).to_str().unwrap()]);
    assert_harmless(&checked.stdout);
}
