//! The process `injector`: between publishers and readers, and beside the processes of the deployment.

mod relay;

use ::injector::{Action, Counts, MemoryFill, ProcessAction, Report, Schedule, Source, Target, TargetError, take_requests};
use anyhow::Result;
use bus::{Reader, Received};
use messages::{DeploymentStatus, ProcessStatus};
use relay::Relay;
use runtime::{Checkpoint, Context, Next, Process, Shell, StepError};
use settings::{BuiltIn, Disturbance, Name, Pace, PlannedFault, RoutedService, Settings};
use std::path::PathBuf;
use std::time::Duration;

/// Shortest wait for a due time, so that the process does not spin on times that are nearly due.
const SHORTEST_WAIT: Duration = Duration::from_millis(1);

/// Injects faults until every process that can be affected is over.
///
/// # Errors
/// When the bus fails.
pub(super) fn run(mut shell: Shell, settings: &Settings) -> Result<()> {
    let checkpoint = shell.checkpoint();
    let first_ns = checkpoint.restore_state::<Vec<u64>>().unwrap_or_default();
    let mut relays = Vec::new();
    for service in settings.routed_services() {
        let first_ns = first_ns.get(index_of(service)).copied().filter(|stamp_ns| *stamp_ns > 0);
        relays.push((service, relay::open(&mut shell, service, first_ns, settings.pace == Pace::Lockstep)?));
    }
    let membership = shell.membership();
    let mut injector = Injector {
        relays,
        schedule: Schedule::default(),
        memory: MemoryFill::default(),
        memory_failed: false,
        statuses: Vec::new(),
        unaffected: [BuiltIn::Injector, BuiltIn::Recorder, BuiltIn::Viewer].into_iter().flat_map(|kind| settings.named(kind)).collect(),
        others_are_over: false,
        supervisor: std::os::unix::process::parent_id(),
        domain: membership.directory().to_owned(),
        started: membership.clock(),
        speed: membership.speed(),
        checkpoint,
        saved_ns: first_ns,
        process_actions: 0,
        reader: None,
    };
    // Actions of an earlier incarnation are not repeated.
    let since_s = if membership.incarnation() == 0 { -1.0 } else { membership.clock().elapsed_s() };
    for fault in &settings.fault {
        injector.add_planned(fault, since_s);
    }
    injector.reader = Some(shell.reader()?);
    Ok(shell.run(&mut injector)?)
}

struct Injector {
    relays: Vec<(RoutedService, Box<dyn Relay>)>,
    schedule: Schedule,
    memory: MemoryFill,
    /// Shared memory could not be taken, which is logged once.
    memory_failed: bool,
    /// Processes and their ids, from the newest status.
    statuses: Vec<(String, u32)>,
    /// Processes that run until all others are over.
    unaffected: Vec<String>,
    others_are_over: bool,
    supervisor: u32,
    domain: PathBuf,
    started: bus::DeploymentClock,
    speed: f64,
    checkpoint: Checkpoint,
    /// Stamps of the first messages in the checkpoint.
    saved_ns: Vec<u64>,
    /// Number of actions on processes.
    process_actions: u64,
    reader: Option<Reader<DeploymentStatus>>,
}

impl Process for Injector {
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError> {
        self.read_statuses()?;
        for request in take_requests(&self.domain) {
            match request {
                Ok(fault) => self.add_requested(&fault),
                Err(error) => tracing::warn!("{error}"),
            }
        }
        let now_ns = context.now_ns();
        let mut more = false;
        for (_, relay) in &mut self.relays {
            more |= relay.carry(now_ns)?;
            relay.take_reports().iter().for_each(log);
        }
        self.save();
        self.act();
        self.report(context);
        if more {
            return Ok(Next::Again);
        }
        if context.stopping() || self.others_are_over {
            self.relays.iter_mut().try_for_each(|(_, relay)| relay.flush())?;
            return Ok(Next::Finished);
        }
        Ok(self.wait(now_ns))
    }
}

impl Injector {
    /// Adds a fault of the settings.
    fn add_planned(&mut self, fault: &PlannedFault, since_s: f64) {
        match &fault.disturbance {
            Disturbance::Service { service, fault: kind } => {
                if let Some((_, relay)) = self.relays.iter_mut().find(|(it, _)| it == service) {
                    relay.add(*kind, fault, Source::Settings);
                }
            }
            Disturbance::Process { .. } | Disturbance::Memory => self.schedule.add(fault, Source::Settings, 0.0, since_s),
        }
    }

    /// Adds a fault that was requested; its times count from now.
    fn add_requested(&mut self, fault: &PlannedFault) {
        let now_s = self.started.elapsed_s();
        match &fault.disturbance {
            Disturbance::Service { service, fault: kind } => match self.relays.iter_mut().find(|(it, _)| it == service) {
                Some((_, relay)) => relay.add(*kind, fault, Source::Request),
                None => tracing::warn!("{} is not routed through the injector: add it to [injector] services", service.name()),
            },
            Disturbance::Process { .. } | Disturbance::Memory => self.schedule.add(fault, Source::Request, now_s, -1.0),
        }
    }

