//! The supervisor with real children, each of which does one wrong thing. This program is the children, too.
//!
//! It has no test harness, since children die with the thread that starts them, and harness threads end.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "tests fail by panicking and say what they do"
)]

use bus::{Membership, Reader, Received, RunningDomain};
use messages::{DeploymentStatus, MapSummary, ProcessState, ProcessStatus, SonarScan};
use runtime::{Context, Next, Observer, Process, Shell, StepError};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{CWD, Mode, mkfifoat};
use rustix::process::{Pid, PidfdFlags, Signal, kill_process, pidfd_open};
use settings::Settings;
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Read, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::process::{ExitCode, Stdio};
use std::time::Duration;
use stillmap_supervisor::{Ending, Options, Outcome, Report, guard, request_restart, run};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words[..] {
        ["child", behaviour] => child(behaviour, None),
        ["child", behaviour, announcement] => child(behaviour, Some(Path::new(announcement))),
        ["guard", directory] => {
            guard(Path::new(directory)).unwrap();
            ExitCode::SUCCESS
        }
        ["supervise", text] => {
            let outcome = run(&Settings::parse("test", text).unwrap(), &options(), &mut |_| {}).unwrap();
            outcome.processes.iter().for_each(|it| println!("{it:?}"));
            ExitCode::from(outcome.exit_code())
        }
        // As the first process of a container, it is given the orphans.
        ["supervise-orphans", text] => {
            rustix::process::set_child_subreaper(Some(rustix::process::getpid())).unwrap();
            ExitCode::from(run(&Settings::parse("test", text).unwrap(), &options(), &mut |_| {}).unwrap().exit_code())
        }
        ["visit", name] => visit(name),
        // A filter or an option of the usual harness: there is nothing to choose.
        _ => all_tests(),
    }
}

const TESTS: &[(&str, fn())] = &[
    ("a_run_ends_when_its_source_does", a_run_ends_when_its_source_does),
    ("killed_processes_come_back", killed_processes_come_back),
    ("a_hung_process_is_killed", a_hung_process_is_killed),
    ("a_process_that_keeps_dying_fails", a_process_that_keeps_dying_fails),
    ("a_requested_restart_counts_for_no_budget", a_requested_restart_counts_for_no_budget),
    ("each_event_starts_the_program_once", each_event_starts_the_program_once),
    ("a_program_for_events_that_hangs_is_killed", a_program_for_events_that_hangs_is_killed),
    ("bad_input_ends_the_run_at_once", bad_input_ends_the_run_at_once),
    ("a_broken_domain_is_made_anew", a_broken_domain_is_made_anew),
    ("a_child_that_ignores_sigterm_is_killed", a_child_that_ignores_sigterm_is_killed),
    ("a_child_that_is_asked_twice_ends_in_order", a_child_that_is_asked_twice_ends_in_order),
    ("a_program_that_is_not_there_fails", a_program_that_is_not_there_fails),
    ("a_flood_of_words_stops_no_process", a_flood_of_words_stops_no_process),
    ("a_process_that_never_joins_fails", a_process_that_never_joins_fails),
    ("nonsense_is_refused_and_named", nonsense_is_refused_and_named),
    ("a_flood_of_messages_stops_no_process", a_flood_of_messages_stops_no_process),
    ("a_supervisor_that_was_stopped_takes_no_process_for_hung", a_supervisor_that_was_stopped_takes_no_process_for_hung),
    ("visitors_that_were_killed_take_no_place_for_long", visitors_that_were_killed_take_no_place_for_long),
    ("nothing_outlives_a_killed_supervisor", nothing_outlives_a_killed_supervisor),
    ("what_a_child_started_outlives_no_killed_supervisor", what_a_child_started_outlives_no_killed_supervisor),
    ("a_session_of_its_own_outlives_no_killed_supervisor", a_session_of_its_own_outlives_no_killed_supervisor),
    ("a_session_of_its_own_outlives_no_process_that_dies", a_session_of_its_own_outlives_no_process_that_dies),
    ("orphans_that_end_are_no_zombies", orphans_that_end_are_no_zombies),
];

