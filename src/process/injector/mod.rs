//! The injector as a process: between publishers and readers, and beside the processes that it disturbs.

mod relay;

use ::injector::{Ballast, Counts, Deed, Harm, News, SignalError, Timetable, Victim, Wish, take_orders};
use anyhow::Result;
use bus::{Reader, Received};
use messages::{DeploymentStatus, ProcessStatus};
use relay::Relay;
use runtime::{Checkpoint, Context, Next, Process, Shell, StepError};
use settings::{BuiltIn, Disturbance, Name, Pace, PlannedFault, RoutedService, Settings};
use std::convert::Infallible;
use std::path::PathBuf;
use std::time::Duration;

/// Shortest wait for a due time: what is due within it comes a little late rather than by spinning.
const SHORTEST_WAIT: Duration = Duration::from_millis(1);

/// Disturbs until the run has ended.
///
/// # Errors
/// When the bus fails.
pub(super) fn run(mut shell: Shell, settings: &Settings) -> Result<()> {
    let checkpoint = shell.checkpoint();
    let began_ns = checkpoint.take_up(|saved| Ok::<_, Infallible>(numbers(saved.state))).unwrap_or_default();
    let mut relays = Vec::new();
    for service in settings.routed_services() {
        let began_ns = began_ns.get(place_of(service)).copied().filter(|began| *began > 0);
        relays.push((service, relay::open(&mut shell, service, began_ns, settings.pace == Pace::Lockstep)?));
    }
    let membership = shell.membership();
    let mut injector = Injector {
        relays,
        timetable: Timetable::default(),
        ballast: Ballast::default(),
        ballast_refused: false,
        statuses: Vec::new(),
        bystanders: [BuiltIn::Injector, BuiltIn::Recorder, BuiltIn::Viewer].into_iter().flat_map(|kind| settings.named(kind)).collect(),
        others_are_over: false,
        supervisor: std::os::unix::process::parent_id(),
        domain: membership.directory().to_owned(),
        started: membership.clock(),
        speed: membership.speed(),
        checkpoint,
        kept: began_ns,
        disturbed: 0,
        reader: None,
    };
    // What a killed injector has done to processes is not done again.
    let since_s = if membership.incarnation() == 0 { -1.0 } else { membership.clock().elapsed_s() };
    for fault in &settings.fault {
        injector.plan(fault, since_s);
    }
    injector.reader = Some(shell.reader()?);
    Ok(shell.run(&mut injector)?)
}

struct Injector {
    relays: Vec<(RoutedService, Box<dyn Relay>)>,
    timetable: Timetable,
    ballast: Ballast,
    /// Shared memory could not be taken, and that has been said.
    ballast_refused: bool,
    /// Processes and their ids, as last heard.
    statuses: Vec<(String, u32)>,
    /// Those that go on until everybody else has ended.
    bystanders: Vec<String>,
    others_are_over: bool,
    supervisor: u32,
    domain: PathBuf,
    started: bus::DeploymentClock,
    speed: f64,
    checkpoint: Checkpoint,
    /// Stamps of the first messages, as the checkpoint has them.
    kept: Vec<u64>,
    disturbed: u64,
    reader: Option<Reader<DeploymentStatus>>,
}

