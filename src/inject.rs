//! `stillmap inject`: a fault on purpose in a running deployment.

use crate::args::Which;
use crate::exit::BadInput;
use crate::output;
use crate::running::choose;
use bus::{Reader, Received, RunningDomain};
use clap::Args;
use injector::{Ballast, Deed, Harm, News, Timetable, Victim, Wish};
use messages::DeploymentStatus;
use runtime::Tool;
use settings::{
    Disturbance, FaultKind, FaultLength, FaultPeriod, FaultRate, FaultStart, Name, OutOfRange, PlannedFault, RoutedService, Settings,
};
use std::time::{Duration, Instant};

#[derive(Debug, Clone, Args)]
#[command(group = clap::ArgGroup::new("whom"))]
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
    #[arg(long, value_name = "NAME", group = "whom", value_parser = service)]
    pub(crate) service: Option<RoutedService>,
    /// Process that is affected
    #[arg(long, value_name = "NAME", group = "whom", value_parser = process_name)]
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

/// How long a supervisor may take to tell which processes there are; it does so once a second.
const PATIENCE: Duration = Duration::from_secs(3);

/// Makes the fault: one of a service is the injector's to make, one of a process or of memory is made here until it is over.
pub(crate) fn inject(options: &InjectArgs) -> anyhow::Result<()> {
    let fault = planned(options)?;
    let domain = choose(&options.which)?;
    let settings = Settings::read(&domain.directory().join("settings.toml"))?;
    match &fault.disturbance {
        Disturbance::Service { service, .. } => {
            let name = service.name();
            if !settings.routed_services().contains(service) {
                let how = format!("a process that runs \"injector\", and {name} in [injector] services");
                let lacks = format!("{name} does not go through an injector in deployment {}: it needs {how}", domain.name());
                return Err(BadInput(format!("--service {lacks}")).into());
            }
            injector::give_order(domain.directory(), &fault)?;
            output::line(News::begins(&fault, Wish::Asked).text())?;
            Ok(())
        }
        Disturbance::Process { process, .. } => {
            if !settings.process.iter().any(|it| it.name == *process) {
                let process = process.as_str();
                return Err(BadInput(format!("--process {process}: deployment {} has no such process", domain.name())).into());
            }
            disturb(&domain, process, &fault)
        }
        Disturbance::Memory => take_memory(&fault),
    }
}

/// The fault of the options; it begins at once.
fn planned(options: &InjectArgs) -> Result<PlannedFault, BadInput> {
    let InjectArgs { kind, service, process, rate, for_s, by_s, seed, which: _ } = options.clone();
    let whom = match (&service, &process) {
        (Some(service), _) => format!(" --service {}", service.name()),
        (None, Some(process)) => format!(" --process {}", process.as_str()),
        (None, None) => String::new(),
    };
    let no_such = |error| BadInput(format!("{}{whom}: {error}", kind.name()));
    let disturbance = Disturbance::new(service, process, kind).map_err(no_such)?;
    let seed = seed.try_into().map_err(|error| BadInput(format!("--seed {error}")))?;
    Ok(PlannedFault { disturbance, rate, from_s: FaultStart::default(), for_s, by_s, seed })
}

/// Disturbs a process until the fault is over; seconds here are those of the wall clock.
fn disturb(domain: &RunningDomain, process: &Name, fault: &PlannedFault) -> anyhow::Result<()> {
    let mut tool = Tool::join(domain)?;
    let mut statuses = tool.reader::<DeploymentStatus>()?;
    let mut timetable = Timetable::default();
    timetable.plan(fault, Wish::Asked, 0.0, -1.0);
    let mut pid = None;
    let asked = Instant::now();
    while pid.is_none() {
        if asked.elapsed() > PATIENCE {
            return Err(anyhow::anyhow!("{} is not running, or its supervisor does not answer", process.as_str()));
        }
        tool.wait(Duration::from_millis(20))?;
        hear(&mut statuses, process, &mut pid)?;
    }
    let started = Instant::now();
    loop {
        hear(&mut statuses, process, &mut pid)?;
        let now_s = started.elapsed().as_secs_f64();
        for deed in timetable.due(now_s) {
            let harm = match deed {
                Deed::Suffer(_, harm) => harm,
                Deed::Tell(news) => {
                    output::line(news.text())?;
                    continue;
                }
                Deed::FillMemory | Deed::FreeMemory => continue,
            };
            let done = pid.map(|pid| Victim::find(domain.pid(), pid).and_then(|victim| victim.suffer(harm)));
            match (done, harm) {
                (Some(Ok(())), Harm::Kill) => output::line(&format!("{}: killed", process.as_str()))?,
                (Some(Ok(())), _) | (None, _) => {}
                // It died of it, or of something else: the next incarnation is heard of soon.
                (Some(Err(error)), _) => tracing::debug!("{error}"),
            }
        }
        match timetable.next_s(now_s) {
            None => return Ok(()),
            Some(next_s) => tool.wait(Duration::from_secs_f64((next_s - now_s).clamp(0.001, 1.0)))?,
        }
    }
}

/// Takes what is free of shared memory, again and again, until the fault is over.
fn take_memory(fault: &PlannedFault) -> anyhow::Result<()> {
    let mut ballast = Ballast::default();
    let mut timetable = Timetable::default();
    timetable.plan(fault, Wish::Asked, 0.0, -1.0);
    let started = Instant::now();
    let mut said = false;
    loop {
        let now_s = started.elapsed().as_secs_f64();
        for deed in timetable.due(now_s) {
            match deed {
                Deed::FillMemory => {
                    ballast.fill().map_err(|error| BadInput(error.to_string()))?;
                    if !std::mem::replace(&mut said, true) {
                        output::line(&format!("{} bytes of shared memory are taken for {} s", ballast.bytes(), fault.for_s.get()))?;
                    }
                }
                Deed::FreeMemory => ballast.free(),
                // That it begins is told once it is known how much there is to take.
                Deed::Tell(News::Begins(_)) | Deed::Suffer(..) => {}
                Deed::Tell(news) => output::line(news.text())?,
            }
        }
        match timetable.next_s(now_s) {
            None => return Ok(()),
            Some(next_s) => std::thread::sleep(Duration::from_secs_f64((next_s - now_s).clamp(0.001, 1.0))),
        }
    }
}

/// Takes note of the process's id; it stays what it was when no news came.
fn hear(statuses: &mut Reader<DeploymentStatus>, process: &Name, pid: &mut Option<u32>) -> anyhow::Result<()> {
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
    // What is no number is within no limits.
    let number = text.parse().unwrap_or(f64::NAN);
    T::try_from(number).map_err(|refused| format!("expected {}", refused.expected))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_names_what_there_is_and_numbers_that_can_be_meant() {
        assert_eq!((kind("drop"), service("map/verdict")), (Ok(FaultKind::Drop), Ok(RoutedService::Verdict)));
        assert!(kind("Drop").unwrap_err().ends_with("slow, disk or memory"));
        assert_eq!(service("map/tile"), Err("expected robot/scan, motion/sonar, motion/camera or map/verdict".to_owned()));
        assert!(process_name("std").is_ok() && process_name("../std").is_err());
        assert_eq!(within::<FaultRate>("0.5").map(FaultRate::get), Ok(0.5));
        for wrong in ["", "-0.1", "1.1", "nan", "inf", "half"] {
            assert_eq!(within::<FaultRate>(wrong), Err("expected 0 to 1".to_owned()), "{wrong}");
        }
    }
}