fn all_tests() -> ExitCode {
    // Short, since the names of sockets are limited.
    let files = std::env::temp_dir().join(format!("stillmap-processes-{}", std::process::id()));
    let runtime = files.join("run");
    std::fs::create_dir_all(&runtime).unwrap();
    // The outputs of a deployment are in its working directory.
    std::env::set_current_dir(&files).unwrap();
    // SAFETY: no other thread runs yet.
    #[expect(unsafe_code, reason = "children inherit where domains live")]
    unsafe {
        std::env::set_var("STILLMAP_RUNTIME_DIR", &runtime);
    }
    for (name, test) in TESTS {
        print!("test {name} ... ");
        test();
        assert_eq!(left_in(&runtime), Vec::<PathBuf>::new(), "something is left behind");
        println!("ok");
    }
    std::fs::remove_dir_all(&files).unwrap();
    ExitCode::SUCCESS
}

fn left_in(folder: &Path) -> Vec<PathBuf> {
    std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect()
}

fn options() -> Options {
    Options { speed: 1.0, executable: std::env::current_exe().unwrap(), state: None, fresh: false, files: Vec::new() }
}

/// Where silence is tested, a process may be silent for this long.
const HEARTBEAT_TIMEOUT: Duration = Duration::from_secs(2);

/// A deployment of children, in start order, of which the last ends the run. Its supervisor waits longer for each than a busy machine
/// keeps a process from its work, so that none is taken for hung.
fn settings(behaviours: &[&str]) -> String {
    settings_with(behaviours, &[])
}

/// The same with other values of `[supervisor]`.
fn settings_with(behaviours: &[&str], supervisor: &[(&str, f64)]) -> String {
    let executable = std::env::current_exe().unwrap();
    let mut text = "name = \"test\"\n[supervisor]\n".to_owned();
    let patient = [("startup_deadline_s", 60.0), ("heartbeat_timeout_s", 60.0), ("stop_deadline_s", 60.0), ("restarts", 3.0)];
    for (key, value) in patient {
        let value = supervisor.iter().find(|it| it.0 == key).map_or(value, |it| it.1);
        text += &if key == "restarts" { format!("{key} = {value}\n") } else { format!("{key} = {value:?}\n") };
    }
    for (index, behaviour) in behaviours.iter().enumerate() {
        let ends_run = index + 1 == behaviours.len();
        let mut command = vec![executable.to_str().unwrap().to_owned(), "child".to_owned(), (*behaviour).to_owned()];
        if *behaviour == "runs" {
            command.push(pipe_path("runs").to_str().unwrap().to_owned());
        }
        text += &format!("[[process]]\nname = \"{behaviour}\"\ncommand = {command:?}\nends_run = {ends_run}\n");
    }
    text
}

fn supervise(behaviours: &[&str]) -> (Outcome, Vec<DeploymentStatus>) {
    supervise_text(&settings(behaviours))
}

fn supervise_text(text: &str) -> (Outcome, Vec<DeploymentStatus>) {
    let mut statuses = Vec::new();
    let outcome = run(&Settings::parse("test", text).unwrap(), &options(), &mut |report| {
        if let Report::Status(status) = report {
            statuses.push(*status);
        }
    });
    (outcome.unwrap(), statuses)
}

fn restarts(outcome: &Outcome, name: &str) -> u32 {
    outcome.processes.iter().find(|it| it.name == name).unwrap().restarts
}

fn a_run_ends_when_its_source_does() {
    let (outcome, statuses) = supervise(&["waits", "counts"]);
    assert_eq!((outcome.ending, outcome.exit_code()), (Ending::Complete, 0));
    assert_eq!(outcome.map.unwrap().scans, 20);
    assert!(outcome.failures().next().is_none());
    let last = statuses.last().unwrap();
    let states: Vec<u32> = last.processes.iter().take(2).map(|it| it.state).collect();
    assert_eq!(states, [ProcessState::Finished as u32; 2]);
    let running = statuses.iter().find(|status| status.processes[..2].iter().all(|it| it.state == ProcessState::Running as u32)).unwrap();
    assert!(running.processes[..2].iter().all(|it| it.pid != 0));
    assert_eq!(running.count, 2);
}

fn killed_processes_come_back() {
    let (outcome, _) = supervise(&["dies-once", "ends-after-a-restart"]);
    assert_eq!((outcome.exit_code(), restarts(&outcome, "dies-once"), restarts(&outcome, "ends-after-a-restart")), (0, 1, 0));
}

