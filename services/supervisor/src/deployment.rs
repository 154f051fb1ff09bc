//! The whole deployment: `(state, event, now) -> actions`.
//!
//! A run goes through these phases, and from any of them only down:
//!
//! | phase | what happens |
//! | --- | --- |
//! | running | processes start one after the other, each when the one before has given a sign of life; what dies or hangs starts again |
//! | draining | the sources are asked to stop, and stay until what they have published has been taken; everything else ends by itself once its inputs have ended; what dies still starts again, a source to publish the end of its streams |
//! | stopping | what is left is asked to stop, the last started first, one at a time; what does not is killed |
//! | over | nothing runs |
//!
//! The exception is *rebuilding*: a child that finds the shared memory broken makes the supervisor kill everything, make
//! the domain anew, and go back to running; the processes resume from their checkpoints.

use crate::events::{Action, Ending, Event, Notice, Standstill};
use crate::lifecycle::{Exit, Lifecycle, Plan, Role, State};
use crate::policy::{Policy, Restarts};
use std::time::Duration;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    Running,
    Rebuilding { stage: Stage, drains: bool },
    Draining { began: Duration, quiet_since: Duration },
    Stopping,
    Over,
}

/// How far the domain is on its way to be made anew.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// The sources are killed; the others take what these have sent, and save it.
    Settling { until: Duration },
    /// The others are killed, too.
    Killing,
    /// Nothing lives in the domain any more.
    Asked,
}

/// How long processes have, once their sources are gone, to take what waits and to save their state: they save it after a second without
/// a message, and the recorder writes once a second.
const SETTLING: Duration = Duration::from_secs(3);
/// A drain ends at the latest after this many stop deadlines, whatever still seems to move.
const LONGEST_DRAIN: u32 = 40;

/// The supervisor's state machine.
#[derive(Debug, Clone)]
pub struct Deployment {
    policy: Policy,
    processes: Vec<Lifecycle>,
    phase: Phase,
    ending: Option<Ending>,
    rebuilds: Restarts,
}

impl Deployment {
    /// Processes in start order; nothing runs yet. `seed` decides the jitter of restarts.
    #[must_use]
    pub fn new(policy: Policy, plans: Vec<Plan>, seed: u64) -> Self {
        let processes = plans.into_iter().zip(1..).map(|(plan, i)| Lifecycle::new(plan, seed.wrapping_add(i))).collect();
        Self { policy, processes, phase: Phase::Running, ending: None, rebuilds: Restarts::new(seed) }
    }

    /// The processes in start order.
    #[must_use]
    pub fn processes(&self) -> &[Lifecycle] {
        &self.processes
    }

    /// Why the run ends or has ended; `None` while it runs.
    #[must_use]
    pub fn ending(&self) -> Option<Ending> {
        self.ending
    }