impl Process for Injector {
    fn step(&mut self, context: &mut Context<'_>) -> Result<Next, StepError> {
        self.listen()?;
        for order in take_orders(&self.domain) {
            match order {
                Ok(fault) => self.order(&fault),
                Err(error) => tracing::warn!("{error}"),
            }
        }
        let now_ns = context.now_ns();
        let mut more = false;
        for (_, relay) in &mut self.relays {
            more |= relay.carry(now_ns)?;
            relay.take_news().iter().for_each(tell);
        }
        self.keep();
        self.disturb();
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
    /// A fault of the settings.
    fn plan(&mut self, fault: &PlannedFault, since_s: f64) {
        match &fault.disturbance {
            Disturbance::Service { service, fault: kind } => {
                if let Some((_, relay)) = self.relays.iter_mut().find(|(it, _)| it == service) {
                    relay.plan(*kind, fault);
                }
            }
            Disturbance::Process { .. } | Disturbance::Memory => self.timetable.plan(fault, Wish::Set, 0.0, since_s),
        }
    }

    /// A fault that somebody asks for now.
    fn order(&mut self, fault: &PlannedFault) {
        let now_s = self.started.elapsed_s();
        match &fault.disturbance {
            Disturbance::Service { service, fault: kind } => match self.relays.iter_mut().find(|(it, _)| it == service) {
                Some((_, relay)) => relay.disturb(*kind, fault),
                None => tracing::warn!("{} does not go through the injector: [injector] services does not name it", service.name()),
            },
            Disturbance::Process { .. } | Disturbance::Memory => self.timetable.plan(fault, Wish::Asked, now_s, -1.0),
        }
    }

    fn listen(&mut self) -> Result<(), StepError> {
        while let Some(received) = self.reader.as_mut().map_or(Ok(None), Reader::take)? {
            let Received::Message(status) = received else { continue };
            let processes = status.processes().iter();
            self.statuses = processes.clone().map(|it| (it.process.as_str().to_owned(), it.pid)).collect();
            let mut others = processes.filter(|it| !self.bystanders.iter().any(|name| name == it.process.as_str()));
            self.others_are_over = status.ending == 1 && others.all(ProcessStatus::is_over);
        }
        Ok(())
    }

    /// Does what is due to processes and to shared memory.
    fn disturb(&mut self) {
        for deed in self.timetable.due(self.started.elapsed_s()) {
            match deed {
                Deed::Suffer(process, harm) => match self.suffer(&process, harm) {
                    Ok(()) if harm == Harm::FillDisk => {}
                    Ok(()) => self.disturbed += 1,
                    Err(error) => tracing::debug!("{}: {harm:?}: {error}", process.as_str()),
                },
                Deed::FillMemory => self.fill_memory(),
                Deed::FreeMemory => self.ballast.free(),
                Deed::Tell(news) => tell(&news),
            }
        }
    }

    fn suffer(&self, process: &Name, harm: Harm) -> Result<(), SignalError> {
        let pid = self.statuses.iter().find(|(name, _)| name == process.as_str()).map_or(0, |(_, pid)| *pid);
        Victim::find(self.supervisor, pid)?.suffer(harm)
    }

    fn fill_memory(&mut self) {
        match self.ballast.fill() {
            Ok(()) => {}
            Err(_) if self.ballast_refused => {}
            Err(error) => {
                self.ballast_refused = true;
                tracing::warn!("shared memory is not taken: {error}");
            }
        }
    }

    fn wait(&self, now_ns: u64) -> Next {
        let held_s = self.relays.iter().filter_map(|(_, relay)| relay.due_ns()).min().map(|due| due.saturating_sub(now_ns) as f64 * 1e-9);
        let now_s = self.started.elapsed_s();
        let deed_s = self.timetable.next_s(now_s).map(|next_s| (next_s - now_s).max(0.0));
        match held_s.into_iter().chain(deed_s).min_by(f64::total_cmp) {
            None => Next::Wait,
            Some(rest_s) => Next::WaitAtMost(Duration::from_secs_f64((rest_s / self.speed).min(1.0)).max(SHORTEST_WAIT)),
        }
    }

    /// Keeps when the streams began: after a restart the faults of the settings still count from there.
    fn keep(&mut self) {
        let mut began_ns = self.kept.clone();
        began_ns.resize(RoutedService::ALL.len(), 0);
        for (service, relay) in &self.relays {
            if let Some(place) = began_ns.get_mut(place_of(*service)) {
                *place = relay.began_ns().unwrap_or(*place);
            }
        }
        if began_ns != self.kept {
            let bytes: Vec<u8> = began_ns.iter().flat_map(|began| began.to_le_bytes()).collect();
            self.checkpoint.keep(&bytes);
            self.kept = began_ns;
        }
    }

    fn report(&self, context: &mut Context<'_>) {
        let mut all = Counts::default();
        for counts in self.relays.iter().map(|(_, relay)| relay.counts()) {
            all.taken += counts.taken;
            all.dropped += counts.dropped;
            all.duplicated += counts.duplicated;
            all.overtaken += counts.overtaken;
            all.corrupted += counts.corrupted;
            all.held += counts.held;
            all.set_forward += counts.set_forward;
        }
        let services: Vec<&str> = self.relays.iter().map(|(service, _)| service.name()).collect();
        context.note(&if services.is_empty() {
            String::new()
        } else {
            format!("between publishers and readers of {}", services.join(", "))
        });
        context.count("messages carried", all.taken);
        context.count("messages dropped", all.dropped);
        context.count("messages duplicated", all.duplicated);
        context.count("messages overtaken", all.overtaken);
        context.count("messages corrupted", all.corrupted);
        context.count("messages held back", all.held);
        context.count("messages set forward", all.set_forward);
        context.count("deeds done to processes", self.disturbed);
        context.count("bytes of shared memory taken", self.ballast.bytes());
    }
}

fn tell(news: &News) {
    match news {
        News::Begins(text) | News::Missed(text) => tracing::warn!("{text}"),
        News::Over(text) => tracing::info!("{text}"),
    }
}

fn place_of(service: RoutedService) -> usize {
    RoutedService::ALL.iter().position(|it| *it == service).unwrap_or_default()
}

/// When the streams began, as an earlier incarnation saw it.
fn numbers(bytes: &[u8]) -> Vec<u64> {
    bytes.as_chunks().0.iter().map(|number| u64::from_le_bytes(*number)).collect()
}
