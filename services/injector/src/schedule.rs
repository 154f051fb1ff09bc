//! When to act on which process, or on shared memory.

use settings::{Disturbance, Name, PlannedFault, ProcessFault};

use crate::describe::{Report, Source, is_single};
use crate::random::occurs;

/// Period in which a slowed process is stopped and continued, s.
const SLOW_PERIOD_S: f64 = 0.1;
/// Period in which an action is repeated, s: the process whose files are limited may have been restarted, and shared memory may have
/// been freed.
const REPEAT_S: f64 = 0.2;

/// What to do now.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Action {
    /// Act on a process.
    Process(Name, ProcessAction),
    /// Take all free shared memory.
    FillMemory,
    /// Release it.
    ReleaseMemory,
    /// Log this line.
    Log(Report),
}

/// An action on a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProcessAction {
    /// Send SIGKILL.
    Kill,
    /// Send SIGSTOP.
    Stop,
    /// Send SIGCONT.
    Continue,
    /// Let none of its files grow.
    FillDisk,
    /// Let its files grow again.
    FreeDisk,
}

/// Faults of processes and of shared memory with their progress. Times are seconds of deployment time since the run began.
#[derive(Debug, Clone, Default)]
pub struct Schedule {
    entries: Vec<Entry>,
}

#[derive(Debug, Clone)]
struct Entry {
    fault: Fault,
    plan: PlannedFault,
    source: Source,
    seed: u64,
    from_s: f64,
    until_s: f64,
    /// Time of the last call.
    checked_s: f64,
    /// Progress as it was reported.
    phase: Phase,
    /// The process is stopped or its disk is full, or memory is taken.
    applied: bool,
}

/// Progress of a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Phase {
    Pending,
    Active,
    Ended,
}

#[derive(Debug, Clone)]
enum Fault {
    Process(Name, ProcessFault),
    Memory,
}

impl Schedule {
    /// Adds a fault whose times count from `base_s`. Actions that were due before `now_s` are left out. A fault of a service is
    /// ignored.
    pub fn add(&mut self, plan: &PlannedFault, source: Source, base_s: f64, now_s: f64) {
        let fault = match &plan.disturbance {
            Disturbance::Process { process, fault } => Fault::Process(process.clone(), *fault),
            Disturbance::Memory => Fault::Memory,
            Disturbance::Service { .. } => return,
        };
        let from_s = base_s + plan.from_s.get();
        self.entries.push(Entry {
            fault,
            plan: plan.clone(),
            source,
            seed: u64::from(plan.seed.get()) | (self.entries.len() as u64 + 1) << 32,
            from_s,
            until_s: from_s + plan.for_s.get(),
            checked_s: now_s,
            phase: Phase::Pending,
            applied: false,
        });
    }

    /// The actions that are due at `now_s`, in order.
    pub fn due(&mut self, now_s: f64) -> Vec<Action> {
        let mut actions = Vec::new();
        for entry in &mut self.entries {
            entry.due(now_s, &mut actions);
            entry.checked_s = now_s;
        }
        actions
    }

    /// When to call [`due`](Self::due) again at the latest; `None` when no action is left.
    #[must_use]
    pub fn next_s(&self, now_s: f64) -> Option<f64> {
        self.entries.iter().filter_map(|entry| entry.next_s(now_s)).min_by(f64::total_cmp)
    }
}

impl Entry {
    fn due(&mut self, now_s: f64, actions: &mut Vec<Action>) {
        let active = (self.from_s..self.until_s).contains(&now_s);
        let action = match self.fault.clone() {
            Fault::Process(process, fault) => self.process_action(fault, active, now_s).map(|action| Action::Process(process, action)),
            Fault::Memory => self.repeat(active, Action::FillMemory, Action::ReleaseMemory),
        };
        if is_single(&self.plan) {
            actions.extend(action.iter().map(|_| Action::Log(Report::begins(&self.plan, self.source))));
            return actions.extend(action);
        }
        // A kill is performed even when it comes late.
        if self.phase == Phase::Pending && (active || action.is_some()) {
            self.phase = Phase::Active;
            actions.push(Action::Log(Report::begins(&self.plan, self.source)));
        }
        actions.extend(action);
        if now_s >= self.until_s {
            let report = match self.phase {
                Phase::Active => Some(Report::ended(&self.plan)),
                // A fault that had ended before the first call was reported by an earlier incarnation.
                Phase::Pending if self.checked_s < self.until_s => Some(Report::missed(&self.plan, self.source)),
                _ => None,
            };
            self.phase = Phase::Ended;
            actions.extend(report.map(Action::Log));
        }
    }