    fn read_statuses(&mut self) -> Result<(), StepError> {
        while let Some(received) = self.reader.as_mut().map_or(Ok(None), Reader::take)? {
            let Received::Message(status) = received else { continue };
            let processes = status.processes().iter();
            self.statuses = processes.clone().map(|it| (it.process.as_str().to_owned(), it.pid)).collect();
            let mut others = processes.filter(|it| !self.unaffected.iter().any(|name| name == it.process.as_str()));
            self.others_are_over = status.ending == 1 && others.all(ProcessStatus::is_over);
        }
        Ok(())
    }

    /// Performs the actions that are due on processes and on shared memory.
    fn act(&mut self) {
        for action in self.schedule.due(self.started.elapsed_s()) {
            match action {
                Action::Process(process, action) => match self.act_on(&process, action) {
                    Ok(()) if action == ProcessAction::FillDisk => {}
                    Ok(()) => self.process_actions += 1,
                    Err(error) => tracing::debug!("{}: {action:?}: {error}", process.as_str()),
                },
                Action::FillMemory => self.fill_memory(),
                Action::ReleaseMemory => self.memory.release(),
                Action::Log(report) => log(&report),
            }
        }
    }

    fn act_on(&self, process: &Name, action: ProcessAction) -> Result<(), TargetError> {
        let pid = self.statuses.iter().find(|(name, _)| name == process.as_str()).map_or(0, |(_, pid)| *pid);
        Target::find(self.supervisor, pid)?.apply(action)
    }

    fn fill_memory(&mut self) {
        match self.memory.fill() {
            Ok(()) => {}
            Err(_) if self.memory_failed => {}
            Err(error) => {
                self.memory_failed = true;
                tracing::warn!("shared memory cannot be taken: {error}");
            }
        }
    }

    fn wait(&self, now_ns: u64) -> Next {
        let message_s =
            self.relays.iter().filter_map(|(_, relay)| relay.due_ns()).min().map(|due| due.saturating_sub(now_ns) as f64 * 1e-9);
        let now_s = self.started.elapsed_s();
        let action_s = self.schedule.next_s(now_s).map(|next_s| (next_s - now_s).max(0.0));
        match message_s.into_iter().chain(action_s).min_by(f64::total_cmp) {
            None => Next::Wait,
            Some(rest_s) => Next::WaitAtMost(Duration::from_secs_f64((rest_s / self.speed).min(1.0)).max(SHORTEST_WAIT)),
        }
    }

    /// Saves the stamps of the first messages: after a restart the times of the planned faults still count from there.
    fn save(&mut self) {
        let mut first_ns = self.saved_ns.clone();
        first_ns.resize(RoutedService::ALL.len(), 0);
        for (service, relay) in &self.relays {
            if let Some(stamp_ns) = first_ns.get_mut(index_of(*service)) {
                *stamp_ns = relay.first_ns().unwrap_or(*stamp_ns);
            }
        }
        if first_ns != self.saved_ns || self.checkpoint.is_missing() {
            self.checkpoint.save_state(&first_ns);
            self.saved_ns = first_ns;
        }
    }

    fn report(&self, context: &mut Context<'_>) {
        let mut all = Counts::default();
        for counts in self.relays.iter().map(|(_, relay)| relay.counts()) {
            all.received += counts.received;
            all.dropped += counts.dropped;
            all.duplicated += counts.duplicated;
            all.reordered += counts.reordered;
            all.corrupted += counts.corrupted;
            all.delayed += counts.delayed;
            all.restamped += counts.restamped;
        }
        let services: Vec<&str> = self.relays.iter().map(|(service, _)| service.name()).collect();
        context.note(&if services.is_empty() {
            String::new()
        } else {
            format!("between publishers and readers of {}", services.join(", "))
        });
        context.count("messages received", all.received);
        context.count("messages dropped", all.dropped);
        context.count("messages duplicated", all.duplicated);
        context.count("messages reordered", all.reordered);
        context.count("messages corrupted", all.corrupted);
        context.count("messages delayed", all.delayed);
        context.count("messages restamped", all.restamped);
        context.count("actions on processes", self.process_actions);
        context.count("bytes of shared memory taken", self.memory.bytes());
    }
}

fn log(report: &Report) {
    match report {
        Report::Begins(text) | Report::Missed(text) => tracing::warn!("{text}"),
        Report::Ended(text) => tracing::info!("{text}"),
    }
}

fn index_of(service: RoutedService) -> usize {
    RoutedService::ALL.iter().position(|it| *it == service).unwrap_or_default()
}
