//! Log lines about injected faults, so that they are not mistaken for real ones.

use settings::{Disturbance, FaultLength, PlannedFault, ProcessFault, StreamFault};

/// Where a fault was ordered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// In the settings.
    Settings,
    /// By `stillmap inject`, while the deployment runs.
    Request,
}

/// A line about a fault.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Report {
    /// It begins.
    Begins(String),
    /// It has ended.
    Ended(String),
    /// Its time had passed before it could be injected.
    Missed(String),
}

impl Report {
    /// The text of the line.
    #[must_use]
    pub fn text(&self) -> &str {
        let (Self::Begins(text) | Self::Ended(text) | Self::Missed(text)) = self;
        text
    }

    /// The report that a fault begins.
    #[must_use]
    pub fn begins(fault: &PlannedFault, source: Source) -> Self {
        Self::Begins(describe(fault, source))
    }

    pub(crate) fn ended(fault: &PlannedFault) -> Self {
        Self::Ended(match &fault.disturbance {
            Disturbance::Service { service, .. } => {
                format!("{} is no longer disturbed: {}", service.name(), fault.disturbance.kind().name())
            }
            Disturbance::Process { process, fault } => {
                let process = process.as_str();
                match fault {
                    ProcessFault::Kill => format!("{process} is no longer killed"),
                    ProcessFault::Stop => format!("{process} is no longer stopped"),
                    ProcessFault::Slow => format!("{process} is no longer slowed"),
                    ProcessFault::Disk => format!("the disk of {process} is no longer full"),
                }
            }
            Disturbance::Memory => "the shared memory is released".to_owned(),
        })
    }

    pub(crate) fn missed(fault: &PlannedFault, source: Source) -> Self {
        Self::Missed(format!("not injected, the time has passed: {}, from {} s", describe(fault, source), fault.from_s.get()))
    }
}

/// The action, its target, its strength and its duration.
fn describe(fault: &PlannedFault, source: Source) -> String {
    let source = match source {
        Source::Settings => "as configured",
        Source::Request => "as requested",
    };
    let every_s = fault.by_s.unwrap_or_default().get();
    let (what, how) = match &fault.disturbance {
        Disturbance::Service { service, fault: kind } => {
            let how = match kind {
                StreamFault::Delay | StreamFault::Clock => Some(format!("by {every_s} s")),
                StreamFault::Burst => Some(format!("every {every_s} s")),
                _ => None,
            };
            (format!("disturbs {} {source}: {}", service.name(), fault.disturbance.kind().name()), how)
        }
        Disturbance::Process { process, fault: kind } => {
            let process = process.as_str();
            match kind {
                ProcessFault::Kill => (format!("kills {process} {source}"), fault.by_s.map(|_| format!("every {every_s} s"))),
                ProcessFault::Stop => (format!("stops {process} {source}"), None),
                ProcessFault::Slow => (format!("slows {process} {source}"), None),
                ProcessFault::Disk => (format!("fills the disk of {process} {source}"), None),
            }
        }
        Disturbance::Memory => (format!("takes all free shared memory {source}"), None),
    };
    let rate = (fault.rate.get() < 1.0).then(|| format!("rate {}", fault.rate.get()));
    let length = if is_single(fault) {
        None
    } else if fault.for_s >= FaultLength::default() {
        Some("until the end".to_owned())
    } else {
        Some(format!("for {} s", fault.for_s.get()))
    };
    [Some(what), how, rate, length].into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// Whether the fault is a single event without a duration.
pub(crate) fn is_single(fault: &PlannedFault) -> bool {
    matches!(fault.disturbance, Disturbance::Process { fault: ProcessFault::Kill, .. }) && fault.by_s.is_none()
}

#[cfg(test)]
mod tests {
    use super::*;
    use settings::RoutedService;

    fn check(disturbance: Disturbance, change: impl Fn(&mut PlannedFault), begins: &str, ended: &str) {
        let mut fault = PlannedFault::always(disturbance);
        change(&mut fault);
        assert_eq!(Report::begins(&fault, Source::Request).text(), begins);
        assert_eq!(Report::ended(&fault).text(), ended);
    }

    #[test]
    fn reports_name_action_target_and_duration() {
        let of_std = |fault| Disturbance::Process { process: "std".to_owned().try_into().unwrap(), fault };
        let of_scans = |fault| Disturbance::Service { service: RoutedService::named("robot/scan").unwrap(), fault };
        let short = |fault: &mut PlannedFault| fault.for_s = 5.0.try_into().unwrap();
        let rarely = |fault: &mut PlannedFault| {
            short(fault);
            fault.rate = 0.1.try_into().unwrap();
        };
        let repeated = |fault: &mut PlannedFault| fault.by_s = Some(0.5.try_into().unwrap());
        check(of_std(ProcessFault::Stop), short, "stops std as requested, for 5 s", "std is no longer stopped");
        check(of_std(ProcessFault::Slow), rarely, "slows std as requested, rate 0.1, for 5 s", "std is no longer slowed");
        check(of_std(ProcessFault::Disk), short, "fills the disk of std as requested, for 5 s", "the disk of std is no longer full");
        check(of_std(ProcessFault::Kill), short, "kills std as requested", "std is no longer killed");
        check(of_std(ProcessFault::Kill), repeated, "kills std as requested, every 0.5 s, until the end", "std is no longer killed");
        check(Disturbance::Memory, short, "takes all free shared memory as requested, for 5 s", "the shared memory is released");
        let ended = "robot/scan is no longer disturbed: ";
        let drop = "disturbs robot/scan as requested: drop, rate 0.1, for 5 s";
        check(of_scans(StreamFault::Drop), rarely, drop, &format!("{ended}drop"));
        let clock = "disturbs robot/scan as requested: clock, by 0.5 s, until the end";
        check(of_scans(StreamFault::Clock), repeated, clock, &format!("{ended}clock"));
        let burst = "disturbs robot/scan as requested: burst, every 1 s, for 5 s";
        check(of_scans(StreamFault::Burst), short, burst, &format!("{ended}burst"));
    }

    #[test]
    fn a_missed_fault_is_reported_with_its_time() {
        let mut fault = PlannedFault::always(Disturbance::Memory);
        (fault.from_s, fault.for_s) = (2.0.try_into().unwrap(), 0.5.try_into().unwrap());
        let text = "not injected, the time has passed: takes all free shared memory as configured, for 0.5 s, from 2 s";
        assert_eq!(Report::missed(&fault, Source::Settings), Report::Missed(text.to_owned()));
    }
}
