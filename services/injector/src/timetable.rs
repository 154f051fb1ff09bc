//! When which process is to be disturbed, or the computer.

use settings::{Disturbance, Name, PlannedFault, ProcessFault};

use crate::chance::happens;
use crate::words::{News, Wish, happens_once};

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
    /// Whoever reads the log is told.
    Tell(News),
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
    plan: PlannedFault,
    wish: Wish,
    seed: u64,
    from_s: f64,
    until_s: f64,
    /// The last look.
    looked_s: f64,
    /// What has been told of it.
    phase: Phase,
    /// A process has been left stopped or with a full disk, or memory taken.
    under_way: bool,
}

/// How far a fault is, or the word of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Phase {
    Before,
    Under,
    Over,
}

#[derive(Debug, Clone)]
enum Fault {
    Process(Name, ProcessFault),
    Memory,
}

impl Timetable {
    /// Adds a fault whose times count from `base_s`; what of it lies before `now_s` is not made up for. One of a service is none
    /// of a timetable's.
    pub fn plan(&mut self, plan: &PlannedFault, wish: Wish, base_s: f64, now_s: f64) {
        let fault = match &plan.disturbance {
            Disturbance::Process { process, fault } => Fault::Process(process.clone(), *fault),
            Disturbance::Memory => Fault::Memory,
            Disturbance::Service { .. } => return,
        };
        let from_s = base_s + plan.from_s.get();
        self.entries.push(Entry {
            fault,
            plan: plan.clone(),
            wish,
            seed: u64::from(plan.seed.get()) | (self.entries.len() as u64 + 1) << 32,
            from_s,
            until_s: from_s + plan.for_s.get(),
            looked_s: now_s,
            phase: Phase::Before,
            under_way: false,
        });
    }

