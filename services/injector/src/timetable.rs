//! When which process is to be disturbed, or the computer.

use settings::{Disturbance, Name, PlannedFault, ProcessFault};

use crate::chance::happens;

/// Time of one stop and go of a slowed process, s.
const SLOW_PERIOD_S: f64 = 0.1;
/// How often a process is looked at whose files may not grow, for it may have been started again; and memory, of which some may
/// have been given back.
const LOOK_S: f64 = 0.2;

/// What is done.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Deed {
    /// A process suffers this.
    Suffer(Name, Harm),
    /// What is free of shared memory is taken.
    FillMemory,
    /// It is given back.
    FreeMemory,
}

/// What is done to a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Harm {
    /// It is killed.
    Kill,
    /// It stands still.
    Stop,
    /// It goes on.
    Continue,
    /// Its files grow no more.
    FillDisk,
    /// Its files may grow again.
    FreeDisk,
}

/// Faults of processes and of memory, and what of them has been done; times are seconds of deployment time since the run began.
#[derive(Debug, Clone, Default)]
pub struct Timetable {
    entries: Vec<Entry>,
}

#[derive(Debug, Clone)]
struct Entry {
    fault: Fault,
    rate: f64,
    seed: u64,
    from_s: f64,
    until_s: f64,
    by_s: Option<f64>,
    /// The last look.
    looked_s: f64,
    /// A process has been left stopped or with a full disk, or memory taken.
    under_way: bool,
}

#[derive(Debug, Clone)]
enum Fault {
    Process(Name, ProcessFault),
    Memory,
}

impl Timetable {
    /// Adds a fault whose times count from `base_s`; what of it lies before `now_s` is not made up for. One of a service is none
    /// of a timetable's.
    pub fn plan(&mut self, plan: &PlannedFault, base_s: f64, now_s: f64) {
        let fault = match &plan.disturbance {
            Disturbance::Process { process, fault } => Fault::Process(process.clone(), *fault),
            Disturbance::Memory => Fault::Memory,
            Disturbance::Service { .. } => return,
        };
        let from_s = base_s + plan.from_s.get();
        self.entries.push(Entry {
            fault,
            rate: plan.rate.get(),
            seed: u64::from(plan.seed.get()) | (self.entries.len() as u64 + 1) << 32,
            from_s,
            until_s: from_s + plan.for_s.get(),
            by_s: plan.by_s.map(settings::FaultPeriod::get),
            looked_s: now_s,
            under_way: false,
        });
    }

    /// What is to be done at `now_s`, in order.
    pub fn due(&mut self, now_s: f64) -> Vec<Deed> {
        let mut deeds = Vec::new();
        for entry in &mut self.entries {
            deeds.extend(entry.due(now_s));
            entry.looked_s = now_s;
        }
        deeds
    }

    /// When to look again, at the latest; `None` when nothing is to come.
    #[must_use]
    pub fn next_s(&self, now_s: f64) -> Option<f64> {
        self.entries.iter().filter_map(|entry| entry.next_s(now_s)).min_by(f64::total_cmp)
    }
}

impl Entry {
    fn due(&mut self, now_s: f64) -> Option<Deed> {
        let active = (self.from_s..self.until_s).contains(&now_s);
        match self.fault.clone() {
            Fault::Process(process, fault) => self.harm(fault, active, now_s).map(|harm| Deed::Suffer(process, harm)),
            Fault::Memory => self.hold(active, Deed::FillMemory, Deed::FreeMemory),
        }
    }

    fn harm(&mut self, fault: ProcessFault, active: bool, now_s: f64) -> Option<Harm> {
        match fault {
            ProcessFault::Kill => {
                let last = self.kills_by(self.looked_s);
                let now = self.kills_by(now_s);
                (now > last && (last + 1..=now).any(|kill| happens(self.seed, kill, self.rate))).then_some(Harm::Kill)
            }
            ProcessFault::Stop => self.turn(active, Harm::Stop, Harm::Continue),
            ProcessFault::Slow => {
                let phase = (now_s - self.from_s).rem_euclid(SLOW_PERIOD_S) / SLOW_PERIOD_S;
                self.turn(active && phase < self.rate, Harm::Stop, Harm::Continue)
            }
            ProcessFault::Disk => self.hold(active, Harm::FillDisk, Harm::FreeDisk),
        }
    }

    /// The deed that is done again at each look, or the one that ends it.
    fn hold<D>(&mut self, active: bool, on: D, off: D) -> Option<D> {
        if active {
            self.under_way = true;
            return Some(on);
        }
        self.turn(false, on, off)
    }

    /// The deed that makes it so, if it is not.
    fn turn<D>(&mut self, wanted: bool, on: D, off: D) -> Option<D> {
        let turned = self.under_way != wanted;
        self.under_way = wanted;
        turned.then_some(if wanted { on } else { off })
    }

