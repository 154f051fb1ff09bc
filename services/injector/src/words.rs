//! Faults in words: what is done on purpose is not to be taken for real by whoever reads the log.

use settings::{Disturbance, FaultLength, PlannedFault, ProcessFault, StreamFault};

/// Whose wish a fault is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wish {
    /// The settings'.
    Set,
    /// Somebody's, while the deployment runs.
    Asked,
}

/// What is to be said of a fault.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum News {
    /// It begins.
    Begins(String),
    /// It is over.
    Over(String),
    /// Its time has passed, and nothing was done.
    Missed(String),
}

impl News {
    /// The line to be said.
    #[must_use]
    pub fn text(&self) -> &str {
        let (Self::Begins(text) | Self::Over(text) | Self::Missed(text)) = self;
        text
    }

    /// That it begins.
    #[must_use]
    pub fn begins(fault: &PlannedFault, wish: Wish) -> Self {
        Self::Begins(description(fault, wish))
    }

    pub(crate) fn over(fault: &PlannedFault) -> Self {
        Self::Over(match &fault.disturbance {
            Disturbance::Service { service, .. } => {
                format!("{} is disturbed no longer: {}", service.name(), fault.disturbance.kind().name())
            }
            Disturbance::Process { process, fault } => {
                let process = process.as_str();
                match fault {
                    ProcessFault::Kill => format!("{process} is killed no longer"),
                    ProcessFault::Stop => format!("{process} is stopped no longer"),
                    ProcessFault::Slow => format!("{process} is slowed no longer"),
                    ProcessFault::Disk => format!("the disk of {process} is full no longer"),
                }
            }
            Disturbance::Memory => "shared memory is held no longer".to_owned(),
        })
    }

    pub(crate) fn missed(fault: &PlannedFault, wish: Wish) -> Self {
        Self::Missed(format!("too late, its time has passed: {}, from {} s", description(fault, wish), fault.from_s.get()))
    }
}

/// What is done, to whom, how much and how long.
fn description(fault: &PlannedFault, wish: Wish) -> String {
    let wish = match wish {
        Wish::Set => "as set",
        Wish::Asked => "as asked",
    };
    let every_s = fault.by_s.unwrap_or_default().get();
    let (what, how) = match &fault.disturbance {
        Disturbance::Service { service, fault: kind } => {
            let how = match kind {
                StreamFault::Delay | StreamFault::Clock => Some(format!("by {every_s} s")),
                StreamFault::Burst => Some(format!("every {every_s} s")),
                _ => None,
            };
            (format!("disturbs {} {wish}: {}", service.name(), fault.disturbance.kind().name()), how)
        }
        Disturbance::Process { process, fault: kind } => {
            let process = process.as_str();
            match kind {
                ProcessFault::Kill => (format!("kills {process} {wish}"), fault.by_s.map(|_| format!("every {every_s} s"))),
                ProcessFault::Stop => (format!("stops {process} {wish}"), None),
                ProcessFault::Slow => (format!("slows {process} {wish}"), None),
                ProcessFault::Disk => (format!("fills the disk of {process} {wish}"), None),
            }
        }
        Disturbance::Memory => (format!("takes what is free of shared memory {wish}"), None),
    };
    let rate = (fault.rate.get() < 1.0).then(|| format!("rate {}", fault.rate.get()));
    let length = if happens_once(fault) {
        None
    } else if fault.for_s >= FaultLength::default() {
        Some("to the end".to_owned())
    } else {
        Some(format!("for {} s", fault.for_s.get()))
    };
    [Some(what), how, rate, length].into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// Whether it is over as soon as it is done.
pub(crate) fn happens_once(fault: &PlannedFault) -> bool {
    matches!(fault.disturbance, Disturbance::Process { fault: ProcessFault::Kill, .. }) && fault.by_s.is_none()
}

#[cfg(test)]
mod tests {
    use super::*;
    use settings::RoutedService;

    fn check(disturbance: Disturbance, change: impl Fn(&mut PlannedFault), begins: &str, over: &str) {
        let mut fault = PlannedFault::always(disturbance);
        change(&mut fault);
        assert_eq!(News::begins(&fault, Wish::Asked).text(), begins);
        assert_eq!(News::over(&fault).text(), over);
    }

    #[test]
    fn a_fault_says_what_it_does_to_whom_and_for_how_long() {
        let of_std = |fault| Disturbance::Process { process: "std".to_owned().try_into().unwrap(), fault };
        let of_scans = |fault| Disturbance::Service { service: RoutedService::RobotScan, fault };
        let short = |fault: &mut PlannedFault| fault.for_s = 5.0.try_into().unwrap();
        let seldom = |fault: &mut PlannedFault| {
            short(fault);
            fault.rate = 0.1.try_into().unwrap();
        };
        let again = |fault: &mut PlannedFault| fault.by_s = Some(0.5.try_into().unwrap());
        check(of_std(ProcessFault::Stop), short, "stops std as asked, for 5 s", "std is stopped no longer");
        check(of_std(ProcessFault::Slow), seldom, "slows std as asked, rate 0.1, for 5 s", "std is slowed no longer");
        check(of_std(ProcessFault::Disk), short, "fills the disk of std as asked, for 5 s", "the disk of std is full no longer");
        check(of_std(ProcessFault::Kill), short, "kills std as asked", "std is killed no longer");
        check(of_std(ProcessFault::Kill), again, "kills std as asked, every 0.5 s, to the end", "std is killed no longer");
        check(Disturbance::Memory, short, "takes what is free of shared memory as asked, for 5 s", "shared memory is held no longer");
        let over = "robot/scan is disturbed no longer: ";
        let drop = "disturbs robot/scan as asked: drop, rate 0.1, for 5 s";
        check(of_scans(StreamFault::Drop), seldom, drop, &format!("{over}drop"));
        let clock = "disturbs robot/scan as asked: clock, by 0.5 s, to the end";
        check(of_scans(StreamFault::Clock), again, clock, &format!("{over}clock"));
        let burst = "disturbs robot/scan as asked: burst, every 1 s, for 5 s";
        check(of_scans(StreamFault::Burst), short, burst, &format!("{over}burst"));
    }

    #[test]
    fn what_comes_too_late_says_when_it_was_to_be() {
        let mut fault = PlannedFault::always(Disturbance::Memory);
        (fault.from_s, fault.for_s) = (2.0.try_into().unwrap(), 0.5.try_into().unwrap());
        let said = "too late, its time has passed: takes what is free of shared memory as set, for 0.5 s, from 2 s";
        assert_eq!(News::missed(&fault, Wish::Set), News::Missed(said.to_owned()));
    }
}