    /// What is to be done at `now_s`, in order.
    pub fn due(&mut self, now_s: f64) -> Vec<Deed> {
        let mut deeds = Vec::new();
        for entry in &mut self.entries {
            entry.due(now_s, &mut deeds);
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
    fn due(&mut self, now_s: f64, deeds: &mut Vec<Deed>) {
        let active = (self.from_s..self.until_s).contains(&now_s);
        let deed = match self.fault.clone() {
            Fault::Process(process, fault) => self.harm(fault, active, now_s).map(|harm| Deed::Suffer(process, harm)),
            Fault::Memory => self.hold(active, Deed::FillMemory, Deed::FreeMemory),
        };
        if happens_once(&self.plan) {
            deeds.extend(deed.iter().map(|_| Deed::Tell(News::begins(&self.plan, self.wish))));
            return deeds.extend(deed);
        }
        // A kill that comes late is done all the same.
        if self.phase == Phase::Before && (active || deed.is_some()) {
            self.phase = Phase::Under;
            deeds.push(Deed::Tell(News::begins(&self.plan, self.wish)));
        }
        deeds.extend(deed);
        if now_s >= self.until_s {
            let news = match self.phase {
                Phase::Under => Some(News::over(&self.plan)),
                // Of what was over at the first look an earlier incarnation has told.
                Phase::Before if self.looked_s < self.until_s => Some(News::missed(&self.plan, self.wish)),
                _ => None,
            };
            self.phase = Phase::Over;
            deeds.extend(news.map(Deed::Tell));
        }
    }

    fn harm(&mut self, fault: ProcessFault, active: bool, now_s: f64) -> Option<Harm> {
        match fault {
            ProcessFault::Kill => {
                let last = self.kills_by(self.looked_s);
                let now = self.kills_by(now_s);
                (now > last && (last + 1..=now).any(|kill| happens(self.seed, kill, self.plan.rate.get()))).then_some(Harm::Kill)
            }
            ProcessFault::Stop => self.turn(active, Harm::Stop, Harm::Continue),
            ProcessFault::Slow => {
                let phase = (now_s - self.from_s).rem_euclid(SLOW_PERIOD_S) / SLOW_PERIOD_S;
                self.turn(active && phase < self.plan.rate.get(), Harm::Stop, Harm::Continue)
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
        let Some(by_s) = self.plan.by_s else { return 1 };
        // The end of the fault is not part of it.
        1 + ((at_s.min(self.until_s - 1e-9) - self.from_s) / by_s.get()).max(0.0) as u64
    }

    fn next_s(&self, now_s: f64) -> Option<f64> {
        if now_s < self.from_s {
            return Some(self.from_s);
        }
        if now_s >= self.until_s {
            return self.under_way.then_some(now_s);
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
            Deed::Suffer(process, harm) if process == mapping() => Some((hundredth, harm)),
            Deed::Tell(_) => None,
            other => panic!("{other:?}"),
        };
        all_deeds(Disturbance::Process { process: mapping(), fault }, change).into_iter().filter_map(harm).collect()
    }

    fn all_deeds(disturbance: Disturbance, change: impl Fn(&mut PlannedFault)) -> Vec<(u32, Deed)> {
        deeds_from(0, 0.0, disturbance, change)
    }

    /// The same from a hundredth on, when all that lies before `since_s` is not made up for.
    fn deeds_from(first: u32, since_s: f64, disturbance: Disturbance, change: impl Fn(&mut PlannedFault)) -> Vec<(u32, Deed)> {
        let mut plan = PlannedFault::always(disturbance);
        change(&mut plan);
        let mut timetable = Timetable::default();
        timetable.plan(&plan, Wish::Set, 0.0, since_s);
        let mut done = Vec::new();
        for hundredth in first..1_000 {
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
        assert!(memory.contains(&(300, Deed::FreeMemory)));
        assert_eq!(memory.iter().filter(|(_, deed)| *deed == Deed::FreeMemory).count(), 1);
    }

    fn news(deeds: Vec<(u32, Deed)>) -> Vec<(u32, News)> {
        let told = |(hundredth, deed)| match deed {
            Deed::Tell(news) => Some((hundredth, news)),
            _ => None,
        };
        deeds.into_iter().filter_map(told).collect()
    }

    fn kinds(news: &[(u32, News)]) -> Vec<(u32, char)> {
        let kind = |news: &News| match news {
            News::Begins(_) => 'b',
            News::Over(_) => 'o',
            News::Missed(_) => 'm',
        };
        news.iter().map(|(hundredth, news)| (*hundredth, kind(news))).collect()
    }

    fn of_mapping(fault: ProcessFault) -> Disturbance {
        Disturbance::Process { process: mapping(), fault }
    }

    #[test]
    fn a_fault_is_told_when_it_begins_and_when_it_is_over() {
        for disturbance in
            [of_mapping(ProcessFault::Stop), of_mapping(ProcessFault::Slow), of_mapping(ProcessFault::Disk), Disturbance::Memory]
        {
            let deeds = all_deeds(disturbance.clone(), |plan| {
                times(plan, 2.0, 1.5);
                plan.rate = 0.5.try_into().unwrap();
            });
            assert!(matches!(deeds[0].1, Deed::Tell(_)), "it is told before it is done");
            assert_eq!(kinds(&news(deeds)), [(200, 'b'), (350, 'o')], "{disturbance:?}");
        }
        let once = news(all_deeds(of_mapping(ProcessFault::Kill), |plan| times(plan, 2.0, 5.0)));
        assert_eq!(once, [(200, News::Begins("kills mapping as set".to_owned()))]);
        let again = news(all_deeds(of_mapping(ProcessFault::Kill), |plan| {
            times(plan, 2.0, 2.5);
            plan.by_s = Some(1.0.try_into().unwrap());
        }));
        assert_eq!(kinds(&again), [(200, 'b'), (450, 'o')]);
    }

    #[test]
    fn what_was_over_before_the_first_look_is_told_once_unless_somebody_has_told_of_it() {
        for disturbance in [of_mapping(ProcessFault::Stop), of_mapping(ProcessFault::Disk), Disturbance::Memory] {
            let passed = |first, since_s| deeds_from(first, since_s, disturbance.clone(), |plan| times(plan, 2.0, 1.5));
            assert_eq!(kinds(&news(passed(500, -1.0))), [(500, 'm')], "{disturbance:?}");
            assert_eq!(passed(500, -1.0).len(), 1, "{disturbance:?}");
            assert_eq!(passed(500, 5.0), [], "{disturbance:?}");
            assert_eq!(kinds(&news(passed(250, 2.5))), [(250, 'b'), (350, 'o')], "{disturbance:?}");
        }
        let kill = |by_s: Option<f64>, first, since_s| {
            let deeds = deeds_from(first, since_s, of_mapping(ProcessFault::Kill), |plan| {
                times(plan, 2.0, 1.5);
                plan.by_s = by_s.map(|by_s| by_s.try_into().unwrap());
            });
            kinds(&news(deeds))
        };
        assert_eq!((kill(None, 500, -1.0), kill(None, 500, 5.0)), (vec![(500, 'b')], vec![]), "a late kill is done");
        assert_eq!((kill(Some(1.0), 500, -1.0), kill(Some(1.0), 500, 5.0)), (vec![(500, 'b'), (500, 'o')], vec![]));
    }
}