fn a_hung_process_is_killed() {
    let timeout = [("heartbeat_timeout_s", HEARTBEAT_TIMEOUT.as_secs_f64())];
    let (outcome, statuses) = supervise_text(&settings_with(&["hangs-once", "ends-after-a-restart"], &timeout));
    assert_eq!((outcome.exit_code(), restarts(&outcome, "hangs-once")), (0, 1));
    let noted = statuses.iter().any(|it| it.processes[0].note.as_str().starts_with("gave no sign of life for"));
    assert!(noted, "the status says why");
}

fn a_process_that_keeps_dying_fails() {
    let (outcome, _) = supervise(&["dies", "ends-after-a-failure"]);
    assert_eq!((outcome.ending, outcome.exit_code(), restarts(&outcome, "dies")), (Ending::Complete, 3, 3));
    let failures: Vec<_> = outcome.failures().collect();
    assert_eq!(failures, [("dies", "ended with exit code 7; 3 restarts in 30 s were not enough")]);
}

fn a_requested_restart_counts_for_no_budget() {
    let text = settings_with(&["waits", "ends-after-a-restart"], &[("restarts", 0.0)]);
    let mut requested = false;
    let outcome = run(&Settings::parse("test", &text).unwrap(), &options(), &mut |report| {
        let Report::Status(status) = report else { return };
        if !requested && status.processes[..2].iter().all(|it| it.state == ProcessState::Running as u32) {
            let domain = RunningDomain::all().unwrap().pop().unwrap();
            // A name that no process has is ignored.
            request_restart(domain.directory(), "nothing").unwrap();
            request_restart(domain.directory(), "waits").unwrap();
            requested = true;
        }
    });
    let outcome = outcome.unwrap();
    assert_eq!((outcome.exit_code(), restarts(&outcome, "waits"), restarts(&outcome, "ends-after-a-restart")), (0, 1, 0));
}

fn each_event_starts_the_program_once() {
    let events = std::env::current_dir().unwrap().join("events");
    let script = "echo $STILLMAP_DEPLOYMENT $STILLMAP_EVENT $STILLMAP_EVENT_PROCESS: $STILLMAP_EVENT_MESSAGE >> \"$0\"";
    let hook = format!("[supervisor]\non_event = [\"sh\", \"-c\", {script:?}, {events:?}]");
    let (outcome, _) = supervise_text(&settings(&["dies", "ends-after-a-failure"]).replace("[supervisor]", &hook));
    assert_eq!(outcome.exit_code(), 3);
    let said = std::fs::read_to_string(events).unwrap();
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!(lines.len(), 4, "{said}");
    assert!(lines[..3].iter().all(|line| line.starts_with("test degraded dies: ended with exit code 7; starts again in ")), "{said}");
    assert_eq!(lines[3], "test failed dies: failed: ended with exit code 7; 3 restarts in 30 s were not enough");
}

fn a_program_for_events_that_hangs_is_killed() {
    let pids = std::env::current_dir().unwrap().join("pids");
    let hook = format!("[supervisor]\non_event = [\"sh\", \"-c\", \"echo $$ >> \\\"$0\\\"; exec sleep 3600\", {pids:?}]");
    let (outcome, _) = supervise_text(&settings(&["dies", "ends-after-a-failure"]).replace("[supervisor]", &hook));
    assert_eq!((outcome.ending, outcome.exit_code()), (Ending::Complete, 3));
    let first: i32 = std::fs::read_to_string(pids).unwrap().lines().next().unwrap().parse().unwrap();
    assert!(rustix::process::test_kill_process(Pid::from_raw(first).unwrap()).is_err(), "it outlives its time");
}

fn bad_input_ends_the_run_at_once() {
    let (outcome, _) = supervise(&["waits", "refuses"]);
    assert_eq!((outcome.ending, outcome.exit_code()), (Ending::BadInput { process: 1 }, 2));
    assert_eq!(restarts(&outcome, "refuses"), 0);
}

