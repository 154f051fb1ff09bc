//! `stillmap inject`: a fault on purpose in a running deployment.

use crate::args::Which;
use crate::exit::BadInput;
use crate::output;
use crate::running::choose;
use bus::{Reader, Received, RunningDomain};
use clap::Args;
use injector::{Action, MemoryFill, ProcessAction, Report, Schedule, Source, Target};
use messages::DeploymentStatus;
use runtime::Observer;
use settings::{
    Disturbance, FaultKind, FaultLength, FaultPeriod, FaultRate, FaultStart, Name, OutOfRange, PlannedFault, RoutedService, Settings,
};
use std::time::{Duration, Instant};

#[derive(Debug, Clone, Args)]
#[command(group = clap::ArgGroup::new("target"))]
pub(crate) struct InjectArgs {
    /// Fault to inject
    ///
    /// Faults of a service, with --service:
    ///   drop       Messages are lost.
    ///   delay      Messages are delayed by --by.
    ///   duplicate  Messages are sent twice.
    ///   reorder    Messages are sent after the one that follows them.
    ///   corrupt    Bits of messages are flipped.
    ///   stall      Messages are held back until the fault ends.
    ///   burst      Messages are held back and sent together every --by.
    ///   clock      Messages are stamped by a clock that is --by ahead.
    /// Faults of a process, with --process:
    ///   kill       The process is killed, once or every --by.
    ///   stop       The process is stopped until the fault ends.
    ///   slow       The process is stopped for a share of the time, --rate.
    ///   disk       No file of the process can grow, as on a full disk.
    /// Faults of the computer:
    ///   memory     All free shared memory is taken.
    #[arg(value_name = "KIND", verbatim_doc_comment, value_parser = kind)]
    pub(crate) kind: FaultKind,
    /// Service whose messages are affected, such as robot/scan. It must be routed through an injector in the settings
    #[arg(long, value_name = "NAME", group = "target", value_parser = service)]
    pub(crate) service: Option<RoutedService>,
    /// Process that is affected
    #[arg(long, value_name = "NAME", group = "target", value_parser = process_name)]
    pub(crate) process: Option<Name>,
    /// Share of the messages that are affected, or of the time that a slowed process is stopped, from 0 to 1
    #[arg(long, value_name = "SHARE", default_value = "1", value_parser = within::<FaultRate>, allow_negative_numbers = true)]
    pub(crate) rate: FaultRate,
    /// Duration of the fault in seconds
    #[arg(long = "for", value_name = "S", default_value = "10", value_parser = within::<FaultLength>, allow_negative_numbers = true)]
    pub(crate) for_s: FaultLength,
    /// Delay, clock offset, or period of bursts and kills, in seconds
    #[arg(long = "by", value_name = "S", value_parser = within::<FaultPeriod>, allow_negative_numbers = true)]
    pub(crate) by_s: Option<FaultPeriod>,
    /// Seed that decides which messages are affected
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    pub(crate) seed: u32,
    #[command(flatten)]
    pub(crate) which: Which,
}

/// How long to wait for a status of the supervisor, which publishes one a second.
const PATIENCE: Duration = Duration::from_secs(3);

/// Injects a fault. A fault of a service is handed to the injector; one of a process or of memory is carried out here until it ends.
pub(crate) fn inject(options: &InjectArgs) -> anyhow::Result<()> {
    let fault = planned(options)?;
    let domain = choose(&options.which)?;
    let settings = Settings::read_handed(&domain.directory().join("settings.toml"))?;
    match &fault.disturbance {
        Disturbance::Service { service, .. } => {
            let name = service.name();
            if !settings.routed_services().contains(service) {
                let needed = format!("a process that runs \"injector\", and {name} in [injector] services");
                let problem = format!("{name} is not routed through an injector in deployment {}: it needs {needed}", domain.name());
                return Err(BadInput(format!("--service {problem}")).into());
            }
            injector::request_fault(domain.directory(), &fault)?;
            output::line(Report::begins(&fault, Source::Request).text())?;
            Ok(())
        }
        Disturbance::Process { process, .. } => {
            if !settings.process.iter().any(|it| it.name == *process) {
                let process = process.as_str();
                return Err(BadInput(format!("--process {process}: deployment {} has no such process", domain.name())).into());
            }
            act_on_process(&domain, process, &fault)
        }
        Disturbance::Memory => fill_memory(&fault),
    }
}

/// The fault that the arguments describe; it begins at once.
fn planned(options: &InjectArgs) -> Result<PlannedFault, BadInput> {
    let InjectArgs { kind, service, process, rate, for_s, by_s, seed, which: _ } = options.clone();
    let target = match (&service, &process) {
        (Some(service), _) => format!(" --service {}", service.name()),
        (None, Some(process)) => format!(" --process {}", process.as_str()),
        (None, None) => String::new(),
    };
    let no_such = |error| BadInput(format!("{}{target}: {error}", kind.name()));
    let disturbance = Disturbance::new(service, process, kind).map_err(no_such)?;
    let seed = seed.try_into().map_err(|error| BadInput(format!("--seed {error}")))?;
    Ok(PlannedFault { disturbance, rate, from_s: FaultStart::default(), for_s, by_s, seed })
}