    fn process_action(&mut self, fault: ProcessFault, active: bool, now_s: f64) -> Option<ProcessAction> {
        match fault {
            ProcessFault::Kill => {
                let last = self.kills_by(self.checked_s);
                let now = self.kills_by(now_s);
                (now > last && (last + 1..=now).any(|kill| occurs(self.seed, kill, self.plan.rate.get()))).then_some(ProcessAction::Kill)
            }
            ProcessFault::Stop => self.switch(active, ProcessAction::Stop, ProcessAction::Continue),
            ProcessFault::Slow => {
                let phase = (now_s - self.from_s).rem_euclid(SLOW_PERIOD_S) / SLOW_PERIOD_S;
                self.switch(active && phase < self.plan.rate.get(), ProcessAction::Stop, ProcessAction::Continue)
            }
            ProcessFault::Disk => self.repeat(active, ProcessAction::FillDisk, ProcessAction::FreeDisk),
        }
    }

    /// `on` at every call while the fault is active, then `off` once.
    fn repeat<A>(&mut self, active: bool, on: A, off: A) -> Option<A> {
        if active {
            self.applied = true;
            return Some(on);
        }
        self.switch(false, on, off)
    }

    /// `on` or `off` when the wanted state changes.
    fn switch<A>(&mut self, wanted: bool, on: A, off: A) -> Option<A> {
        let changed = self.applied != wanted;
        self.applied = wanted;
        changed.then_some(if wanted { on } else { off })
    }

    /// Number of kills that were due up to `at_s`.
    fn kills_by(&self, at_s: f64) -> u64 {
        if at_s < self.from_s {
            return 0;
        }
        let Some(by_s) = self.plan.by_s else { return 1 };
        // The end of the fault is not part of it.
        1 + ((at_s.min(self.until_s - 1e-9) - self.from_s) / by_s.get()).max(0.0) as u64
    }

