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

use bus::{Membership, Received, RunningDomain};
use messages::{DeploymentStatus, MapSummary, ProcessState, SonarScan};
use runtime::{Context, Next, Observer, Process, Shell, StepError};
use rustix::process::{Pid, Signal, kill_process};
use settings::Settings;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{ExitCode, Stdio};
use std::time::{Duration, Instant};
use stillmap_supervisor::{Ending, Options, Outcome, Report, guard, run};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words[..] {
        ["child", behaviour] => child(behaviour),
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
    ("bad_input_ends_the_run_at_once", bad_input_ends_the_run_at_once),
    ("a_broken_domain_is_made_anew", a_broken_domain_is_made_anew),
    ("a_child_that_ignores_sigterm_is_killed", a_child_that_ignores_sigterm_is_killed),
    ("a_child_that_is_asked_twice_ends_in_order", a_child_that_is_asked_twice_ends_in_order),
    ("a_program_that_is_not_there_fails", a_program_that_is_not_there_fails),
    ("a_flood_of_words_stops_nobody", a_flood_of_words_stops_nobody),
    ("a_process_that_never_joins_fails", a_process_that_never_joins_fails),
    ("nonsense_is_refused_and_named", nonsense_is_refused_and_named),
    ("a_flood_of_messages_stops_nobody", a_flood_of_messages_stops_nobody),
    ("who_was_heard_while_the_supervisor_stood_still_does_not_hang", who_was_heard_while_the_supervisor_stood_still_does_not_hang),
    ("visitors_that_were_killed_take_no_place_for_long", visitors_that_were_killed_take_no_place_for_long),
    ("nothing_outlives_a_killed_supervisor", nothing_outlives_a_killed_supervisor),
    ("what_a_child_started_outlives_no_killed_supervisor", what_a_child_started_outlives_no_killed_supervisor),
    ("a_session_of_its_own_outlives_no_killed_supervisor", a_session_of_its_own_outlives_no_killed_supervisor),
    ("a_session_of_its_own_outlives_no_process_that_dies", a_session_of_its_own_outlives_no_process_that_dies),
    ("orphans_that_end_are_no_zombies", orphans_that_end_are_no_zombies),
];

fn all_tests() -> ExitCode {
    let runtime = std::env::temp_dir().join(format!("stillmap-supervisor-test-{}", std::process::id()));
    std::fs::create_dir_all(&runtime).unwrap();
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
    std::fs::remove_dir_all(&runtime).unwrap();
    ExitCode::SUCCESS
}

fn left_in(folder: &Path) -> Vec<PathBuf> {
    std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect()
}

fn options() -> Options {
    Options { speed: 1.0, executable: std::env::current_exe().unwrap(), state: None, fresh: false }
}

const HEARTBEAT_TIMEOUT: Duration = Duration::from_secs(1);