fn a_broken_domain_is_made_anew() {
    let (outcome, _) = supervise(&["waits", "finds-broken-once"]);
    assert_eq!((outcome.ending, outcome.exit_code()), (Ending::Complete, 0));
    assert_eq!((restarts(&outcome, "waits"), restarts(&outcome, "finds-broken-once")), (1, 1));
}

fn a_child_that_ignores_sigterm_is_killed() {
    let (outcome, _) = supervise_text(&settings_with(&["ignores-sigterm", "counts"], &[("stop_deadline_s", 1.0)]));
    assert_eq!((outcome.ending, outcome.exit_code()), (Ending::Complete, 3));
    assert_eq!(outcome.failures().collect::<Vec<_>>(), [("ignores-sigterm", "had to be killed when the run ended")]);
}

fn a_child_that_is_asked_twice_ends_in_order() {
    // The group is asked by the supervisor, the child in it once more by its script.
    let script = "\"$0\" child takes-its-time & child=$!; trap 'kill -TERM $child' TERM; wait $child; wait $child";
    let wrapped = format!("[[process]]\nname = \"wrapped\"\ncommand = [\"sh\", \"-c\", {script:?}, {:?}]\n", options().executable);
    let (outcome, _) = supervise_text(&settings(&["counts"]).replacen("[[process]]", &format!("{wrapped}[[process]]"), 1));
    assert_eq!((outcome.ending, outcome.exit_code()), (Ending::Complete, 0), "{:?}", outcome.failures().collect::<Vec<_>>());
}

fn a_program_that_is_not_there_fails() {
    let text = settings(&["ends-after-a-failure"]) + "[[process]]\nname = \"nothing\"\ncommand = [\"/nowhere/at/all\"]\n";
    let (outcome, _) = supervise_text(&text);
    let (name, cause) = outcome.failures().next().unwrap();
    assert_eq!((name, restarts(&outcome, "nothing")), ("nothing", 1));
    assert!(cause.starts_with("could not be started: ") && cause.contains("not started again"), "{cause}");
}

fn a_flood_of_words_stops_no_process() {
    let (outcome, _) = supervise(&["floods", "counts"]);
    assert_eq!((outcome.exit_code(), restarts(&outcome, "floods"), restarts(&outcome, "counts")), (0, 0, 0));
}

fn a_process_that_never_joins_fails() {
    let (outcome, _) = supervise_text(&settings_with(&["never-joins", "counts"], &[("restarts", 0.0), ("startup_deadline_s", 2.0)]));
    assert_eq!(outcome.exit_code(), 3);
    let (name, cause) = outcome.failures().next().unwrap();
    assert_eq!(name, "never-joins");
    assert!(cause.starts_with("gave no sign of life within 2.0 s of its start"), "{cause}");
}

fn nonsense_is_refused_and_named() {
    let (outcome, statuses) = supervise(&["listens", "talks-nonsense"]);
    assert_eq!((outcome.exit_code(), restarts(&outcome, "listens"), restarts(&outcome, "talks-nonsense")), (0, 0, 0));
    assert!(statuses.iter().any(|it| names_its_refusals(&it.processes[0])), "{:?}", statuses.last().map(|it| it.processes[0]));
    assert!(statuses.iter().all(|it| it.processes[0].received == 0), "none of it was taken");
}

fn names_its_refusals(process: &ProcessStatus) -> bool {
    process.refused > 0 && process.note.as_str().contains("of robot/scan; at work")
}

fn a_flood_of_messages_stops_no_process() {
    let (outcome, _) = supervise(&["listens", "floods-the-bus"]);
    assert_eq!((outcome.exit_code(), restarts(&outcome, "listens"), restarts(&outcome, "floods-the-bus")), (0, 0, 0));
}

/// A supervisor in a process of its own, with a deployment that runs until it is told to end. It does not outlive a test that fails.
struct Supervisor(std::process::Child);

impl Supervisor {
    fn start(text: &str) -> Self {
        Self::start_by("supervise", text)
    }

    fn start_by(word: &str, text: &str) -> Self {
        let mut command = std::process::Command::new(std::env::current_exe().unwrap());
        Self(command.args([word, text]).stdout(Stdio::piped()).spawn().unwrap())
    }

    fn signal(&self, signal: Signal) {
        kill_process(Pid::from_child(&self.0), signal).unwrap();
    }

