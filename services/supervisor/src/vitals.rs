//! What is known of one process: its last heartbeat, its rates, what it uses.

use crate::lifecycle::Lifecycle;
use crate::usage::Usage;
use messages::{Heartbeat, InputCounters, ProcessStatus, Service, Text};
use std::time::Duration;

/// The measures of one process.
#[derive(Debug, Clone, Default)]
pub(crate) struct Vitals {
    heartbeat: Option<(Duration, Heartbeat)>,
    /// What its children before the present one have lost.
    missed_before: Vec<Missed>,
    base: RateBase,
    received_per_s: f64,
    sent_per_s: f64,
    cpu: f64,
    resident_bytes: u64,
}

/// What rates are measured from.
#[derive(Debug, Clone, Copy, Default)]
struct RateBase {
    at: Duration,
    received: u64,
    sent: u64,
    ticks: u64,
}

/// What did not get through on a service.
#[derive(Debug, Clone, Copy)]
struct Missed {
    service: Text<32>,
    lost: u64,
    refused: u64,
}

/// What the machine counts in.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MachineUnits {
    pub(crate) ticks_per_s: u64,
    pub(crate) page_bytes: u64,
}

impl Vitals {
    /// Takes a heartbeat of the present child.
    pub(crate) fn take(&mut self, heartbeat: &Heartbeat, now: Duration) {
        self.heartbeat = Some((now, *heartbeat));
    }

    /// A new child counts from zero; what those before it have lost is still reported.
    pub(crate) fn begin(&mut self, now: Duration) {
        *self = Self { base: RateBase { at: now, ..RateBase::default() }, missed_before: self.missed(), ..Self::default() };
    }

    /// No child, no use of the machine.
    pub(crate) fn end(&mut self) {
        (self.cpu, self.resident_bytes, self.received_per_s, self.sent_per_s) = (0.0, 0, 0.0, 0.0);
    }

    /// Measures rates since the last sample.
    pub(crate) fn sample(&mut self, usage: Option<Usage>, units: MachineUnits, now: Duration) {
        let elapsed_s = now.saturating_sub(self.base.at).as_secs_f64();
        if elapsed_s <= 0.0 {
            return;
        }
        let ticks = usage.map_or(self.base.ticks, |usage| usage.ticks);
        let base = RateBase { at: now, received: self.received(), sent: self.sent(), ticks };
        let per_s = |new: u64, old: u64| new.saturating_sub(old) as f64 / elapsed_s;
        self.received_per_s = per_s(base.received, self.base.received);
        self.sent_per_s = per_s(base.sent, self.base.sent);
        self.cpu = per_s(base.ticks, self.base.ticks) / units.ticks_per_s.max(1) as f64;
        self.resident_bytes = usage.map_or(0, |usage| usage.pages * units.page_bytes);
        self.base = base;
    }

    /// How far the present child has come in streams that end: their last numbers, added up. Everything else may be published for
    /// ever, although nothing moves.
    pub(crate) fn work(&self) -> u64 {
        let is_sequenced = |name: &str| Service::named(name).is_some_and(|service| service.sequenced);
        self.inputs().filter(|input| is_sequenced(input.service.as_str())).map(|input| input.last_seq).sum()
    }

    /// The process as the supervisor tells of it; `pid` 0 when no child runs.
    pub(crate) fn status(&self, lifecycle: &Lifecycle, pid: u32, now: Duration) -> ProcessStatus {
        let last = self.heartbeat.as_ref().map(|(_, heartbeat)| heartbeat);
        let missed = self.missed();
        let note = if lifecycle.cause().is_empty() { self.note(&missed) } else { Text::new(lifecycle.cause()) };
        let age = self.heartbeat.as_ref().map(|(at, _)| now.saturating_sub(*at).as_millis() as u64);
        let counters_count = last.map_or(0, |h| h.counters_count);
        let busiest = self.inputs().filter(|input| input.latency_p99_us > 0).max_by_key(|input| input.received);
        ProcessStatus {
            process: Text::new(&lifecycle.plan().name),
            note,
            heartbeat_age_ms: age.unwrap_or(u64::MAX),
            received: self.received(),
            lost: missed.iter().fold(0, |sum, of| sum.saturating_add(of.lost)),
            refused: missed.iter().fold(0, |sum, of| sum.saturating_add(of.refused)),
            sent: self.sent(),
            received_per_s: self.received_per_s,
            sent_per_s: self.sent_per_s,
            latency_median_us: busiest.map_or(0, |input| input.latency_median_us),
            latency_p99_us: busiest.map_or(0, |input| input.latency_p99_us),
            cpu: self.cpu.min(1e4),
            resident_bytes: self.resident_bytes,
            counters: last.map(|h| h.counters).unwrap_or_default(),
            counters_count,
            pid,
            state: lifecycle.process_state() as u32,
            restarts: lifecycle.restarted(),
        }
    }

    /// The note of the process, behind what it had to refuse: that is the fault of a sender, and no other process reports it.
    fn note(&self, missed: &[Missed]) -> Text<128> {
        let note = self.heartbeat.as_ref().map(|(_, heartbeat)| heartbeat.note).unwrap_or_default();
        let refused = missed.iter().filter(|of| of.refused > 0).map(|of| format!("refused {} of {}", of.refused, of.service));
        let mut words: Vec<String> = refused.collect();
        if words.is_empty() {
            return note;
        }
        words.extend(Some(note.to_string()).filter(|note| !note.is_empty()));
        Text::new(&words.join("; "))
    }