    fn next_s(&self, now_s: f64) -> Option<f64> {
        if now_s < self.from_s {
            return Some(self.from_s);
        }
        if now_s >= self.until_s {
            return self.applied.then_some(now_s);
        }
        match &self.fault {
            Fault::Process(_, ProcessFault::Kill) => {
                self.plan.by_s.map(|by_s| (self.from_s + self.kills_by(now_s) as f64 * by_s.get()).min(self.until_s))
            }
            Fault::Process(_, ProcessFault::Stop) => Some(self.until_s),
            Fault::Process(_, ProcessFault::Slow) => {
                let periods = ((now_s - self.from_s) / SLOW_PERIOD_S).floor();
                let begin_s = self.from_s + periods * SLOW_PERIOD_S;
                let middle_s = begin_s + self.plan.rate.get() * SLOW_PERIOD_S;
                Some(if now_s < middle_s { middle_s } else { begin_s + SLOW_PERIOD_S })
            }
            Fault::Process(_, ProcessFault::Disk) | Fault::Memory => Some((now_s + REPEAT_S).min(self.until_s)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mapping() -> Name {
        "mapping".to_owned().try_into().unwrap()
    }

    /// Checks a hundred times a second for 10 s. The actions on a process with their times in hundredths.
    fn process_actions(fault: ProcessFault, change: impl Fn(&mut PlannedFault)) -> Vec<(u32, ProcessAction)> {
        let of_process = |(hundredth, action)| match action {
            Action::Process(process, action) if process == mapping() => Some((hundredth, action)),
            Action::Log(_) => None,
            other => panic!("{other:?}"),
        };
        actions(Disturbance::Process { process: mapping(), fault }, change).into_iter().filter_map(of_process).collect()
    }

    fn actions(disturbance: Disturbance, change: impl Fn(&mut PlannedFault)) -> Vec<(u32, Action)> {
        actions_from(0, 0.0, disturbance, change)
    }

    /// The same from a hundredth on, without the actions that were due before `since_s`.
    fn actions_from(first: u32, since_s: f64, disturbance: Disturbance, change: impl Fn(&mut PlannedFault)) -> Vec<(u32, Action)> {
        let mut plan = PlannedFault::always(disturbance);
        change(&mut plan);
        let mut schedule = Schedule::default();
        schedule.add(&plan, Source::Settings, 0.0, since_s);
        let mut done = Vec::new();
        for hundredth in first..1_000 {
            let now_s = f64::from(hundredth) / 100.0;
            done.extend(schedule.due(now_s).into_iter().map(|action| (hundredth, action)));
            assert!(schedule.next_s(now_s).is_none_or(|next_s| next_s >= now_s));
        }
        done
    }

    fn times(plan: &mut PlannedFault, from_s: f64, for_s: f64) {
        plan.from_s = from_s.try_into().unwrap();
        plan.for_s = for_s.try_into().unwrap();
    }

    #[test]
    fn a_kill_is_single_or_periodic() {
        assert_eq!(process_actions(ProcessFault::Kill, |plan| times(plan, 2.0, 5.0)), [(200, ProcessAction::Kill)]);
        let repeated = process_actions(ProcessFault::Kill, |plan| {
            times(plan, 2.0, 3.0);
            plan.by_s = Some(1.0.try_into().unwrap());
        });
        assert_eq!(repeated, [(200, ProcessAction::Kill), (300, ProcessAction::Kill), (400, ProcessAction::Kill)]);
        assert_eq!(process_actions(ProcessFault::Kill, |plan| plan.rate = 0.0.try_into().unwrap()), []);
    }

    #[test]
    fn a_stopped_process_is_continued() {
        assert_eq!(
            process_actions(ProcessFault::Stop, |plan| times(plan, 2.0, 1.5)),
            [(200, ProcessAction::Stop), (350, ProcessAction::Continue)]
        );
        let slow = process_actions(ProcessFault::Slow, |plan| {
            times(plan, 1.0, 1.0);
            plan.rate = 0.5.try_into().unwrap();
        });
        let stops = slow.iter().filter(|(_, action)| *action == ProcessAction::Stop).count();
        assert!((9..=11).contains(&stops), "{stops} stops in ten periods");
        assert_eq!(slow.last().map(|(_, action)| *action), Some(ProcessAction::Continue));
    }

    #[test]
    fn a_full_disk_is_repeated_for_restarts_and_then_freed() {
        let disk = process_actions(ProcessFault::Disk, |plan| times(plan, 1.0, 2.0));
        assert_eq!(disk.iter().filter(|(_, action)| *action == ProcessAction::FillDisk).count(), 200);
        assert_eq!(disk.last(), Some(&(300, ProcessAction::FreeDisk)));
        assert_eq!(disk.iter().filter(|(_, action)| *action == ProcessAction::FreeDisk).count(), 1);
    }

    #[test]
    fn memory_is_taken_repeatedly_and_released_once() {
        let memory = actions(Disturbance::Memory, |plan| times(plan, 1.0, 2.0));
        assert_eq!(memory.iter().filter(|(_, action)| *action == Action::FillMemory).count(), 200);
        assert!(memory.contains(&(300, Action::ReleaseMemory)));
        assert_eq!(memory.iter().filter(|(_, action)| *action == Action::ReleaseMemory).count(), 1);
    }

    fn reports(actions: Vec<(u32, Action)>) -> Vec<(u32, Report)> {
        let logged = |(hundredth, action)| match action {
            Action::Log(report) => Some((hundredth, report)),
            _ => None,
        };
        actions.into_iter().filter_map(logged).collect()
    }

    fn kinds(reports: &[(u32, Report)]) -> Vec<(u32, char)> {
        let kind = |report: &Report| match report {
            Report::Begins(_) => 'b',
            Report::Ended(_) => 'e',
            Report::Missed(_) => 'm',
        };
        reports.iter().map(|(hundredth, report)| (*hundredth, kind(report))).collect()
    }

    fn of_mapping(fault: ProcessFault) -> Disturbance {
        Disturbance::Process { process: mapping(), fault }
    }

    #[test]
    fn the_begin_and_the_end_of_a_fault_are_reported() {
        for disturbance in
            [of_mapping(ProcessFault::Stop), of_mapping(ProcessFault::Slow), of_mapping(ProcessFault::Disk), Disturbance::Memory]
        {
            let all = actions(disturbance.clone(), |plan| {
                times(plan, 2.0, 1.5);
                plan.rate = 0.5.try_into().unwrap();
            });
            assert!(matches!(all[0].1, Action::Log(_)), "the report comes before the action");
            assert_eq!(kinds(&reports(all)), [(200, 'b'), (350, 'e')], "{disturbance:?}");
        }
        let once = reports(actions(of_mapping(ProcessFault::Kill), |plan| times(plan, 2.0, 5.0)));
        assert_eq!(once, [(200, Report::Begins("kills mapping as configured".to_owned()))]);
        let repeated = reports(actions(of_mapping(ProcessFault::Kill), |plan| {
            times(plan, 2.0, 2.5);
            plan.by_s = Some(1.0.try_into().unwrap());
        }));
        assert_eq!(kinds(&repeated), [(200, 'b'), (450, 'e')]);
    }

    #[test]
    fn a_missed_fault_is_reported_once_over_all_incarnations() {
        for disturbance in [of_mapping(ProcessFault::Stop), of_mapping(ProcessFault::Disk), Disturbance::Memory] {
            let passed = |first, since_s| actions_from(first, since_s, disturbance.clone(), |plan| times(plan, 2.0, 1.5));
            assert_eq!(kinds(&reports(passed(500, -1.0))), [(500, 'm')], "{disturbance:?}");
            assert_eq!(passed(500, -1.0).len(), 1, "{disturbance:?}");
            assert_eq!(passed(500, 5.0), [], "{disturbance:?}");
            assert_eq!(kinds(&reports(passed(250, 2.5))), [(250, 'b'), (350, 'e')], "{disturbance:?}");
        }
        let kill = |by_s: Option<f64>, first, since_s| {
            let all = actions_from(first, since_s, of_mapping(ProcessFault::Kill), |plan| {
                times(plan, 2.0, 1.5);
                plan.by_s = by_s.map(|by_s| by_s.try_into().unwrap());
            });
            kinds(&reports(all))
        };
        assert_eq!((kill(None, 500, -1.0), kill(None, 500, 5.0)), (vec![(500, 'b')], vec![]), "a late kill is performed");
        assert_eq!((kill(Some(1.0), 500, -1.0), kill(Some(1.0), 500, 5.0)), (vec![(500, 'b'), (500, 'e')], vec![]));
    }
}