    /// Waits for its end: its exit code, and what it wrote.
    fn end(mut self) -> (Option<i32>, String) {
        let mut said = String::new();
        self.0.stdout.take().unwrap().read_to_string(&mut said).unwrap();
        (self.0.wait().unwrap().code(), said)
    }

    /// Stops it in order.
    fn stop(self) -> (Option<i32>, String) {
        self.signal(Signal::TERM);
        self.end()
    }
}

impl Drop for Supervisor {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn runtime() -> PathBuf {
    PathBuf::from(std::env::var_os("STILLMAP_RUNTIME_DIR").unwrap())
}

/// What the supervisor of the one running deployment publishes. A member of the deployment, which must leave before that ends.
struct Statuses {
    observer: Observer,
    reader: Reader<DeploymentStatus>,
}

impl Statuses {
    fn join() -> Self {
        let domain = RunningDomain::all().unwrap().pop().unwrap();
        let mut observer = Observer::join(&domain).unwrap();
        Self { reader: observer.reader().unwrap(), observer }
    }

    /// Waits for a status; the uptime of the newest that has come, ms.
    fn uptime_ms(&mut self) -> u64 {
        let mut newest = None;
        while newest.is_none() {
            self.observer.wait(Duration::from_secs(1)).unwrap();
            while let Some(received) = self.reader.take().unwrap() {
                if let Received::Message(status) = received {
                    newest = Some(status.uptime_ms);
                }
            }
        }
        newest.unwrap()
    }

    fn wait_until(&mut self, uptime_ms: u64) {
        while self.uptime_ms() < uptime_ms {}
    }

    /// Waits until the supervisor has looked at everything that it looks at once a second. The newest status is at most a second old:
    /// when two more seconds are over, it has looked once more.
    fn wait_for_a_look(&mut self) {
        let now_ms = self.uptime_ms();
        self.wait_until(now_ms + 2_000);
    }
}

fn a_supervisor_that_was_stopped_takes_no_process_for_hung() {
    let up = Announcement::new("runs");
    let timeout = [("heartbeat_timeout_s", HEARTBEAT_TIMEOUT.as_secs_f64())];
    let supervisor = Supervisor::start(&settings_with(&["waits", "waits-too", "runs"], &timeout));
    up.line();
    let mut statuses = Statuses::join();
    let before_ms = statuses.uptime_ms();
    supervisor.signal(Signal::STOP);
    // The passing of time is what is tested.
    std::thread::sleep(2 * HEARTBEAT_TIMEOUT);
    supervisor.signal(Signal::CONT);
    statuses.wait_until(before_ms + 2 * HEARTBEAT_TIMEOUT.as_millis() as u64);
    statuses.wait_for_a_look();
    drop(statuses);
    let (code, said) = supervisor.stop();
    assert_eq!((code, said.matches("restarts: 0").count()), (Some(0), 3), "{said}");
}

/// A visitor of the deployment of this name: says whether it found a place, and keeps it.
fn visit(name: &str) -> ExitCode {
    let domain = RunningDomain::all().unwrap().into_iter().find(|it| it.name() == name).unwrap();
    let mut tool = Observer::join(&domain).unwrap();
    let place = tool.reader::<DeploymentStatus>();
    println!("{}", if place.is_ok() { "in" } else { "refused" });
    hang()
}

/// A visitor, and whether it found a place.
fn visitor() -> (std::process::Child, bool) {
    let mut command = std::process::Command::new(std::env::current_exe().unwrap());
    let mut child = command.args(["visit", "test"]).stdout(Stdio::piped()).spawn().unwrap();
    let mut said = String::new();
    BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut said).unwrap();
    (child, said == "in\n")
}

fn visitors_that_were_killed_take_no_place_for_long() {
    let up = Announcement::new("runs");
    let supervisor = Supervisor::start(&settings(&["waits", "runs"]));
    up.line();
    let mut statuses = Statuses::join();
    let mut visitors = vec![];
    while visitors.last().is_none_or(|(_, is_in)| *is_in) {
        visitors.push(visitor());
    }
    for (mut visitor, _) in visitors {
        visitor.kill().unwrap();
        visitor.wait().unwrap();
    }
    statuses.wait_for_a_look();
    let (mut visitor, is_in) = visitor();
    visitor.kill().unwrap();
    visitor.wait().unwrap();
    drop(statuses);
    supervisor.stop();
    assert!(is_in, "the places of killed visitors are taken");
}