/// Acts on a process until the fault ends. Times are those of the wall clock.
fn act_on_process(domain: &RunningDomain, process: &Name, fault: &PlannedFault) -> anyhow::Result<()> {
    let mut tool = Observer::join(domain)?;
    let mut statuses = tool.reader::<DeploymentStatus>()?;
    let mut schedule = Schedule::default();
    schedule.add(fault, Source::Request, 0.0, -1.0);
    let mut pid = None;
    let asked = Instant::now();
    while pid.is_none() {
        if asked.elapsed() > PATIENCE {
            return Err(anyhow::anyhow!("{} is not running, or the supervisor does not respond", process.as_str()));
        }
        tool.wait(Duration::from_millis(20))?;
        read_pid(&mut statuses, process, &mut pid)?;
    }
    let started = Instant::now();
    loop {
        read_pid(&mut statuses, process, &mut pid)?;
        let now_s = started.elapsed().as_secs_f64();
        for action in schedule.due(now_s) {
            let action = match action {
                Action::Process(_, action) => action,
                Action::Log(report) => {
                    output::line(report.text())?;
                    continue;
                }
                Action::FillMemory | Action::ReleaseMemory => continue,
            };
            let result = pid.map(|pid| Target::find(domain.pid(), pid).and_then(|target| target.apply(action)));
            match (result, action) {
                (Some(Ok(())), ProcessAction::Kill) => output::line(&format!("{}: killed", process.as_str()))?,
                (Some(Ok(())), _) | (None, _) => {}
                // The process has died; the next status has the id of its successor.
                (Some(Err(error)), _) => tracing::debug!("{error}"),
            }
        }
        match schedule.next_s(now_s) {
            None => return Ok(()),
            Some(next_s) => tool.wait(Duration::from_secs_f64((next_s - now_s).clamp(0.001, 1.0)))?,
        }
    }
}

/// Takes all free shared memory, repeatedly, until the fault ends.
fn fill_memory(fault: &PlannedFault) -> anyhow::Result<()> {
    let mut memory = MemoryFill::default();
    let mut schedule = Schedule::default();
    schedule.add(fault, Source::Request, 0.0, -1.0);
    let started = Instant::now();
    let mut reported = false;
    loop {
        let now_s = started.elapsed().as_secs_f64();
        for action in schedule.due(now_s) {
            match action {
                Action::FillMemory => {
                    memory.fill().map_err(|error| BadInput(error.to_string()))?;
                    if !std::mem::replace(&mut reported, true) {
                        output::line(&format!("takes {} bytes of shared memory for {} s", memory.bytes(), fault.for_s.get()))?;
                    }
                }
                Action::ReleaseMemory => memory.release(),
                // The begin is printed above, with the number of bytes.
                Action::Log(Report::Begins(_)) | Action::Process(..) => {}
                Action::Log(report) => output::line(report.text())?,
            }
        }
        match schedule.next_s(now_s) {
            None => return Ok(()),
            Some(next_s) => std::thread::sleep(Duration::from_secs_f64((next_s - now_s).clamp(0.001, 1.0))),
        }
    }
}

/// Updates the id of the process, if a status came.
fn read_pid(statuses: &mut Reader<DeploymentStatus>, process: &Name, pid: &mut Option<u32>) -> anyhow::Result<()> {
    while let Some(received) = statuses.take()? {
        if let Received::Message(status) = received {
            let all = status.processes.iter().take(status.count as usize);
            *pid = all.filter(|it| it.process.as_str() == process.as_str() && it.pid != 0).map(|it| it.pid).next();
        }
    }
    Ok(())
}

fn kind(text: &str) -> Result<FaultKind, String> {
    FaultKind::ALL
        .into_iter()
        .find(|kind| kind.name() == text)
        .ok_or_else(|| format!("expected {}", one_of(FaultKind::ALL.map(FaultKind::name))))
}

fn service(text: &str) -> Result<RoutedService, String> {
    let all = RoutedService::ALL;
    all.into_iter().find(|service| service.name() == text).ok_or_else(|| format!("expected {}", one_of(all.map(RoutedService::name))))
}

fn one_of<const N: usize>(words: [&str; N]) -> String {
    words.split_last().map_or_else(String::new, |(last, others)| format!("{} or {last}", others.join(", ")))
}

fn process_name(text: &str) -> Result<Name, String> {
    Name::try_from(text.to_owned()).map_err(|error| error.to_string())
}

/// A number within the limits of its setting.
fn within<T: TryFrom<f64, Error = OutOfRange>>(text: &str) -> Result<T, String> {
    // NaN is outside every range.
    let number = text.parse().unwrap_or(f64::NAN);
    T::try_from(number).map_err(|refused| format!("expected {}", refused.expected))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_services_names_and_ranges_are_checked() {
        assert_eq!((kind("drop"), service("map/verdict")), (Ok(FaultKind::Drop), Ok(RoutedService::named("map/verdict").unwrap())));
        assert!(kind("Drop").unwrap_err().ends_with("slow, disk or memory"));
        assert_eq!(service("map/tile"), Err("expected robot/scan, motion/sonar, motion/camera or map/verdict".to_owned()));
        assert!(process_name("std").is_ok() && process_name("../std").is_err());
        assert_eq!(within::<FaultRate>("0.5").map(FaultRate::get), Ok(0.5));
        for wrong in ["", "-0.1", "1.1", "nan", "inf", "half"] {
            assert_eq!(within::<FaultRate>(wrong), Err("expected 0 to 1".to_owned()), "{wrong}");
        }
    }
}