/// A deployment of children, in start order, of which the last ends the run.
fn settings(behaviours: &[&str]) -> String {
    let executable = std::env::current_exe().unwrap();
    let mut text = format!(
        "name = \"test\"\n[supervisor]\nheartbeat_timeout_s = {:?}\nstop_deadline_s = 1.0\nrestarts = 3\n",
        HEARTBEAT_TIMEOUT.as_secs_f64()
    );
    for (index, behaviour) in behaviours.iter().enumerate() {
        let ends_run = index + 1 == behaviours.len();
        text += &format!(
            "[[process]]\nname = \"{behaviour}\"\ncommand = [{executable:?}, \"child\", \"{behaviour}\"]\nends_run = {ends_run}\n"
        );
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
    let (outcome, _) = supervise(&["dies-once", "counts"]);
    assert_eq!((outcome.exit_code(), restarts(&outcome, "dies-once"), restarts(&outcome, "counts")), (0, 1, 0));
}

fn a_hung_process_is_killed() {
    let (outcome, statuses) = supervise(&["hangs-once", "counts-slowly"]);
    assert_eq!((outcome.exit_code(), restarts(&outcome, "hangs-once")), (0, 1));
    let noted = statuses.iter().any(|it| it.processes[0].note.as_str().starts_with("gave no sign of life for"));
    assert!(noted, "the status says why");
}

fn a_process_that_keeps_dying_fails() {
    let (outcome, _) = supervise(&["dies", "counts-slowly"]);
    assert_eq!((outcome.ending, outcome.exit_code(), restarts(&outcome, "dies")), (Ending::Complete, 3, 3));
    let failures: Vec<_> = outcome.failures().collect();
    assert_eq!(failures, [("dies", "ended with exit code 7; 3 restarts in 30 s were not enough")]);
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
    let (outcome, _) = supervise(&["ignores-sigterm", "counts"]);
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
    let text = settings(&["counts-slowly"]) + "[[process]]\nname = \"nothing\"\ncommand = [\"/nowhere/at/all\"]\n";
    let (outcome, _) = supervise_text(&text);
    let (name, cause) = outcome.failures().next().unwrap();
    assert_eq!((name, restarts(&outcome, "nothing")), ("nothing", 1));
    assert!(cause.starts_with("could not be started: ") && cause.contains("not started again"), "{cause}");
}

fn a_flood_of_words_stops_nobody() {
    let (outcome, _) = supervise(&["floods", "counts"]);
    assert_eq!((outcome.exit_code(), restarts(&outcome, "floods"), restarts(&outcome, "counts")), (0, 0, 0));
}

fn a_process_that_never_joins_fails() {
    let text = settings(&["never-joins", "counts"]).replace("restarts = 3", "restarts = 0\nstartup_deadline_s = 2.0");
    let (outcome, _) = supervise_text(&text);
    assert_eq!(outcome.exit_code(), 3);
    let (name, cause) = outcome.failures().next().unwrap();
    assert_eq!(name, "never-joins");
    assert!(cause.starts_with("gave no sign of life within 2.0 s of its start"), "{cause}");
}

fn nonsense_is_refused_and_named() {
    let (outcome, statuses) = supervise(&["listens", "talks-nonsense"]);
    assert_eq!((outcome.exit_code(), restarts(&outcome, "listens"), restarts(&outcome, "talks-nonsense")), (0, 0, 0));
    let named = |it: &DeploymentStatus| it.processes[0].refused > 0 && it.processes[0].note.as_str().contains("of robot/scan; at work");
    assert!(statuses.iter().any(named), "{:?}", statuses.last().map(|it| it.processes[0]));
    assert!(statuses.iter().all(|it| it.processes[0].received == 0), "none of it was taken");
}

fn a_flood_of_messages_stops_nobody() {
    let (outcome, _) = supervise(&["listens", "floods-the-bus"]);
    assert_eq!((outcome.exit_code(), restarts(&outcome, "listens"), restarts(&outcome, "floods-the-bus")), (0, 0, 0));
}

/// A supervisor of its own, with a deployment that runs until it is told to end.
fn start(text: &str) -> std::process::Child {
    let mut command = std::process::Command::new(std::env::current_exe().unwrap());
    command.args(["supervise", text]).stdout(Stdio::piped()).spawn().unwrap()
}

fn runtime() -> PathBuf {
    PathBuf::from(std::env::var_os("STILLMAP_RUNTIME_DIR").unwrap())
}

fn signal(child: &std::process::Child, signal: Signal) {
    kill_process(Pid::from_child(child), signal).unwrap();
}

fn who_was_heard_while_the_supervisor_stood_still_does_not_hang() {
    let supervisor = start(&settings(&["waits", "waits-too", "runs"]));
    wait_until(|| runtime().join("test").join("runs-is-up").exists());
    signal(&supervisor, Signal::STOP);
    // Longer than anybody may be silent.
    let stopped = Instant::now();
    wait_until(|| stopped.elapsed() > 3 * HEARTBEAT_TIMEOUT);
    signal(&supervisor, Signal::CONT);
    signal(&supervisor, Signal::TERM);
    let ended = supervisor.wait_with_output().unwrap();
    let said = String::from_utf8(ended.stdout).unwrap();
    // Who was killed when it went on comes back, or has failed if the run is over by then.
    assert_eq!((ended.status.code(), said.matches("restarts: 0").count()), (Some(0), 3), "{said}");
}

/// A visitor of the deployment of this name: says whether it found a place, and keeps it.
fn visit(name: &str) -> ExitCode {
    let domain = RunningDomain::all().unwrap().into_iter().find(|it| it.name() == name).unwrap();
    let mut tool = Observer::join(&domain).unwrap();
    let place = tool.reader::<DeploymentStatus>();
    println!("{}", if place.is_ok() { "in" } else { "refused" });
    wait_until(|| false);
    ExitCode::SUCCESS
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
    let mut supervisor = start(&settings(&["waits", "runs"]));
    wait_until(|| runtime().join("test").join("runs-is-up").exists());
    let domain = RunningDomain::all().unwrap().pop().unwrap();
    let mut tool = Observer::join(&domain).unwrap();
    let mut statuses = tool.reader::<DeploymentStatus>().unwrap();
    let mut uptime_ms_from = |least_ms: u64| loop {
        tool.wait(Duration::from_secs(1)).unwrap();
        while let Some(received) = statuses.take().unwrap() {
            if let Received::Message(status) = received
                && status.uptime_ms >= least_ms
            {
                return status.uptime_ms;
            }
        }
    };
    let mut visitors = vec![];
    while visitors.last().is_none_or(|(_, is_in)| *is_in) {
        visitors.push(visitor());
    }
    for (mut visitor, _) in visitors {
        visitor.kill().unwrap();
        visitor.wait().unwrap();
    }
    // The supervisor looks once a second: whenever that was, it has looked when two more are over.
    let killed_ms = uptime_ms_from(0);
    let _ = uptime_ms_from(killed_ms + 2_000);
    let (mut visitor, is_in) = visitor();
    visitor.kill().unwrap();
    visitor.wait().unwrap();
    drop((statuses, tool));
    signal(&supervisor, Signal::TERM);
    supervisor.wait().unwrap();
    assert!(is_in, "the places of killed visitors are taken");
}

fn nothing_outlives_a_killed_supervisor() {
    let up = runtime().join("test").join("runs-is-up");
    is_gone_with_its_supervisor(&settings(&["waits", "runs"]), &up);
}

fn what_a_child_started_outlives_no_killed_supervisor() {
    let up = runtime().join("grandchild-is-up");
    let script = "sleep 100000 & echo $! > $0.part; mv $0.part $0; wait";
    let text = format!("name = \"test\"\n[[process]]\nname = \"starts\"\ncommand = [\"sh\", \"-c\", {script:?}, {up:?}]\n");
    is_gone_with_its_supervisor(&text, &up);
}

/// A process that starts another in a session of its own, whose id it writes into the file.
fn starts_a_session(up: &Path) -> String {
    let script = "setsid sh -c 'echo $$ > $0.part; mv $0.part $0; exec sleep 100000' $0 & wait";
    format!("[[process]]\nname = \"starts\"\ncommand = [\"sh\", \"-c\", {script:?}, {up:?}]\n")
}

fn a_session_of_its_own_outlives_no_killed_supervisor() {
    let up = runtime().join("session-is-up");
    is_gone_with_its_supervisor(&format!("name = \"test\"\n{}", starts_a_session(&up)), &up);
}

fn a_session_of_its_own_outlives_no_process_that_dies() {
    let up = runtime().join("session-is-up");
    let starts = starts_a_session(&up).replace("& wait", "& while [ ! -e $0 ]; do :; done; exit 7");
    let text =
        settings(&["waits", "runs"]).replace("restarts = 3", "restarts = 0").replacen("[[process]]", &format!("{starts}[[process]]"), 1);
    let supervisor = start(&text);
    wait_until(|| up.exists());
    let process: i32 = std::fs::read_to_string(&up).unwrap().trim().parse().unwrap();
    wait_until(|| is_dead(process));
    signal(&supervisor, Signal::TERM);
    assert_eq!(supervisor.wait_with_output().unwrap().status.code(), Some(3));
    std::fs::remove_file(up).unwrap();
}

fn orphans_that_end_are_no_zombies() {
    let up = runtime().join("orphan-is-up");
    // The orphan ends once it is told to, which is when its parent has ended.
    let script = "mkfifo $0.end; (sh -c 'echo $$ > $0.part; mv $0.part $0; read word < $0.end' $0 &); sleep 100000";
    let starts = format!("[[process]]\nname = \"starts\"\ncommand = [\"sh\", \"-c\", {script:?}, {up:?}]\n");
    let text = format!("name = \"test\"\n[supervisor]\nstartup_deadline_s = 600\n{starts}");
    let mut command = std::process::Command::new(std::env::current_exe().unwrap());
    let mut supervisor = command.args(["supervise-orphans", &text]).spawn().unwrap();
    wait_until(|| up.exists());
    let orphan = Path::new("/proc").join(std::fs::read_to_string(&up).unwrap().trim());
    let parent = format!("PPid:\t{}\n", supervisor.id());
    wait_until(|| std::fs::read_to_string(orphan.join("status")).unwrap().contains(&parent));
    std::fs::write(up.with_extension("end"), "now\n").unwrap();
    wait_until(|| !orphan.exists());
    signal(&supervisor, Signal::TERM);
    supervisor.wait().unwrap();
    std::fs::remove_file(up.with_extension("end")).unwrap();
    std::fs::remove_file(up).unwrap();
}

/// Kills the supervisor once there is a file with the id of a process that is to die of it.
fn is_gone_with_its_supervisor(text: &str, up: &Path) {
    let mut supervisor = start(text);
    wait_until(|| up.exists());
    let process: i32 = std::fs::read_to_string(up).unwrap().trim().parse().unwrap();
    assert!(!is_dead(process));
    supervisor.kill().unwrap();
    supervisor.wait().unwrap();
    wait_until(|| is_dead(process));
    let _ = std::fs::remove_file(up);
    wait_until(|| left_in(&runtime()).is_empty());
}

/// Gone, or waiting to be buried by the machine's first process, which is none of ours.
fn is_dead(pid: i32) -> bool {
    std::fs::read_to_string(format!("/proc/{pid}/stat")).map_or(true, |stat| stat.contains(") Z "))
}

/// Nothing here takes so long; a test that waits for it hangs.
const WATCHDOG: Duration = Duration::from_secs(60);

#[track_caller]
fn wait_until(condition: impl Fn() -> bool) {
    let since = Instant::now();
    while !condition() {
        assert!(since.elapsed() < WATCHDOG, "this never came");
        std::thread::yield_now();
    }
}

fn child(behaviour: &str) -> ExitCode {
    let membership = Membership::from_env().unwrap();
    let first = membership.incarnation() == 0;
    let directory = membership.directory().to_owned();
    if behaviour == "refuses" {
        eprintln!("settings.toml:3: refused");
        return ExitCode::from(2);
    }
    if behaviour == "never-joins" {
        wait_until(|| false);
    }
    let mut shell = Shell::join(membership).unwrap();
    if behaviour == "finds-broken-once" {
        let mut checkpoint = shell.checkpoint();
        let kept = checkpoint.restore(|saved| Ok::<_, String>(saved.state.to_vec()));
        assert_eq!(kept.is_some(), !first, "the checkpoints of the run outlive its bus");
        checkpoint.save(b"kept");
    }
    let work = match behaviour {
        "counts" => Work::Counts { rounds: 20, every: Duration::from_millis(10) },
        "counts-slowly" => Work::Counts { rounds: 300, every: Duration::from_millis(10) },
        "dies" => Work::Exits(7),
        "dies-once" if first => Work::Kills,
        "hangs-once" if first => Work::Hangs,
        "finds-broken-once" if first => Work::Exits(bus::EXIT_BROKEN_DOMAIN),
        "finds-broken-once" => Work::Counts { rounds: 1, every: Duration::ZERO },
        "ignores-sigterm" => Work::Ignores,
        "takes-its-time" => Work::TakesItsTime { rounds: 30 },
        "floods" => Work::Floods,
        "listens" => Work::Listens(shell.reader().unwrap()),
        "talks-nonsense" => Work::TalksNonsense,
        "floods-the-bus" => Work::FloodsTheBus,
        "runs" => {
            std::fs::write(directory.join("runs-is-up.part"), std::process::id().to_string()).unwrap();
            std::fs::rename(directory.join("runs-is-up.part"), directory.join("runs-is-up")).unwrap();
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
    Counts { rounds: u64, every: Duration },
    Exits(u8),
    Kills,
    Hangs,
    Ignores,
    TakesItsTime { rounds: u64 },
    Floods,
    Listens(bus::Reader<SonarScan>),
    TalksNonsense,
    FloodsTheBus,
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
            Work::TalksNonsense if self.seq > 150 => return Ok(Next::Finished),
            Work::TalksNonsense => {
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
            Work::Hangs => wait_until(|| false),
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
