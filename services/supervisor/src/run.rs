//! The shell around the state machine: children, the bus, the clock, signals.

use crate::child::Child;
use crate::deployment::Deployment;
use crate::disk_sync::DiskSync;
use crate::events::{Action, Event, Notice};
use crate::executable::own_command;
use crate::guard::Guard;
use crate::hook::Hook;
use crate::kernel::check_kernel;
use crate::leftovers::{self, Origin};
use crate::lifecycle::{Exit, Role, State};
use crate::limits::raise_open_files;
use crate::lines::Line;
use crate::notices::SUPERVISOR;
use crate::outcome::Outcome;
use crate::output_lock::OutputFolder;
use crate::patience::{KernelTime, LookClock};
use crate::plan::{plans, policy};
use crate::ports::Ports;
use crate::program::find_program;
use crate::removal::Removal;
use crate::requests::take_restart_requests;
use crate::running::{Options, Report, RunError};
use crate::service::ServiceManager;
use crate::signals::stop_requests;
use crate::vitals::{MachineUnits, Vitals};
use crate::watch::{Watch, free_mb};
use bus::{DeploymentClock, Domain, DomainError, Received, RunningDomain, shared_memory_is_short};
use messages::{DeploymentStatus, Heartbeat, MAX_PROCESSES, MapSummary, Phase, Service, Text};
use runtime::{CheckpointSets, PersistedState, RunState};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::Signal;
use settings::{BuiltIn, Program, RoutedService, Settings};
use std::collections::VecDeque;
use std::io::{self, Read};
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};
use tracing::Level;

/// How often heartbeats are looked at; they end no wait.
const LOOK: Duration = Duration::from_millis(100);
/// The same while a process starts: its first heartbeat lets the next one start.
const LOOK_AT_START: Duration = Duration::from_millis(10);
/// How often the status is published when nothing changes, and rates are measured.
const SAMPLE: Duration = Duration::from_secs(1);

/// Bytes of a simulated picture.
const SIMULATED_PICTURE: usize = 160 * 120;

/// Allocates the recorder's large pieces of memory outside of the heap (glibc, see mallopt(3)). Chunks of a megabyte are allocated
/// and freed there among what stays; in the heap they leave holes that nothing fills, 1.7 MB in an hour of driving.
const PIECES_APART: (&str, &str) = ("MALLOC_MMAP_THRESHOLD_", "131072");

/// How often the files of the domain are looked for.
const LOOK_FOR_REMOVED: Duration = Duration::from_millis(500);
/// How often shared memory is looked at while there is none.
const LOOK_AT_MEMORY: Duration = Duration::from_millis(50);

/// Runs a deployment to its end: until a process that ends the run has finished, or a signal asks for it (SIGINT, SIGTERM, SIGHUP).
///
/// To be called from the main thread: children die when the thread that started them ends.
///
/// # Errors
/// When the deployment cannot be started, or the supervisor itself fails; no child lives then.
pub fn run(settings: &Settings, options: &Options, on_report: &mut dyn FnMut(Report<'_>)) -> Result<Outcome, RunError> {
    let mut supervisor = Supervisor::start(settings, options)?;
    let result = supervisor.supervise(on_report);
    supervisor.end(result)
}

struct Supervisor<'a> {
    settings: &'a Settings,
    options: &'a Options,
    started: Instant,
    looks: LookClock,
    stop_requests: UnixStream,
    domain: Domain,
    state: RunState,
    /// Closed only while the domain is made anew.
    ports: Option<Ports>,
    /// No other deployment writes there meanwhile.
    _out: OutputFolder,
    settings_path: PathBuf,
    clock: DeploymentClock,
    guard: Option<Guard>,
    guard_checked: Duration,
    deployment: Deployment,
    children: Vec<Option<Child>>,
    /// The last error that each of them has logged.
    errors: Vec<Option<String>>,
    vitals: Vec<Vitals>,
    units: MachineUnits,
    sampled: Duration,
    statuses: u64,
    removal: Removal,
    /// When files of the domain are looked for again.
    removal_checked: Duration,
    map: Option<MapSummary>,
    watch: Watch,
    hook: Hook,
    service: ServiceManager,
    /// For a run that can be resumed.
    disk: Option<DiskSync>,
}