    /// What did not get through to any of its children.
    fn missed(&self) -> Vec<Missed> {
        let mut missed = self.missed_before.clone();
        let short = self.inputs().filter(|input| input.lost > 0 || input.refused > 0);
        for &InputCounters { service, lost, refused, .. } in short {
            match missed.iter_mut().find(|of| of.service == service) {
                Some(of) => (of.lost, of.refused) = (of.lost.saturating_add(lost), of.refused.saturating_add(refused)),
                None => missed.push(Missed { service, lost, refused }),
            }
        }
        missed
    }

    fn inputs(&self) -> impl Iterator<Item = &InputCounters> {
        self.heartbeat.iter().flat_map(|(_, h)| h.inputs.iter().take(h.inputs_count as usize))
    }

    fn received(&self) -> u64 {
        self.inputs().map(|input| input.received).sum()
    }

    fn sent(&self) -> u64 {
        self.heartbeat.as_ref().map_or(0, |(_, heartbeat)| heartbeat.sent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lifecycle::{Plan, Role};

    const UNITS: MachineUnits = MachineUnits { ticks_per_s: 100, page_bytes: 4096 };

    fn heartbeat(received: u64, sent: u64) -> Heartbeat {
        let mut it = Heartbeat { sent, inputs_count: 2, note: Text::new("searching"), ..Heartbeat::default() };
        it.inputs[0] = InputCounters { received, lost: 3, latency_median_us: 200, latency_p99_us: 900, ..InputCounters::default() };
        it.inputs[1] =
            InputCounters { service: Text::new("map/verdict"), received: 1, last_seq: 1, refused: 2, ..InputCounters::default() };
        it.inputs[2] = InputCounters { received: 999, ..InputCounters::default() };
        it
    }

    fn lifecycle() -> Lifecycle {
        Lifecycle::new(Plan { name: "mapping".to_owned(), role: Role::Consumer, ends_run: false, essential: false }, 1)
    }

    #[test]
    fn rates_are_measured_between_samples() {
        let mut vitals = Vitals::default();
        vitals.begin(Duration::from_secs(10));
        vitals.take(&heartbeat(99, 40), Duration::from_secs(11));
        vitals.sample(Some(Usage { ticks: 50, pages: 3 }), UNITS, Duration::from_secs(12));
        let status = vitals.status(&lifecycle(), 7, Duration::from_secs(13));
        assert_eq!((status.received, status.sent, status.lost, status.refused), (100, 40, 3, 2));
        assert_eq!((status.latency_median_us, status.latency_p99_us), (200, 900), "of the busiest input");
        assert_eq!((status.received_per_s, status.sent_per_s, status.cpu), (50.0, 20.0, 0.25));
        assert_eq!((status.resident_bytes, status.heartbeat_age_ms, status.pid), (3 * 4096, 2000, 7));
        assert_eq!(status.note.as_str(), "refused 2 of map/verdict; searching");
    }

    #[test]
    fn losses_are_still_reported_after_a_restart() {
        let mut vitals = Vitals::default();
        let told = |vitals: &Vitals| {
            let status = vitals.status(&lifecycle(), 0, Duration::from_secs(9));
            (status.received, status.lost, status.refused, status.note.to_string())
        };
        vitals.take(&heartbeat(7, 0), Duration::from_secs(1));
        vitals.begin(Duration::from_secs(2));
        assert_eq!(told(&vitals), (0, 3, 2, "refused 2 of map/verdict".to_owned()));
        vitals.take(&heartbeat(9, 0), Duration::from_secs(3));
        assert_eq!(told(&vitals), (10, 6, 4, "refused 4 of map/verdict; searching".to_owned()));
        vitals.end();
        vitals.begin(Duration::from_secs(4));
        let mut other = heartbeat(1, 0);
        other.inputs[1].service = Text::new("robot/scan");
        vitals.take(&other, Duration::from_secs(5));
        assert_eq!(told(&vitals), (2, 9, 6, "refused 4 of map/verdict; refused 2 of robot/scan; searching".to_owned()));
    }

    #[test]
    fn reports_of_an_idle_process_are_no_work() {
        let mut vitals = Vitals::default();
        let mut idle = heartbeat(10, 5);
        vitals.take(&idle, Duration::from_secs(1));
        assert_eq!(vitals.work(), 1);
        (idle.inputs[0].received, idle.sent) = (20, 10);
        vitals.take(&idle, Duration::from_secs(2));
        assert_eq!(vitals.work(), 1);
        idle.inputs[1].last_seq = 2;
        vitals.take(&idle, Duration::from_secs(3));
        assert_eq!(vitals.work(), 2);
    }

    #[test]
    fn a_process_without_a_heartbeat_has_no_age() {
        assert_eq!(Vitals::default().status(&lifecycle(), 0, Duration::from_secs(1)).heartbeat_age_ms, u64::MAX);
    }

    #[test]
    fn a_new_child_counts_from_zero() {
        let mut vitals = Vitals::default();
        vitals.take(&heartbeat(1000, 1000), Duration::from_secs(1));
        vitals.sample(None, UNITS, Duration::from_secs(2));
        vitals.begin(Duration::from_secs(3));
        vitals.take(&heartbeat(9, 0), Duration::from_secs(4));
        vitals.sample(None, UNITS, Duration::from_secs(4));
        assert_eq!(vitals.status(&lifecycle(), 0, Duration::from_secs(4)).received_per_s, 10.0);
        vitals.end();
        assert_eq!(vitals.status(&lifecycle(), 0, Duration::from_secs(4)).received_per_s, 0.0);
    }
}