    /// Kills that were due up to `at_s`.
    fn kills_by(&self, at_s: f64) -> u64 {
        if at_s < self.from_s {
            return 0;
        }
        let Some(by_s) = self.by_s else { return 1 };
        // The end of the fault is not part of it.
        1 + ((at_s.min(self.until_s - 1e-9) - self.from_s) / by_s).max(0.0) as u64
    }

    fn next_s(&self, now_s: f64) -> Option<f64> {
        if now_s < self.from_s {
            return Some(self.from_s);
        }
        if now_s >= self.until_s {
            return self.under_way.then_some(now_s);
        }
        match &self.fault {
            Fault::Process(_, ProcessFault::Kill) => self.by_s.map(|by_s| self.from_s + self.kills_by(now_s) as f64 * by_s),
            Fault::Process(_, ProcessFault::Stop) => Some(self.until_s),
            Fault::Process(_, ProcessFault::Slow) => {
                let periods = ((now_s - self.from_s) / SLOW_PERIOD_S).floor();
                let begin_s = self.from_s + periods * SLOW_PERIOD_S;
                let middle_s = begin_s + self.rate * SLOW_PERIOD_S;
                Some(if now_s < middle_s { middle_s } else { begin_s + SLOW_PERIOD_S })
            }
            Fault::Process(_, ProcessFault::Disk) | Fault::Memory => Some((now_s + LOOK_S).min(self.until_s)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mapping() -> Name {
        "mapping".to_owned().try_into().unwrap()
    }

    /// Looks a hundred times a second for 10 s; what was done to a process when, in hundredths.
    fn deeds(fault: ProcessFault, change: impl Fn(&mut PlannedFault)) -> Vec<(u32, Harm)> {
        let harm = |(hundredth, deed)| match deed {
            Deed::Suffer(process, harm) if process == mapping() => (hundredth, harm),
            other => panic!("{other:?}"),
        };
        all_deeds(Disturbance::Process { process: mapping(), fault }, change).into_iter().map(harm).collect()
    }

    fn all_deeds(disturbance: Disturbance, change: impl Fn(&mut PlannedFault)) -> Vec<(u32, Deed)> {
        let mut plan = PlannedFault::always(disturbance);
        change(&mut plan);
        let mut timetable = Timetable::default();
        timetable.plan(&plan, 0.0, 0.0);
        let mut done = Vec::new();
        for hundredth in 0..1_000 {
            let now_s = f64::from(hundredth) / 100.0;
            done.extend(timetable.due(now_s).into_iter().map(|deed| (hundredth, deed)));
            assert!(timetable.next_s(now_s).is_none_or(|next_s| next_s >= now_s));
        }
        done
    }

    fn times(plan: &mut PlannedFault, from_s: f64, for_s: f64) {
        plan.from_s = from_s.try_into().unwrap();
        plan.for_s = for_s.try_into().unwrap();
    }

    #[test]
    fn kills_once_or_again_and_again() {
        assert_eq!(deeds(ProcessFault::Kill, |plan| times(plan, 2.0, 5.0)), [(200, Harm::Kill)]);
        let again = deeds(ProcessFault::Kill, |plan| {
            times(plan, 2.0, 3.0);
            plan.by_s = Some(1.0.try_into().unwrap());
        });
        assert_eq!(again, [(200, Harm::Kill), (300, Harm::Kill), (400, Harm::Kill)]);
        assert_eq!(deeds(ProcessFault::Kill, |plan| plan.rate = 0.0.try_into().unwrap()), []);
    }

    #[test]
    fn what_is_stopped_goes_on() {
        assert_eq!(deeds(ProcessFault::Stop, |plan| times(plan, 2.0, 1.5)), [(200, Harm::Stop), (350, Harm::Continue)]);
        let slow = deeds(ProcessFault::Slow, |plan| {
            times(plan, 1.0, 1.0);
            plan.rate = 0.5.try_into().unwrap();
        });
        let stops = slow.iter().filter(|(_, deed)| *deed == Harm::Stop).count();
        assert!((9..=11).contains(&stops), "{stops} stops in ten periods");
        assert_eq!(slow.last().map(|(_, deed)| *deed), Some(Harm::Continue));
    }

    #[test]
    fn a_full_disk_is_full_for_every_incarnation_and_then_is_not() {
        let disk = deeds(ProcessFault::Disk, |plan| times(plan, 1.0, 2.0));
        assert_eq!(disk.iter().filter(|(_, deed)| *deed == Harm::FillDisk).count(), 200);
        assert_eq!(disk.last(), Some(&(300, Harm::FreeDisk)));
        assert_eq!(disk.iter().filter(|(_, deed)| *deed == Harm::FreeDisk).count(), 1);
    }
    #[test]
    fn memory_is_taken_as_it_becomes_free_and_given_back_once() {
        let memory = all_deeds(Disturbance::Memory, |plan| times(plan, 1.0, 2.0));
        assert_eq!(memory.iter().filter(|(_, deed)| *deed == Deed::FillMemory).count(), 200);
        assert_eq!(memory.last(), Some(&(300, Deed::FreeMemory)));
    }
}