/// What has to be there before the first process.
struct Prepared {
    settings_path: PathBuf,
    clock: DeploymentClock,
    ports: Ports,
}

impl Prepared {
    fn new(domain: &mut Domain, settings: &Settings, text: &str) -> Result<Self, RunError> {
        domain.check_memory(needed_memory(settings))?;
        let settings_path = domain.directory().join("settings.toml");
        write_settings(&settings_path, text)?;
        let clock = domain.membership_for(SUPERVISOR, 0, &settings_path).clock();
        Ok(Self { ports: Ports::open(domain, clock)?, settings_path, clock })
    }
}

/// Shared memory that a deployment takes while its processes keep up, bytes.
#[must_use]
pub fn needed_memory(settings: &Settings) -> u64 {
    bus::needed_memory(settings.process.len(), largest_picture(settings), &|service| is_sent(settings, service))
}

/// Whether a process of the deployment may send this: a built-in one, or a command in place of one.
fn is_sent(settings: &Settings, service: &Service) -> bool {
    let runs = |sender: &str| BuiltIn::ALL.into_iter().find(|kind| kind.word() == sender).is_none_or(|kind| settings.runs(kind));
    let has_command = settings.process.iter().any(|process| matches!(process.program, Program::Command(_)));
    has_command || service.from.iter().any(|sender| runs(sender))
}

/// Bytes of the largest pictures: those of the camera as its settings have them, in colour, or else those that a simulation makes, in
/// grey.
fn largest_picture(settings: &Settings) -> usize {
    let pixels = settings.camera.width.get() as usize * settings.camera.height.get() as usize;
    if settings.runs(BuiltIn::Camera) { 3 * pixels } else { SIMULATED_PICTURE }
}

/// What the domain's folder holds for the processes; written again when the domain is made anew.
fn write_settings(path: &Path, text: &str) -> Result<(), RunError> {
    std::fs::write(path, text).map_err(|source| RunError::System { what: "the settings of the run", source })
}

impl<'a> Supervisor<'a> {
    fn start(settings: &'a Settings, options: &'a Options) -> Result<Self, RunError> {
        let text = settings.to_toml()?;
        check_kernel()?;
        raise_open_files(settings.process.len())?;
        // Before anything that another deployment may be using is touched.
        let out = OutputFolder::lock(&settings.out).map_err(|error| already_running(settings, error))?;
        for (path, contents) in &options.files {
            std::fs::write(path, contents).map_err(|source| RunError::File { path: path.clone(), source })?;
        }
        let stop_requests = stop_requests().map_err(|source| RunError::System { what: "signals", source })?;
        let routed: Vec<&str> = settings.routed_services().into_iter().map(RoutedService::name).collect();
        let made_with = what_the_map_depends_on(settings)?;
        let persisted = options.state.as_deref().map(|folder| PersistedState { folder, made_with: &made_with, fresh: options.fresh });
        let (state, mut domain) = RunState::open(settings.name.as_str(), options.speed, &routed, persisted)?;
        let prepared = Prepared::new(&mut domain, settings, &text);
        let Prepared { settings_path, clock, ports } = match prepared {
            Ok(prepared) => prepared,
            Err(error) => {
                domain.close()?;
                return Err(error);
            }
        };
        if state.is_resumed() {
            tracing::info!("the last run is resumed, with the map as it was; --fresh begins a new one");
        }
        if state.computer_stopped() {
            let sync_s = settings.supervisor.sync_s.get();
            tracing::warn!(
                "the computer stopped while the last run was running: up to {sync_s} s before that are missing in the log, and up to 64 scans more in the map"
            );
        }
        let disk = options.state.as_ref().and_then(|state| disk_sync(settings, &domain, state, &settings_path));
        let count = settings.process.len();
        let mut supervisor = Self {
            settings,
            options,
            started: Instant::now(),
            looks: LookClock::start(KernelTime::now()),
            stop_requests,
            settings_path,
            clock,
            guard: None,
            guard_checked: Duration::ZERO,
            deployment: Deployment::new(policy(&settings.supervisor), plans(settings), domain.run()),
            domain,
            state,
            ports: Some(ports),
            _out: out,
            children: std::iter::repeat_with(|| None).take(count).collect(),
            errors: vec![None; count],
            vitals: vec![Vitals::default(); count],
            units: MachineUnits { ticks_per_s: rustix::param::clock_ticks_per_second(), page_bytes: rustix::param::page_size() as u64 },
            sampled: Duration::ZERO,
            statuses: 0,
            removal: Removal::default(),
            removal_checked: Duration::ZERO,
            map: None,
            watch: Watch::new(count),
            hook: Hook::new(&settings.supervisor.on_event, settings.name.as_str()),
            service: ServiceManager::of_this_process(),
            disk,
        };
        supervisor.watch_the_guard();
        Ok(supervisor)
    }