    /// Whether nothing runs any more and nothing will.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.phase == Phase::Over
    }

    /// When the next step is due without an event.
    #[must_use]
    pub fn due(&self) -> Option<Duration> {
        let phase = match self.phase {
            Phase::Draining { began, quiet_since } => {
                Some((quiet_since + self.policy.stop_deadline).min(began + self.policy.stop_deadline * LONGEST_DRAIN))
            }
            Phase::Rebuilding { stage: Stage::Settling { until }, .. } => Some(until),
            _ => None,
        };
        self.processes.iter().filter_map(|p| p.due(&self.policy)).chain(phase).min()
    }

    /// Takes one event and says what to do, in order.
    ///
    /// Only [`Event::Tick`] ends a deadline: all that was received before it has to be fed before it.
    pub fn step(&mut self, event: Event, now: Duration) -> Vec<Action> {
        let mut actions = Vec::new();
        let ticks = event == Event::Tick;
        match event {
            Event::Heartbeat { process, work, ending } => self.on_heartbeat(process, work, ending, now, &mut actions),
            Event::Exited { process, exit } => self.on_exit(process, exit, now, &mut actions),
            Event::Rebuilt => self.start_anew(now),
            Event::DomainLost => self.begin_rebuild(now, &mut actions),
            Event::RestartAsked { process } => self.on_restart_request(process, now, &mut actions),
            Event::StopAsked => self.on_stop_request(now, &mut actions),
            Event::StoodStill(standstill) => self.give_time_again(standstill, now, &mut actions),
            Event::Tick => {}
        }
        if ticks {
            self.kill_what_hangs(now, &mut actions);
            self.kill_what_does_not_stop(now, &mut actions);
        }
        match self.phase {
            Phase::Running => self.run(now, &mut actions),
            Phase::Rebuilding { stage: Stage::Settling { until }, drains } if now >= until => {
                self.phase = Phase::Rebuilding { stage: Stage::Killing, drains };
                self.kill_for_rebuild(|_| true, &mut actions);
            }
            Phase::Rebuilding { stage: Stage::Killing, drains } if !self.processes.iter().any(Lifecycle::is_live) => {
                self.phase = Phase::Rebuilding { stage: Stage::Asked, drains };
                actions.push(Action::Rebuild);
            }
            Phase::Rebuilding { .. } | Phase::Draining { .. } | Phase::Stopping | Phase::Over => {}
        }
        if let Phase::Draining { .. } = self.phase {
            self.drain(ticks, now, &mut actions);
        }
        if self.phase == Phase::Stopping {
            self.stop(now, &mut actions);
        }
        actions
    }

    fn on_heartbeat(&mut self, process: usize, work: u64, ending: bool, now: Duration, actions: &mut Vec<Action>) {
        let Some(it) = self.processes.get_mut(process) else { return };
        let draining = matches!(self.phase, Phase::Draining { .. });
        let first = match it.state {
            State::Starting { .. } => true,
            State::Running { .. } => false,
            // A source that has stopped its work, and stays until what it published has been taken.
            State::Stopping { killed: false, .. } if draining && ending => false,
            // No process has the time any more to take it.
            State::Stopping { killed: false, .. } if self.phase == Phase::Stopping && ending => {
                return actions.push(Action::Terminate(process));
            }
            _ => return,
        };
        let is_late = first && it.plan.role == Role::Source && draining;
        it.state = if is_late {
            State::Stopping { deadline: now + self.policy.stop_deadline, killed: false }
        } else {
            State::Running { last_heartbeat: now }
        };
        it.cause.clear();
        let moved = first || it.work != work;
        it.work = work;
        if first {
            actions.push(Action::Tell(Notice::Up { process }));
        }
        if is_late {
            actions.push(Action::Terminate(process));
        }
        if moved {
            self.note_progress(now);
        }
    }

    /// A drain lasts while something moves.
    fn note_progress(&mut self, now: Duration) {
        if let Phase::Draining { quiet_since, .. } = &mut self.phase {
            *quiet_since = now;
        }
    }

    fn on_exit(&mut self, process: usize, exit: Exit, now: Duration, actions: &mut Vec<Action>) {
        let Some(it) = self.processes.get_mut(process).filter(|it| it.is_live()) else { return };
        let hung = it.state == State::Killed;
        let asked = match it.state {
            State::Stopping { killed, .. } => Some(killed),
            _ => None,
        };
        let cause = if hung { it.cause.clone() } else { exit.to_string() };
        let repeats = it.repeats(&exit);
        let requested = std::mem::take(&mut it.restart_requested);
        self.note_progress(now);
        match (exit, asked) {
            (Exit::Finished, _) => self.finish(process, actions),
            (Exit::BadInput, _) => {
                self.fail(process, cause, actions);
                self.begin_stop(Ending::BadInput { process }, actions);
            }
            _ if matches!(self.phase, Phase::Rebuilding { .. }) => self.set(process, State::Waiting),
            (Exit::Signal(15), Some(false)) => self.finish(process, actions),
            (_, Some(true)) => self.fail(process, "had to be killed when the run ended".to_owned(), actions),
            // It may not have published the end of its streams, which the others wait for.
            (Exit::Signal(_), Some(false)) if matches!(self.phase, Phase::Draining { .. }) => self.back_off(process, cause, now, actions),
            (_, Some(false)) => self.fail(process, cause, actions),
            (Exit::BrokenDomain, None) if matches!(self.phase, Phase::Running | Phase::Draining { .. }) => {
                self.set(process, State::Waiting);
                self.begin_rebuild(now, actions);
            }
            (_, None) if requested => self.set(process, State::Backoff { until: now }),
            (_, None) if repeats => {
                self.fail(process, format!("{cause}; the same error twice at the same place, not started again"), actions);
            }
            (_, None) => self.back_off(process, cause, now, actions),
        }
    }

    fn set(&mut self, process: usize, state: State) {
        if let Some(it) = self.processes.get_mut(process) {
            it.state = state;
        }
    }

    fn finish(&mut self, process: usize, actions: &mut Vec<Action>) {
        self.set(process, State::Finished);
        actions.push(Action::Tell(Notice::Finished { process }));
    }

    fn fail(&mut self, process: usize, cause: String, actions: &mut Vec<Action>) {
        if let Some(it) = self.processes.get_mut(process) {
            it.state = State::Failed;
            it.cause.clone_from(&cause);
        }
        actions.push(Action::Tell(Notice::Failed { process, cause }));
    }

    fn back_off(&mut self, process: usize, cause: String, now: Duration, actions: &mut Vec<Action>) {
        let Some(it) = self.processes.get_mut(process) else { return };
        if self.phase == Phase::Stopping {
            return self.fail(process, cause, actions);
        }
        match it.restarts.grant(&self.policy, now) {
            Some(until) => {
                it.state = State::Backoff { until };
                it.cause.clone_from(&cause);
                actions.push(Action::Tell(Notice::Restarting { process, cause, after: until - now }));
            }
            None => {
                let budget =
                    format!("{cause}; {} restarts in {} s were not enough", self.policy.restarts, self.policy.within.as_secs_f64());
                self.fail(process, budget, actions);
            }
        }
    }

    /// Starts another child on request. That counts for no budget, and a process that has failed for good has its whole budget again.
    fn on_restart_request(&mut self, process: usize, now: Duration, actions: &mut Vec<Action>) {
        let Some(it) = self.processes.get_mut(process).filter(|_| self.phase == Phase::Running) else { return };
        match it.state {
            State::Starting { .. } | State::Running { .. } => {
                it.state = State::Killed;
                it.restart_requested = true;
                actions.push(Action::Kill(process));
            }
            State::Backoff { .. } | State::Failed => {
                it.state = State::Backoff { until: now };
                it.last_error = None;
                it.restarts.clear();
            }
            // The next child comes anyway, or none is needed any more.
            State::Killed | State::Waiting | State::Stopping { .. } | State::Finished => return,
        }
        it.cause.clear();
        actions.push(Action::Tell(Notice::RestartRequested { process }));
    }

    fn kill_what_hangs(&mut self, now: Duration, actions: &mut Vec<Action>) {
        for (process, it) in self.processes.iter_mut().enumerate() {
            if let Some(cause) = it.hangs(&self.policy, now) {
                it.state = State::Killed;
                it.cause.clone_from(&cause);
                actions.extend([Action::Tell(Notice::Hangs { process, cause }), Action::Kill(process)]);
            }
        }
    }

    /// Processes that stood still with the supervisor need a moment to give a sign of life.
    fn give_time_again(&mut self, standstill: Standstill, now: Duration, actions: &mut Vec<Action>) {
        actions.push(Action::Tell(Notice::StoodStill(standstill)));
        for it in &mut self.processes {
            if let State::Running { last_heartbeat } = &mut it.state {
                *last_heartbeat = now;
            }
        }
    }

    fn run(&mut self, now: Duration, actions: &mut Vec<Action>) {
        let lost = |(_, it): &(usize, &Lifecycle)| it.state == State::Failed && (it.plan.essential || it.plan.ends_run);
        if let Some((process, _)) = self.processes.iter().enumerate().find(lost) {
            return self.begin_drain(Ending::Lost { process }, now, actions);
        }
        if self.processes.iter().any(|it| it.plan.ends_run && it.state == State::Finished) {
            return self.begin_drain(Ending::Complete, now, actions);
        }
        if self.processes.iter().all(Lifecycle::is_over) {
            return self.begin_drain(Ending::NothingLeft, now, actions);
        }
        self.start_again(now, actions);
        for process in 0..self.processes.len() {
            match self.processes[process].state {
                State::Waiting => return self.spawn(process, now, actions),
                State::Starting { .. } => return,
                _ => {}
            }
        }
    }

    fn start_again(&mut self, now: Duration, actions: &mut Vec<Action>) {
        for process in 0..self.processes.len() {
            if matches!(self.processes[process].state, State::Backoff { until } if now >= until) {
                self.spawn(process, now, actions);
            }
        }
    }

    fn spawn(&mut self, process: usize, now: Duration, actions: &mut Vec<Action>) {
        let it = &mut self.processes[process];
        it.state = State::Starting { deadline: now + self.policy.startup_deadline };
        it.work = 0;
        actions.push(Action::Spawn { process, incarnation: it.starts });
        it.starts += 1;
        self.note_progress(now);
    }

    fn begin_rebuild(&mut self, now: Duration, actions: &mut Vec<Action>) {
        let drains = match self.phase {
            Phase::Running => false,
            Phase::Draining { .. } => true,
            Phase::Rebuilding { .. } | Phase::Stopping | Phase::Over => return,
        };
        if self.rebuilds.grant(&self.policy, now).is_none() {
            return self.begin_stop(Ending::DomainBroken, actions);
        }
        self.phase = Phase::Rebuilding { stage: Stage::Settling { until: now + SETTLING }, drains };
        actions.push(Action::Tell(Notice::Rebuilds));
        self.kill_for_rebuild(|plan| plan.role == Role::Source, actions);
    }

    fn kill_for_rebuild(&mut self, concerns: impl Fn(&Plan) -> bool, actions: &mut Vec<Action>) {
        for (process, it) in self.processes.iter_mut().enumerate().filter(|(_, it)| concerns(&it.plan)) {
            match it.state {
                State::Backoff { .. } => it.state = State::Waiting,
                State::Starting { .. } | State::Running { .. } | State::Stopping { .. } => {
                    it.state = State::Killed;
                    actions.push(Action::Kill(process));
                }
                _ => {}
            }
        }
    }

    /// In a drain everything that was killed starts at once, since each has something to finish; in a run one after the other.
    fn start_anew(&mut self, now: Duration) {
        let Phase::Rebuilding { drains, .. } = self.phase else { return };
        if !drains {
            self.phase = Phase::Running;
            return;
        }
        self.phase = Phase::Draining { began: now, quiet_since: now };
        for it in self.processes.iter_mut().filter(|it| it.state == State::Waiting) {
            it.state = State::Backoff { until: now };
        }
    }

    fn begin_drain(&mut self, ending: Ending, now: Duration, actions: &mut Vec<Action>) {
        self.end(ending, actions);
        self.phase = Phase::Draining { began: now, quiet_since: now };
        let deadline = now + self.policy.stop_deadline;
        for (process, it) in self.processes.iter_mut().enumerate().rev() {
            let source = it.plan.role == Role::Source;
            match it.state {
                State::Waiting => it.state = State::Finished,
                // One that starts again has something to end, and cannot yet be asked.
                State::Starting { .. } if source && it.restarted() > 0 => {}
                State::Starting { .. } | State::Running { .. } if source => {
                    it.state = State::Stopping { deadline, killed: false };
                    actions.push(Action::Terminate(process));
                }
                _ => {}
            }
        }
    }

    fn drain(&mut self, ticks: bool, now: Duration, actions: &mut Vec<Action>) {
        let Phase::Draining { began, quiet_since } = self.phase else { return };
        self.start_again(now, actions);
        let quiet = ticks && now >= quiet_since + self.policy.stop_deadline;
        let too_long = ticks && now >= began + self.policy.stop_deadline * LONGEST_DRAIN;
        let over = self.processes.iter().all(Lifecycle::is_over);
        if too_long && !quiet && !over {
            actions.push(Action::Tell(Notice::Restless { after: now - began }));
        }
        if quiet || too_long || over {
            self.phase = Phase::Stopping;
        }
    }

    fn kill_what_does_not_stop(&mut self, now: Duration, actions: &mut Vec<Action>) {
        for process in 0..self.processes.len() {
            match self.processes[process].state {
                State::Stopping { deadline, killed: false } if now >= deadline => {
                    self.set(process, State::Stopping { deadline: now + self.policy.stop_deadline, killed: true });
                    actions.push(Action::Kill(process));
                }
                State::Stopping { deadline, killed: true } if now >= deadline => {
                    self.fail(process, "does not die even when killed".to_owned(), actions);
                }
                _ => {}
            }
        }
    }

    fn begin_stop(&mut self, ending: Ending, actions: &mut Vec<Action>) {
        self.end(ending, actions);
        self.phase = Phase::Stopping;
    }

    fn stop(&mut self, now: Duration, actions: &mut Vec<Action>) {
        let deadline = now + self.policy.stop_deadline;
        for it in &mut self.processes {
            match it.state {
                State::Waiting => it.state = State::Finished,
                State::Backoff { .. } => it.state = State::Failed,
                State::Killed => it.state = State::Stopping { deadline, killed: true },
                _ => {}
            }
        }
        match self.processes.iter_mut().enumerate().rev().find(|(_, it)| it.is_live()) {
            None => self.phase = Phase::Over,
            Some((_, it)) if matches!(it.state, State::Stopping { .. }) => {}
            Some((process, it)) => {
                it.state = State::Stopping { deadline, killed: false };
                actions.push(Action::Terminate(process));
            }
        }
    }

    /// The first request drains, the second stops, the third kills.
    fn on_stop_request(&mut self, now: Duration, actions: &mut Vec<Action>) {
        match self.phase {
            Phase::Running => self.begin_drain(Ending::Asked, now, actions),
            Phase::Rebuilding { .. } => self.begin_stop(Ending::Asked, actions),
            Phase::Draining { .. } => self.phase = Phase::Stopping,
            Phase::Stopping => {
                self.ending = Some(Ending::Forced);
                let deadline = now + self.policy.stop_deadline;
                for (process, it) in self.processes.iter_mut().enumerate().filter(|(_, it)| it.is_live()) {
                    it.state = State::Stopping { deadline, killed: true };
                    actions.push(Action::Kill(process));
                }
            }
            Phase::Over => {}
        }
    }

    fn end(&mut self, ending: Ending, actions: &mut Vec<Action>) {
        if self.ending.is_none() {
            self.ending = Some(ending);
            actions.push(Action::Tell(Notice::Ends(ending)));
        }
    }
}