fn nothing_outlives_a_killed_supervisor() {
    is_gone_with_its_supervisor(&settings(&["waits", "runs"]), &Announcement::new("runs"));
}

fn what_a_child_started_outlives_no_killed_supervisor() {
    let up = Announcement::new("grandchild");
    let script = "sleep 100000 & echo $! > $0; wait";
    let starts = format!("[[process]]\nname = \"starts\"\ncommand = [\"sh\", \"-c\", {script:?}, {:?}]\n", up.path);
    is_gone_with_its_supervisor(&(settings(&[]) + &starts), &up);
}

/// A process that starts another in a session of its own, which announces its id; `then` is what it does after that.
fn starts_a_session(up: &Announcement, then: &str) -> String {
    let script = format!("setsid sh -c 'echo $$ > $0; exec sleep 100000' $0 & {then}");
    format!("[[process]]\nname = \"starts\"\ncommand = [\"sh\", \"-c\", {script:?}, {:?}]\n", up.path)
}

fn a_session_of_its_own_outlives_no_killed_supervisor() {
    let up = Announcement::new("session");
    is_gone_with_its_supervisor(&(settings(&[]) + &starts_a_session(&up, "wait")), &up);
}

fn a_session_of_its_own_outlives_no_process_that_dies() {
    let (up, die) = (Announcement::new("session"), Announcement::new("die"));
    let starts = starts_a_session(&up, &format!("read word < {}; exit 7", die.path.display()));
    let text = settings_with(&["waits", "runs"], &[("restarts", 0.0)]).replacen("[[process]]", &format!("{starts}[[process]]"), 1);
    let _running = Announcement::new("runs");
    let supervisor = Supervisor::start(&text);
    let session = Exit::of(up.line().parse().unwrap());
    die.announce("now");
    session.wait();
    assert_eq!(supervisor.stop().0, Some(3));
}

fn orphans_that_end_are_no_zombies() {
    let (up, leave, end) = (Announcement::new("orphan"), Announcement::new("leave"), Announcement::new("end"));
    // The orphan announces its parent and itself. Its parent ends when told to, and the orphan after that.
    let orphan = "echo $PPID $$ > $0; read word < $1";
    let parent = format!("sh -c '{orphan}' $0 $2 & read word < $1");
    let script = "sh -c \"$3\" $0 $1 $2 & exec sleep 100000";
    let command = ["sh", "-c", script].map(str::to_owned).into_iter();
    let paths = [&up, &leave, &end].map(|it| it.path.to_str().unwrap().to_owned());
    let command: Vec<String> = command.chain(paths).chain([parent]).collect();
    let text = settings(&[]) + &format!("[[process]]\nname = \"starts\"\ncommand = {command:?}\n");
    let supervisor = Supervisor::start_by("supervise-orphans", &text);
    let line = up.line();
    let ids: Vec<i32> = line.split(' ').map(|id| id.parse().unwrap()).collect();
    let [parent, orphan] = [ids[0], ids[1]].map(Exit::of);
    leave.announce("now");
    parent.wait();
    end.announce("now");
    orphan.wait();
    let mut statuses = Statuses::join();
    statuses.wait_for_a_look();
    assert!(!Path::new("/proc").join(ids[1].to_string()).exists(), "a zombie");
    drop(statuses);
    supervisor.stop();
}

/// Kills the supervisor once a process that is to die of it has announced its id.
fn is_gone_with_its_supervisor(text: &str, up: &Announcement) {
    let supervisor = Supervisor::start(text);
    let process = Exit::of(up.line().parse().unwrap());
    assert!(!process.has_come());
    let children = std::fs::read_to_string(format!("/proc/{0}/task/{0}/children", supervisor.0.id())).unwrap();
    // Its guard, which removes the domain, is among them.
    let children: Vec<Exit> = children.split_ascii_whitespace().map(|id| Exit::of(id.parse().unwrap())).collect();
    drop(supervisor);
    process.wait();
    children.iter().for_each(Exit::wait);
}

/// Nothing here takes so long; a test that waits for it hangs.
const WATCHDOG: Duration = Duration::from_secs(60);