    /// The time of deadlines, which does not pass while the supervisor stands still.
    fn now(&self) -> Duration {
        self.looks.now()
    }

    fn supervise(&mut self, on_report: &mut dyn FnMut(Report<'_>)) -> Result<(), RunError> {
        let mut changed = self.feed(Event::Tick)?;
        while !self.deployment.is_over() {
            self.publish_status(changed, on_report)?;
            self.wait()?;
            self.sit_out_full_memory()?;
            self.domain.refresh();
            // However long the supervisor itself could not look: what waits by now was sent in time.
            let standstill = self.looks.look(KernelTime::now());
            let now = self.now();
            changed = standstill.map_or(Ok(false), |standstill| self.feed(Event::StoodStill(standstill)))?;
            changed |= self.take_heartbeats()?;
            changed |= self.take_stop_requests()?;
            changed |= self.take_restart_requests()?;
            self.take_summary(on_report)?;
            changed |= self.take_output_and_exits()?;
            self.look_for_removed_files()?;
            changed |= self.feed_at(Event::Tick, now)?;
            self.watch_the_guard();
            self.hook.advance(&self.domain);
            self.disk.iter_mut().for_each(|disk| disk.advance(now));
            self.service.report(&self.deployment);
        }
        self.take_summary(on_report)?;
        self.publish_status(true, on_report)
    }

    /// Has everything start again in new shared memory where files of the domain were removed.
    fn look_for_removed_files(&mut self) -> Result<bool, RunError> {
        if self.now() < self.removal_checked {
            return Ok(false);
        }
        self.removal_checked = self.now() + LOOK_FOR_REMOVED;
        let Some(path) = self.domain.removed().map(Path::to_owned) else {
            self.removal.nothing(self.domain.state());
            return Ok(false);
        };
        if self.removal.something() {
            self.act(Action::Tell(Notice::Removed { path }))?;
            if let Err(error) = self.domain.lock_again() {
                tracing::warn!("{error}");
            }
        }
        if !self.removal.may_restart(self.domain.state()) {
            return Ok(false);
        }
        self.feed(Event::DomainLost)
    }

    /// Gives the domain back, whatever happened.
    fn end(mut self, result: Result<(), RunError>) -> Result<Outcome, RunError> {
        for child in self.children.iter().flatten() {
            child.signal(Signal::KILL);
        }
        self.children.clear();
        self.hook.finish(&self.domain);
        let outcome = Outcome::of(&self.deployment, self.map);
        drop(self.ports);
        let closed = match self.domain.close() {
            // What has been done is done; the next start removes what is left.
            Err(error @ DomainError::StillInhabited { .. }) => {
                tracing::warn!("{error}; what is left is removed by the next start");
                Ok(())
            }
            closed => closed,
        };
        if let Some(guard) = self.guard {
            guard.dismiss();
        }
        result?;
        closed?;
        // Else what was synced last is what a power cut leaves.
        let is_on_disk = self.disk.is_none_or(|mut disk| disk.finish(|| self.service.alive()));
        if is_on_disk && let Err(error) = self.state.note_end() {
            tracing::debug!("{error}");
        }
        Ok(outcome)
    }

    /// Feeds an event and everything that follows from it; whether anything followed.
    fn feed(&mut self, event: Event) -> Result<bool, RunError> {
        self.feed_at(event, self.now())
    }

    /// As [`Supervisor::feed`], an event of this time.
    fn feed_at(&mut self, event: Event, at: Duration) -> Result<bool, RunError> {
        let mut events = VecDeque::from([(event, at)]);
        let mut acted = false;
        while let Some((event, at)) = events.pop_front() {
            for action in self.deployment.step(event, at) {
                acted = true;
                let follows = self.act(action)?;
                events.extend(follows.map(|event| (event, self.now())));
            }
        }
        Ok(acted)
    }

    /// Does what is to be done; what follows from it.
    fn act(&mut self, action: Action) -> Result<Option<Event>, RunError> {
        match action {
            Action::Spawn { process, incarnation } => match self.spawn(process, incarnation) {
                Ok(child) => {
                    self.vitals[process].begin(self.looks.now());
                    self.errors[process] = None;
                    self.guard.iter_mut().for_each(|guard| guard.take(child.pid()));
                    self.children[process] = Some(child);
                }
                Err(error) => {
                    // It may know of a child that never was.
                    self.guard.iter_mut().for_each(Guard::distrust);
                    self.guard_checked = Duration::ZERO;
                    self.watch_the_guard();
                    return Ok(Some(Event::Exited { process, exit: Exit::NotStarted(error.to_string()) }));
                }
            },
            Action::Terminate(process) => self.signal(process, Signal::TERM),
            Action::Kill(process) => self.signal(process, Signal::KILL),
            Action::Rebuild => {
                self.rebuild_domain()?;
                return Ok(Some(Event::Rebuilt));
            }
            Action::Tell(notice) => {
                self.hook.notice(&notice, &self.deployment);
                self.ports.as_mut().map_or(Ok(()), |ports| ports.log.tell(&notice, &self.deployment))?;
            }
        }
        Ok(None)
    }

    fn rebuild_domain(&mut self) -> Result<(), RunError> {
        let text = self.settings.to_toml()?;
        // What is dropped later would remove what is made now.
        self.ports = None;
        self.domain.rebuild()?;
        self.ports = Some(Ports::open(&mut self.domain, self.clock)?);
        self.removal.nothing(self.domain.state());
        write_settings(&self.settings_path, &text)
    }

    fn spawn(&self, process: usize, incarnation: u32) -> io::Result<Child> {
        let it = &self.settings.process[process];
        let mut command = match &it.program {
            Program::BuiltIn(kind) => {
                let mut command = own_command(&self.options.executable);
                command.args(["process", kind.word()]);
                if *kind == BuiltIn::Recorder {
                    command.env(PIECES_APART.0, PIECES_APART.1);
                }
                command
            }
            Program::Command(words) => {
                let (program, arguments) = words.split_first().ok_or_else(|| io::Error::other("the command is empty"))?;
                find_program(program).map_err(io::Error::other)?;
                let mut command = Command::new(program);
                command.args(arguments);
                command
            }
        };
        command.envs(self.domain.membership_for(it.name.as_str(), incarnation, &self.settings_path).environment());
        self.domain.close_on_exec();
        Child::start(command, self.guard.as_ref().and_then(Guard::pipe))
    }

    fn signal(&self, process: usize, signal: Signal) {
        if let Some(child) = &self.children[process] {
            child.signal(signal);
        }
    }

    fn wait(&self) -> Result<(), RunError> {
        let now = self.now();
        let starting = self.deployment.processes().iter().any(|it| matches!(it.state(), State::Starting { .. }));
        let look = if starting { LOOK_AT_START } else { LOOK };
        let patience = self.deployment.due().map_or(look, |due| due.saturating_sub(now).min(look));
        let timeout = Timespec { tv_sec: 0, tv_nsec: i64::from(patience.subsec_nanos()) };
        let children = self.children.iter().flatten().flat_map(Child::descriptors);
        let waited_for = children.chain(self.domain.descriptors()).chain([self.stop_requests.as_fd()]);
        let mut polled: Vec<PollFd<'_>> = waited_for.map(|fd| PollFd::from_borrowed_fd(fd, PollFlags::IN)).collect();
        match poll(&mut polled, Some(&timeout)) {
            Ok(_) | Err(rustix::io::Errno::INTR) => Ok(()),
            Err(error) => Err(RunError::System { what: "poll", source: error.into() }),
        }
    }

    /// While shared memory is used up, touches none of it, starts nothing and takes no process for hung: a process that needs more of it
    /// is killed, and that may not be the supervisor. The time of the wait counts for no deadline. A request to stop ends the wait.
    fn sit_out_full_memory(&mut self) -> Result<(), RunError> {
        if !shared_memory_is_short() {
            return Ok(());
        }
        let since = Instant::now();
        tracing::warn!("/dev/shm is full: nothing is started until there is room");
        let timeout = Timespec { tv_sec: 0, tv_nsec: i64::from(LOOK_AT_MEMORY.subsec_nanos()) };
        while shared_memory_is_short() {
            self.service.alive();
            let mut stop_asked = [PollFd::new(&self.stop_requests, PollFlags::IN)];
            match poll(&mut stop_asked, Some(&timeout)) {
                Ok(0) | Err(rustix::io::Errno::INTR) => {}
                Ok(_) => break,
                Err(error) => return Err(RunError::System { what: "poll", source: error.into() }),
            }
        }
        self.looks.skip(KernelTime::now());
        tracing::info!("/dev/shm was full for {:.1} s", since.elapsed().as_secs_f64());
        Ok(())
    }

    fn take_stop_requests(&mut self) -> Result<bool, RunError> {
        let mut requests = [0; 16];
        let mut changed = false;
        while let Ok(count @ 1..) = self.stop_requests.read(&mut requests) {
            for _ in 0..count {
                changed |= self.feed(Event::StopAsked)?;
            }
        }
        Ok(changed)
    }

    fn take_restart_requests(&mut self) -> Result<bool, RunError> {
        let mut changed = false;
        for name in take_restart_requests(self.domain.directory()) {
            match self.settings.process.iter().position(|it| it.name.as_str() == name) {
                Some(process) => changed |= self.feed(Event::RestartAsked { process })?,
                None => tracing::warn!("a restart of {name} was requested, which is no process of this deployment"),
            }
        }
        Ok(changed)
    }

    fn take_heartbeat(&mut self) -> Result<Option<Received<bus::Message<Heartbeat>>>, RunError> {
        match self.ports.as_mut().map_or(Ok(None), |ports| ports.heartbeats.take()) {
            Err(error) if error.is_broken_domain() => {
                tracing::warn!("{error}");
                self.feed(Event::DomainLost)?;
                Ok(None)
            }
            taken => Ok(taken?),
        }
    }

    fn take_heartbeats(&mut self) -> Result<bool, RunError> {
        let mut changed = false;
        while let Some(received) = self.take_heartbeat()? {
            let Received::Message(heartbeat) = received else { continue };
            let name = heartbeat.process.as_str();
            let Some(process) = self.settings.process.iter().position(|it| it.name.as_str() == name) else { continue };
            // A heartbeat of a child that is gone is not about the present one.
            if self.children[process].as_ref().is_some_and(|child| child.is(heartbeat.pid)) {
                self.vitals[process].take(&heartbeat, self.looks.now());
                // Until it works, its inputs may not be open yet.
                if heartbeat.phase == Phase::Starting as u32 {
                    continue;
                }
                let work = self.vitals[process].work();
                changed |= self.feed(Event::Heartbeat { process, work, ending: heartbeat.phase == Phase::Ending as u32 })?;
            }
        }
        Ok(changed)
    }

    fn take_summary(&mut self, on_report: &mut dyn FnMut(Report<'_>)) -> Result<(), RunError> {
        while let Some(received) = self.ports.as_mut().map_or(Ok(None), |ports| ports.summaries.take())? {
            if let Received::Message(summary) = received {
                on_report(Report::Map(&summary));
                self.map = Some(*summary);
            }
        }
        Ok(())
    }

    fn take_output_and_exits(&mut self) -> Result<bool, RunError> {
        let mut changed = false;
        for process in 0..self.children.len() {
            let Some(child) = &mut self.children[process] else { continue };
            let name = self.settings.process[process].name.as_str();
            let mut lines = Vec::new();
            child.read_output(|line| lines.push(line.to_owned()));
            let waiting = |source| RunError::System { what: "waiting for a child", source };
            let mut exit = None;
            if child.has_ended().map_err(waiting)? {
                let give_up = |pid| self.guard.iter_mut().for_each(|guard| guard.give_up(pid));
                let origin = Origin { domain: self.domain.directory(), process: Some(name) };
                exit = Some(child.reap(origin, |line| lines.push(line.to_owned()), give_up).map_err(waiting)?);
            }
            if let Some(ports) = &mut self.ports {
                for line in &lines {
                    let line = Line::read(line);
                    ports.log.pass_on(name, &line)?;
                    if line.level == Level::ERROR {
                        self.errors[process] = Some(line.text);
                    }
                }
            }
            if let Some(exit) = exit {
                let exit = match (exit, self.errors[process].take()) {
                    (Exit::Code(code), Some(message)) => Exit::Error { code, message },
                    (exit, _) => exit,
                };
                self.children[process] = None;
                self.vitals[process].end();
                // Without the domain it cannot join again, and would fail twice with the same error before the next look.
                self.removal_checked = Duration::ZERO;
                self.look_for_removed_files()?;
                self.feed(Event::Exited { process, exit })?;
                if self.removal.is_found() {
                    // It could not join again. At the end of a run the others may have no checkpoint to start from any more.
                    if self.deployment.ending().is_none() || self.removal.is_complete(self.domain.state()) {
                        self.feed(Event::DomainLost)?;
                    }
                } else {
                    self.domain.remove_dead_nodes();
                }
                changed = true;
            }
        }
        Ok(changed)
    }

    fn publish_status(&mut self, changed: bool, on_report: &mut dyn FnMut(Report<'_>)) -> Result<(), RunError> {
        let now = self.now();
        let due = now >= self.sampled + SAMPLE;
        if due {
            self.sampled = now;
            if let Err(error) = self.state.note_time(self.clock.now_ns()) {
                tracing::debug!("{error}");
            }
            self.service.alive();
            // An observer is no child: nothing else shows that it was killed.
            if !self.removal.is_found() {
                self.domain.remove_dead_nodes();
            }
            self.reap_strangers();
            for (vitals, child) in self.vitals.iter_mut().zip(&self.children) {
                if let Some(child) = child {
                    vitals.sample(child.usage(), self.units, now);
                }
            }
        }
        if due || changed || self.statuses == 0 {
            let status = self.status(now);
            self.statuses += 1;
            if let Some(ports) = &mut self.ports {
                ports.statuses.send(self.statuses, self.clock.now_ns(), &status)?;
            }
            on_report(Report::Status(&status));
            if due {
                self.report_what_lacks(&status, now)?;
            }
        }
        Ok(())
    }

    /// Reports lost messages, and a disk that is nearly full.
    fn report_what_lacks(&mut self, status: &DeploymentStatus, now: Duration) -> Result<(), RunError> {
        let mut notices = self.watch.losses(status, now);
        if self.watch.disk_is_due(now) {
            let (out, low_mb) = (&self.settings.out, self.settings.supervisor.disk_low_mb.get());
            notices.extend(free_mb(out).and_then(|free_mb| self.watch.disk(out, free_mb, low_mb)));
        }
        notices.into_iter().try_for_each(|notice| self.act(Action::Tell(notice)).map(drop))
    }

    /// No process stays a zombie while the run lasts, whatever started it.
    fn reap_strangers(&self) {
        let children = self.children.iter().flatten().map(Child::pid);
        let known: Vec<u32> = children.chain(self.guard.as_ref().map(Guard::pid)).chain(self.hook.pid()).collect();
        leftovers::reap_strangers(|pid| known.contains(&pid));
    }

    fn status(&self, now: Duration) -> DeploymentStatus {
        let mut status = DeploymentStatus {
            deployment: Text::new(self.settings.name.as_str()),
            uptime_ms: self.started.elapsed().as_millis() as u64,
            ending: u32::from(self.deployment.ending().is_some()),
            ..DeploymentStatus::default()
        };
        let each = self.deployment.processes().iter().zip(&self.vitals).zip(&self.children);
        let all = each.map(|((it, vitals), child)| vitals.status(it, child.as_ref().map_or(0, Child::pid), now));
        for (place, process) in status.processes.iter_mut().zip(all.take(MAX_PROCESSES)) {
            *place = process;
            status.count += 1;
        }
        status
    }

    /// A guard that was killed is replaced: the supervisor may be next.
    fn watch_the_guard(&mut self) {
        let now = self.now();
        if now < self.guard_checked && self.guard.is_some() {
            return;
        }
        self.guard_checked = now + SAMPLE;
        if self.guard.as_mut().is_none_or(|guard| !guard.is_alive()) {
            self.domain.close_on_exec();
            match Guard::start(&self.options.executable, self.domain.directory()) {
                Ok(mut guard) => {
                    self.children.iter().flatten().for_each(|child| guard.take(child.pid()));
                    self.guard = Some(guard);
                }
                Err(error) => tracing::warn!("no guard: a killed supervisor would leave its domain behind: {error}"),
            }
        }
    }
}

/// What brings a run to the disk that can be resumed.
fn disk_sync(settings: &Settings, domain: &Domain, state: &Path, settings_path: &Path) -> Option<DiskSync> {
    let sources = plans(settings).into_iter().filter(|plan| plan.role == Role::Source).map(|plan| plan.name).collect();
    let fallback_folder = domain.membership_for(SUPERVISOR, 0, settings_path).volatile_state();
    match CheckpointSets::open(state, &fallback_folder, sources) {
        Ok(sets) => Some(DiskSync::new(&settings.out, sets, Duration::from_secs_f64(settings.supervisor.sync_s.get()))),
        Err(error) => {
            tracing::warn!("{}: {error}: a power cut takes all of the run", state.display());
            None
        }
    }
}

/// Of two deployments with one name the second has the same folder of outputs, too; that it runs already says more.
fn already_running(settings: &Settings, error: RunError) -> RunError {
    let running = RunningDomain::all().unwrap_or_default();
    match running.into_iter().find(|domain| domain.name() == settings.name.as_str()) {
        Some(domain) if matches!(error, RunError::OutputTaken { .. }) => {
            DomainError::Running { name: domain.name().to_owned(), pid: domain.pid().to_string() }.into()
        }
        Some(_) | None => error,
    }
}

/// The settings under which the state of a run can be resumed: those of the robot, and of what is made of its readings.
fn what_the_map_depends_on(settings: &Settings) -> Result<String, RunError> {
    Ok(Settings { robot: settings.robot.clone(), mapping: settings.mapping.clone(), ..Settings::default() }.to_toml()?)
}