/// Waits until a descriptor is readable.
#[track_caller]
fn wait_for(descriptor: impl AsFd, what: &str) {
    let watchdog = Timespec { tv_sec: WATCHDOG.as_secs() as i64, tv_nsec: 0 };
    assert_eq!(poll(&mut [PollFd::new(&descriptor, PollFlags::IN)], Some(&watchdog)).unwrap(), 1, "never: {what}");
}

/// Where a pipe of this name is.
fn pipe_path(name: &str) -> PathBuf {
    runtime().with_file_name(name)
}

/// A named pipe by which a process announces something in a line.
struct Announcement {
    path: PathBuf,
    pipe: File,
}

impl Announcement {
    fn new(name: &str) -> Self {
        let path = pipe_path(name);
        mkfifoat(CWD, &path, Mode::RUSR | Mode::WUSR).unwrap();
        // Open at both ends, so that no process waits for the other when it opens its end.
        Self { pipe: OpenOptions::new().read(true).write(true).open(&path).unwrap(), path }
    }

    /// Waits for a line; a pipe takes it in one piece.
    #[track_caller]
    fn line(&self) -> String {
        wait_for(&self.pipe, &format!("an announcement in {}", self.path.display()));
        let mut line = [0; 256];
        let count = (&self.pipe).read(&mut line).unwrap();
        String::from_utf8_lossy(&line[..count]).trim_end().to_owned()
    }

    fn announce(&self, line: &str) {
        writeln!(&self.pipe, "{line}").unwrap();
    }
}

impl Drop for Announcement {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

/// The exit of a process that need not be a child of this one; `None` when it is gone already.
struct Exit(Option<OwnedFd>);

impl Exit {
    fn of(id: i32) -> Self {
        match pidfd_open(Pid::from_raw(id).unwrap(), PidfdFlags::empty()) {
            Ok(descriptor) => Self(Some(descriptor)),
            Err(rustix::io::Errno::SRCH) => Self(None),
            Err(error) => panic!("process {id}: {error}"),
        }
    }

    fn has_come(&self) -> bool {
        let now = Timespec { tv_sec: 0, tv_nsec: 0 };
        self.0.as_ref().is_none_or(|exit| poll(&mut [PollFd::new(exit, PollFlags::IN)], Some(&now)).unwrap() == 1)
    }

    #[track_caller]
    fn wait(&self) {
        if let Some(exit) = &self.0 {
            wait_for(exit, "a process exits");
        }
    }
}

/// What a process does that hangs. It is killed long before the end of this.
fn hang() -> ! {
    std::thread::sleep(WATCHDOG);
    panic!("still here");
}

fn child(behaviour: &str, announcement: Option<&Path>) -> ExitCode {
    let membership = Membership::from_env().unwrap();
    let first = membership.incarnation() == 0;
    if behaviour == "refuses" {
        eprintln!("settings.toml:3: refused");
        return ExitCode::from(2);
    }
    if behaviour == "never-joins" {
        hang();
    }
    let mut shell = Shell::join(membership).unwrap();
    if behaviour == "finds-broken-once" {
        let mut checkpoint = shell.checkpoint();
        let restored = checkpoint.restore(|saved| Ok::<_, String>(saved.state.to_vec()));
        assert_eq!(restored.is_some(), !first, "the checkpoints of the run outlive its bus");
        checkpoint.save(b"restored");
    }
    let work = match behaviour {
        "counts" => Work::Counts { rounds: 20, every: Duration::from_millis(10) },
        "ends-after-a-restart" => Work::Ends(shell.reader().unwrap(), |it| it.restarts == 1 && it.state == ProcessState::Running as u32),
        "ends-after-a-failure" => Work::Ends(shell.reader().unwrap(), |it| it.state == ProcessState::Failed as u32),
        "dies" => Work::Exits(7),
        "dies-once" if first => Work::Kills,
        "hangs-once" if first => Work::Hangs,
        "finds-broken-once" if first => Work::Exits(bus::EXIT_BROKEN_DOMAIN),
        "finds-broken-once" => Work::Counts { rounds: 1, every: Duration::ZERO },
        "ignores-sigterm" => Work::Ignores,
        "takes-its-time" => Work::TakesItsTime { rounds: 30 },
        "floods" => Work::Floods,
        "listens" => Work::Listens(shell.reader().unwrap()),
        "talks-nonsense" => Work::TalksNonsense(shell.reader().unwrap()),
        "floods-the-bus" => Work::FloodsTheBus,
        "runs" => {
            let mut announcement = OpenOptions::new().write(true).open(announcement.unwrap()).unwrap();
            announcement.write_all(format!("{}\n", std::process::id()).as_bytes()).unwrap();
            Work::Waits
        }
        _ => Work::Waits,
    };
    let mut process = Child { work, scans: shell.writer().unwrap(), summaries: shell.writer().unwrap(), seq: 0 };
    shell.run(&mut process).unwrap();
    ExitCode::SUCCESS
}

enum Work {
    Waits,
    Counts {
        rounds: u64,
        every: Duration,
    },
    /// Finishes once the status of a process is as wanted.
    Ends(Reader<DeploymentStatus>, fn(&ProcessStatus) -> bool),
    Exits(u8),
    Kills,
    Hangs,
    Ignores,
    TakesItsTime {
        rounds: u64,
    },
    Floods,
    Listens(Reader<SonarScan>),
    /// Until a process has named what it refuses.
    TalksNonsense(Reader<DeploymentStatus>),
    FloodsTheBus,
}

/// Whether a process was as wanted in a status that has come.
fn any_is(statuses: &mut Reader<DeploymentStatus>, wanted: fn(&ProcessStatus) -> bool) -> Result<bool, StepError> {
    while let Some(received) = statuses.take()? {
        if matches!(received, Received::Message(status) if status.processes().iter().any(wanted)) {
            return Ok(true);
        }
    }
    Ok(false)
}

struct Child {
    work: Work,
    scans: bus::Writer<SonarScan>,
    summaries: bus::Writer<MapSummary>,
    seq: u64,
}

impl Process for Child {
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError> {
        self.seq += 1;
        context.note("at work");
        match &mut self.work {
            Work::Counts { rounds, .. } if self.seq > *rounds => {
                self.scans.end(self.seq - 1, 0)?;
                self.summaries.send(1, 0, &MapSummary { scans: *rounds, ..MapSummary::default() })?;
                return Ok(Next::Finished);
            }
            Work::Counts { every, .. } => {
                self.scans.send(self.seq, 0, &SonarScan::default())?;
                return Ok(Next::WaitAtMost(*every));
            }
            Work::Listens(scans) => while scans.take()?.is_some() {},
            Work::Ends(statuses, wanted) => {
                return Ok(if any_is(statuses, *wanted)? { Next::Finished } else { Next::Wait });
            }
            Work::TalksNonsense(statuses) => {
                if any_is(statuses, names_its_refusals)? {
                    return Ok(Next::Finished);
                }
                let pose = messages::Pose { x_m: f64::NAN, ..messages::Pose::default() };
                self.scans.send(self.seq, self.seq, &SonarScan { pose, ..SonarScan::default() })?;
                return Ok(Next::WaitAtMost(Duration::from_millis(10)));
            }
            Work::FloodsTheBus if self.seq > 100 => return Ok(Next::Finished),
            Work::FloodsTheBus => {
                for message in 1..=1_000 {
                    self.scans.send(self.seq * 1_000 + message, self.seq, &SonarScan::default())?;
                }
                return Ok(Next::Again);
            }
            // The first rounds are as they should be.
            _ if self.seq < 5 => return Ok(Next::Again),
            Work::Exits(code) => std::process::exit(i32::from(*code)),
            Work::Kills => rustix::process::kill_process(rustix::process::getpid(), rustix::process::Signal::KILL)?,
            Work::Hangs => hang(),
            Work::Ignores => return Ok(Next::Wait),
            Work::TakesItsTime { rounds } if context.stopping() && *rounds > 0 => {
                *rounds -= 1;
                return Ok(Next::WaitAtMost(Duration::from_millis(10)));
            }
            Work::Floods => eprintln!("{}", "x".repeat(100_000)),
            Work::Waits | Work::TakesItsTime { .. } => {}
        }
        Ok(if context.stopping() { Next::Finished } else { Next::Wait })
    }
}
