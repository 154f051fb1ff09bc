//! The supervisor's state machine against scripted and random processes.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use proptest::prelude::*;
use std::collections::VecDeque;
use std::time::Duration;
use stillmap_supervisor::{Action, Deployment, Ending, Event, Exit, Notice, Plan, Policy, Role, Standstill, State};

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

fn policy() -> Policy {
    Policy {
        startup_deadline: ms(5000),
        heartbeat_timeout: ms(2000),
        restarts: 3,
        within: ms(30_000),
        backoff_first: ms(20),
        backoff_last: ms(5000),
        stop_deadline: ms(3000),
    }
}

fn plan(name: &str, role: Role) -> Plan {
    Plan { name: name.to_owned(), role, ends_run: false, essential: role == Role::Source }
}

/// Two consumers, a driver, and a simulator that ends the run.
fn demo() -> Deployment {
    let simulator = Plan { ends_run: true, ..plan("simulator", Role::Source) };
    let plans = vec![plan("recorder", Role::Consumer), plan("mapping", Role::Consumer), plan("pioneer", Role::Source), simulator];
    Deployment::new(policy(), plans, 7)
}

fn commands(actions: &[Action]) -> Vec<Action> {
    actions.iter().filter(|a| !matches!(a, Action::Tell(_))).cloned().collect()
}

fn notices(actions: &[Action]) -> Vec<Notice> {
    actions.iter().filter_map(|a| if let Action::Tell(n) = a { Some(n.clone()) } else { None }).collect()
}

fn heartbeat(process: usize, work: u64) -> Event {
    Event::Heartbeat { process, work, ending: false }
}

fn exited(process: usize, exit: Exit) -> Event {
    Event::Exited { process, exit }
}

/// All four at work at time 10 ms.
fn running_demo() -> Deployment {
    let mut it = demo();
    it.step(Event::Tick, ms(0));
    for process in 0..4 {
        it.step(heartbeat(process, 0), ms(10));
    }
    assert!(it.processes().iter().all(|p| matches!(p.state(), State::Running { .. })));
    it
}

#[test]
fn each_process_starts_when_the_one_before_lives() {
    let mut it = demo();
    assert_eq!(commands(&it.step(Event::Tick, ms(0))), [Action::Spawn { process: 0, incarnation: 0 }]);
    assert_eq!(commands(&it.step(Event::Tick, ms(50))), []);
    assert_eq!(commands(&it.step(heartbeat(0, 0), ms(60))), [Action::Spawn { process: 1, incarnation: 0 }]);
    let after_death = it.step(exited(1, Exit::Code(1)), ms(70));
    assert_eq!(commands(&after_death), [Action::Spawn { process: 2, incarnation: 0 }], "one that cannot start does not hold up the next");
}

#[test]
fn a_dead_process_is_back_after_its_delay() {
    let mut it = running_demo();
    let actions = it.step(exited(1, Exit::Signal(9)), ms(100));
    let [Notice::Restarting { process: 1, after, .. }] = notices(&actions)[..] else { panic!("{actions:?}") };
    assert!(after >= ms(15) && after <= ms(25), "{after:?}");
    assert_eq!(commands(&it.step(Event::Tick, ms(100) + after - Duration::from_nanos(1))), []);
    assert_eq!(commands(&it.step(Event::Tick, ms(100) + after)), [Action::Spawn { process: 1, incarnation: 1 }]);
}

#[test]
fn a_process_that_another_program_stops_starts_again() {
    let mut it = running_demo();
    for (process, signal, word) in [(0, 1, "SIGHUP"), (1, 15, "SIGTERM"), (2, 2, "SIGINT")] {
        let actions = it.step(exited(process, Exit::Signal(signal)), ms(100));
        let [Notice::Restarting { process: of, cause, .. }] = &notices(&actions)[..] else { panic!("{actions:?}") };
        assert_eq!((*of, cause.as_str()), (process, format!("was told to stop ({word}), not by the supervisor").as_str()));
    }
    it.step(exited(3, Exit::Finished), ms(110));
    assert_eq!(it.ending(), Some(Ending::Complete));
}

#[test]
fn a_requested_restart_kills_and_spends_no_budget() {
    let mut it = running_demo();
    for restart in 1..=5 {
        let actions = it.step(Event::RestartAsked { process: 1 }, ms(100));
        assert_eq!((commands(&actions), notices(&actions)), (vec![Action::Kill(1)], vec![Notice::RestartRequested { process: 1 }]));
        assert_eq!(it.step(Event::RestartAsked { process: 1 }, ms(100)), [], "it restarts already");
        assert_eq!(it.step(exited(1, Exit::Signal(9)), ms(100)), [Action::Spawn { process: 1, incarnation: restart }]);
        it.step(heartbeat(1, 0), ms(100));
    }
    assert_eq!(it.ending(), None);
}

#[test]
fn a_failed_process_is_restarted_on_request() {
    let mut it = running_demo();
    for round in [0, 1] {
        for _ in 0..=policy().restarts {
            it.step(exited(1, Exit::Code(1)), ms(200));
            it.step(Event::Tick, ms(10_000));
        }
        assert_eq!(it.processes()[1].state(), &State::Failed, "round {round}");
        let actions = it.step(Event::RestartAsked { process: 1 }, ms(10_000));
        assert!(matches!(commands(&actions)[..], [Action::Spawn { process: 1, .. }]), "{actions:?}");
        it.step(exited(1, Exit::Code(1)), ms(10_000));
        assert!(matches!(it.processes()[1].state(), State::Backoff { .. }), "it has its whole budget again");
        it.step(Event::Tick, ms(20_000));
    }
}

#[test]
fn what_ends_or_has_finished_is_not_restarted() {
    let mut it = running_demo();
    it.step(exited(0, Exit::Finished), ms(100));
    assert_eq!(it.step(Event::RestartAsked { process: 0 }, ms(100)), []);
    it.step(Event::StopAsked, ms(100));
    assert_eq!(it.step(Event::RestartAsked { process: 1 }, ms(100)), []);
    assert_eq!(it.step(Event::RestartAsked { process: 99 }, ms(100)), []);
}

#[test]
fn a_hung_process_is_killed_and_restarted() {
    let mut it = running_demo();
    for at in [1000, 2005] {
        for process in [0, 2, 3] {
            it.step(heartbeat(process, 0), ms(at));
        }
    }
    assert_eq!(it.due(), Some(ms(2010)));
    let actions = it.step(Event::Tick, ms(2010));
    assert_eq!(commands(&actions), [Action::Kill(1)]);
    assert!(matches!(&notices(&actions)[..], [Notice::Hangs { process: 1, cause }] if cause == "gave no sign of life for 2.0 s"));
    let actions = it.step(exited(1, Exit::Signal(9)), ms(2012));
    assert!(matches!(&notices(&actions)[..], [Notice::Restarting { process: 1, cause, .. }] if cause == "gave no sign of life for 2.0 s"));
    assert_eq!(commands(&it.step(Event::Tick, ms(2100))), [Action::Spawn { process: 1, incarnation: 1 }]);
    // As long as it gives signs of life it is left alone: it has been started again once.
    for at in (2200..12_200).step_by(1999) {
        for process in 0..4 {
            assert_eq!(commands(&it.step(heartbeat(process, 0), ms(at))), [], "at {at} ms");
        }
    }
    assert_eq!(it.processes().iter().map(|it| it.restarted()).collect::<Vec<_>>(), [0, 1, 0, 0]);
}

#[test]
fn after_a_standstill_each_process_has_its_whole_time_again() {
    let mut it = running_demo();
    let actions = it.step(Event::StoodStill(Standstill::Stopped(ms(12_000))), ms(2000));
    assert_eq!(actions, [Action::Tell(Notice::StoodStill(Standstill::Stopped(ms(12_000))))]);
    assert_eq!(commands(&it.step(Event::Tick, ms(3999))), []);
    assert_eq!(commands(&it.step(Event::Tick, ms(4000))).len(), 4, "they are silent for as long as they may");
}

#[test]
fn a_source_stays_until_what_it_published_is_taken() {
    let mut it = running_demo();
    assert_eq!(commands(&it.step(exited(3, Exit::Finished), ms(100))), [Action::Terminate(2)]);
    let ending = Event::Heartbeat { process: 2, work: 0, ending: true };
    for at in (200..9000).step_by(200) {
        // Mapping has much to do still.
        let work = [it.step(ending.clone(), ms(at)), it.step(heartbeat(0, 0), ms(at)), it.step(heartbeat(1, at), ms(at))];
        assert_eq!(work.map(|actions| commands(&actions)), [[], [], []], "at {at} ms");
        assert_eq!(commands(&it.step(Event::Tick, ms(at))), [], "at {at} ms");
    }
    // Killed meanwhile, it comes again to say its end once more.
    it.step(exited(2, Exit::Signal(9)), ms(9000));
    assert_eq!(commands(&it.step(Event::Tick, ms(9100))), [Action::Spawn { process: 2, incarnation: 1 }]);
    assert_eq!(commands(&it.step(heartbeat(2, 0), ms(9200))), [Action::Terminate(2)]);
    assert_eq!(commands(&it.step(ending, ms(9300))), []);
    // When nothing moves any more, it is asked once more in its turn.
    let mut at = 9300;
    let mut asked = Vec::new();
    while !it.is_over() {
        at += 200;
        for process in 0..3 {
            if it.processes()[process].is_live() {
                it.step(Event::Heartbeat { process, work: 9000, ending: process == 2 }, ms(at));
            }
        }
        let mut actions = VecDeque::from(commands(&it.step(Event::Tick, ms(at))));
        while let Some(action) = actions.pop_front() {
            let Action::Terminate(process) = action else { panic!("{action:?} at {at} ms") };
            asked.push(process);
            actions.extend(commands(&it.step(exited(process, Exit::Finished), ms(at))));
        }
        assert!(at < 60_000, "{it:?}");
    }
    assert_eq!(asked, [2, 1, 0], "the last started first");
    assert_eq!(it.ending(), Some(Ending::Complete));
}

#[test]
fn a_source_does_not_stay_when_all_are_asked_to_stop() {
    let ending = Event::Heartbeat { process: 3, work: 0, ending: true };
    let mut it = running_demo();
    // Mapping refuses its settings: there is no drain.
    assert_eq!(commands(&it.step(exited(1, Exit::BadInput), ms(100))), [Action::Terminate(3)]);
    assert_eq!(commands(&it.step(heartbeat(3, 0), ms(200))), []);
    assert_eq!(commands(&it.step(ending.clone(), ms(300))), [Action::Terminate(3)]);
    // Two requests before it has published its end.
    let mut it = running_demo();
    assert_eq!(commands(&it.step(Event::StopAsked, ms(100))), [Action::Terminate(3), Action::Terminate(2)]);
    assert_eq!(commands(&it.step(Event::StopAsked, ms(200))), []);
    assert_eq!(commands(&it.step(ending, ms(300))), [Action::Terminate(3)]);
}

#[test]
fn after_a_standstill_no_process_with_a_heartbeat_hangs() {
    let mut it = running_demo();
    for process in 0..4 {
        assert_eq!(commands(&it.step(heartbeat(process, 0), ms(60_000))), [], "what waited is taken one by one");
    }
    assert_eq!(commands(&it.step(Event::Tick, ms(60_000))), []);
    // Nor does one that is asked to stop, when its exit waits to be seen.
    assert_eq!(commands(&it.step(exited(3, Exit::Finished), ms(60_100))), [Action::Terminate(2)]);
    assert_eq!(commands(&it.step(heartbeat(0, 0), ms(120_000))), []);
    assert_eq!(commands(&it.step(exited(2, Exit::Finished), ms(120_000))), []);
    assert_eq!(it.processes()[2].state(), &State::Finished);
    assert_eq!(commands(&it.step(heartbeat(1, 1), ms(120_000))), [], "nor does the drain end before all is taken");
    assert_eq!(commands(&it.step(Event::Tick, ms(120_000))), []);
    assert_eq!(it.processes()[1].state(), &State::Running { last_heartbeat: ms(120_000) });
}

#[test]
fn a_process_that_never_lives_is_killed_at_its_startup_deadline() {
    let mut it = demo();
    it.step(Event::Tick, ms(0));
    assert_eq!(commands(&it.step(Event::Tick, ms(4999))), []);
    let next = Action::Spawn { process: 1, incarnation: 0 };
    assert_eq!(commands(&it.step(Event::Tick, ms(5000))), [Action::Kill(0), next], "the next is not held up any longer");
}

/// Lets a process die until it stays down; the number of its starts after the first.
fn exhaust(it: &mut Deployment, process: usize, mut now: Duration) -> (usize, Duration) {
    let mut restarts = 0;
    loop {
        let actions = it.step(exited(process, Exit::Signal(11)), now);
        if notices(&actions).iter().any(|n| matches!(n, Notice::Failed { process: p, .. } if *p == process)) {
            return (restarts, now);
        }
        now += ms(1000);
        let actions = it.step(Event::Tick, now);
        restarts += commands(&actions).len();
        for other in 0..it.processes().len() {
            it.step(heartbeat(other, 1), now);
        }
    }
}

#[test]
fn a_process_that_dies_too_often_fails_alone() {
    let mut it = running_demo();
    let (restarts, _) = exhaust(&mut it, 1, ms(100));
    assert_eq!(restarts, 3);
    assert_eq!(it.processes()[1].state(), &State::Failed);
    assert_eq!(it.ending(), None);
}

#[test]
fn an_essential_process_that_fails_ends_the_run() {
    let mut it = running_demo();
    let (_, now) = exhaust(&mut it, 2, ms(100));
    assert_eq!(it.ending(), Some(Ending::Lost { process: 2 }));
    assert!(matches!(it.processes()[3].state(), State::Stopping { .. }), "the other source is asked to stop at {now:?}");
}

#[test]
fn a_run_that_ends_lets_consumers_end_by_themselves() {
    let mut it = running_demo();
    let actions = it.step(exited(3, Exit::Finished), ms(100));
    assert_eq!(notices(&actions), [Notice::Finished { process: 3 }, Notice::Ends(Ending::Complete)]);
    assert_eq!(commands(&actions), [Action::Terminate(2)], "the other source is asked to stop");
    assert_eq!(commands(&it.step(exited(2, Exit::Finished), ms(110))), []);
    assert_eq!(commands(&it.step(exited(1, Exit::Finished), ms(120))), []);
    assert!(!it.is_over());
    it.step(exited(0, Exit::Finished), ms(130));
    assert!(it.is_over());
}

#[test]
fn a_consumer_that_dies_while_the_run_ends_comes_back() {
    let mut it = running_demo();
    it.step(exited(3, Exit::Finished), ms(100));
    it.step(exited(2, Exit::Finished), ms(110));
    it.step(exited(1, Exit::Signal(9)), ms(120));
    assert_eq!(commands(&it.step(Event::Tick, ms(150))), [Action::Spawn { process: 1, incarnation: 1 }]);
}

#[test]
fn a_source_that_dies_in_a_drain_restarts_to_end_its_streams() {
    let (death, end) = (|| exited(2, Exit::Signal(9)), || exited(3, Exit::Finished));
    let when_asked = [(end(), 100), (death(), 105), (Event::Tick, 150)];
    let a_moment_before = [(death(), 95), (end(), 100), (Event::Tick, 150)];
    let while_it_comes_back = [(death(), 50), (Event::Tick, 99), (end(), 100)];
    for events in [when_asked, a_moment_before, while_it_comes_back] {
        let mut it = running_demo();
        let actions: Vec<Action> = events.into_iter().flat_map(|(event, at)| it.step(event, ms(at))).collect();
        let others = commands(&actions).into_iter().filter(|action| *action != Action::Terminate(2));
        assert!(others.eq([Action::Spawn { process: 2, incarnation: 1 }]), "{actions:?}");
        assert_eq!(commands(&it.step(heartbeat(2, 0), ms(160))), [Action::Terminate(2)], "as soon as it can be asked");
        for process in [2, 1, 0] {
            it.step(exited(process, Exit::Finished), ms(170));
        }
        assert!(it.is_over() && it.processes().iter().all(|it| it.state() == &State::Finished), "{it:?}");
    }
}

#[test]
fn a_source_that_says_no_end_by_itself_has_failed() {
    let mut it = running_demo();
    it.step(exited(3, Exit::Finished), ms(100));
    it.step(exited(2, Exit::Code(1)), ms(110));
    assert_eq!(it.processes()[2].state(), &State::Failed);
}

#[test]
fn a_drain_waits_for_working_consumers_and_stops_idle_ones() {
    let mut it = running_demo();
    it.step(exited(3, Exit::Finished), ms(100));
    it.step(exited(2, Exit::Finished), ms(100));
    for i in 1..=10 {
        let actions = [it.step(heartbeat(0, 0), ms(100 + i * 1000)), it.step(heartbeat(1, i), ms(100 + i * 1000))].concat();
        assert_eq!(commands(&actions), [], "mapping still takes messages");
    }
    for i in 11..=12 {
        it.step(heartbeat(0, 0), ms(100 + i * 1000));
        it.step(heartbeat(1, 10), ms(100 + i * 1000));
    }
    assert_eq!(commands(&it.step(Event::Tick, ms(13_099))), []);
    assert_eq!(commands(&it.step(Event::Tick, ms(13_100))), [Action::Terminate(1)]);
    assert_eq!(it.processes()[1].state(), &State::Stopping { deadline: ms(16_100), killed: false });
    assert_eq!(commands(&it.step(exited(1, Exit::Finished), ms(13_200))), [Action::Terminate(0)]);
    assert_eq!(commands(&it.step(Event::Tick, ms(16_200))), [Action::Kill(0)]);
    it.step(exited(0, Exit::Signal(9)), ms(16_210));
    assert!(it.is_over());
    assert_eq!(it.processes()[0].state(), &State::Failed);
}

#[test]
fn what_moves_without_end_is_stopped_and_that_is_said() {
    let mut it = running_demo();
    it.step(exited(3, Exit::Finished), ms(100));
    it.step(exited(2, Exit::Finished), ms(100));
    for i in 1..120 {
        it.step(heartbeat(0, 0), ms(100 + i * 1000));
        it.step(heartbeat(1, i), ms(100 + i * 1000));
        assert_eq!(it.step(Event::Tick, ms(100 + i * 1000)), [], "after {i} s");
    }
    let actions = it.step(Event::Tick, ms(120_100));
    assert_eq!(actions, [Action::Tell(Notice::Restless { after: ms(120_000) }), Action::Terminate(1)]);
}

#[test]
fn asking_again_hurries() {
    let mut it = running_demo();
    assert_eq!(commands(&it.step(Event::StopAsked, ms(100))), [Action::Terminate(3), Action::Terminate(2)]);
    assert_eq!(it.ending(), Some(Ending::Asked));
    assert_eq!(commands(&it.step(Event::StopAsked, ms(110))), []);
    let kills = [Action::Kill(0), Action::Kill(1), Action::Kill(2), Action::Kill(3)];
    assert_eq!(commands(&it.step(Event::StopAsked, ms(120))), kills);
    for process in 0..4 {
        it.step(exited(process, Exit::Signal(9)), ms(130));
    }
    assert!(it.is_over());
    assert_eq!(it.ending(), Some(Ending::Forced));
}

#[test]
fn bad_input_is_not_tried_again() {
    let mut it = running_demo();
    let actions = it.step(exited(3, Exit::BadInput), ms(100));
    assert_eq!(it.ending(), Some(Ending::BadInput { process: 3 }));
    assert_eq!(commands(&actions), [Action::Terminate(2)]);
}

#[test]
fn a_broken_domain_is_rebuilt_once_nothing_lives_in_it() {
    let mut it = running_demo();
    let actions = it.step(exited(1, Exit::BrokenDomain), ms(100));
    assert_eq!(commands(&actions), [Action::Kill(2), Action::Kill(3)], "the sources");
    it.step(exited(2, Exit::Signal(9)), ms(101));
    it.step(exited(3, Exit::Signal(9)), ms(102));
    it.step(heartbeat(0, 1), ms(2000));
    assert_eq!(commands(&it.step(Event::Tick, ms(3099))), [], "the recorder saves what it has received");
    assert_eq!(commands(&it.step(Event::Tick, ms(3100))), [Action::Kill(0)]);
    assert_eq!(commands(&it.step(exited(0, Exit::Signal(9)), ms(3101))), [Action::Rebuild]);
    assert_eq!(commands(&it.step(Event::Tick, ms(3102))), []);
    assert_eq!(commands(&it.step(Event::Rebuilt, ms(3103))), [Action::Spawn { process: 0, incarnation: 1 }]);
}

#[test]
fn a_domain_lost_in_a_drain_is_rebuilt_and_the_drain_resumes() {
    let mut it = running_demo();
    it.step(exited(3, Exit::Finished), ms(100));
    it.step(heartbeat(2, 0), ms(101));
    assert_eq!(commands(&it.step(Event::DomainLost, ms(102))), [Action::Kill(2)]);
    assert_eq!(commands(&it.step(Event::DomainLost, ms(103))), [], "it is being rebuilt");
    it.step(exited(2, Exit::Signal(9)), ms(104));
    for process in [0, 1] {
        it.step(heartbeat(process, 1), ms(1000));
    }
    assert_eq!(commands(&it.step(Event::Tick, ms(3102))), [Action::Kill(0), Action::Kill(1)]);
    it.step(exited(0, Exit::Signal(9)), ms(3103));
    assert_eq!(commands(&it.step(exited(1, Exit::Signal(9)), ms(3104))), [Action::Rebuild]);
    let starts = [0, 1, 2].map(|process| Action::Spawn { process, incarnation: 1 });
    assert_eq!(commands(&it.step(Event::Rebuilt, ms(3106))), starts);
    assert_eq!(commands(&it.step(heartbeat(2, 0), ms(3110))), [Action::Terminate(2)], "the source publishes its end again");
    for process in [2, 1, 0] {
        it.step(exited(process, Exit::Finished), ms(3120));
    }
    assert!(it.is_over());
    assert_eq!(it.ending(), Some(Ending::Complete));
}

#[test]
fn an_error_that_repeats_at_the_same_place_is_not_retried() {
    let error = |message: &str| Exit::Error { code: 1, message: message.to_owned() };
    let missing = || Exit::NotStarted("no such file".to_owned());
    for (process, exits, restarts) in [
        (1, vec![(7, error("pose")), (7, error("pose"))], 1),
        (1, vec![(7, error("pose")), (8, error("pose")), (8, error("port"))], 3),
        (1, vec![(7, error("pose")), (7, Exit::Signal(9)), (7, error("pose"))], 3),
        (1, vec![(7, Exit::Code(1)), (7, Exit::Code(1)), (7, Exit::Code(1))], 3),
        (2, vec![(0, error("no device")), (0, error("no device")), (0, error("no device"))], 3),
        (2, vec![(0, missing()), (0, missing())], 1),
    ] {
        let mut it = running_demo();
        let mut now = ms(100);
        for (work, exit) in exits.clone() {
            it.step(heartbeat(process, work), now);
            it.step(exited(process, exit), now);
            now += ms(1000);
            it.step(Event::Tick, now);
        }
        let found = &it.processes()[process];
        let cause = found.cause();
        assert_eq!(found.restarted(), restarts, "{exits:?}: {cause}");
        assert_eq!(found.state() == &State::Failed, restarts == 1, "{exits:?}: {cause}");
        assert_eq!(cause.contains("twice at the same place"), restarts == 1, "{exits:?}: {cause}");
    }
}

#[test]
fn the_exit_of_a_child_that_is_not_there_is_nothing() {
    let mut it = running_demo();
    it.step(exited(0, Exit::Finished), ms(100));
    assert_eq!(it.step(exited(0, Exit::Signal(9)), ms(110)), []);
    assert_eq!(it.step(exited(9, Exit::Signal(9)), ms(110)), []);
    assert_eq!(it.processes()[0].state(), &State::Finished);
}

/// How a simulated child behaves.
#[derive(Debug, Clone)]
enum Habit {
    Beats { for_ms: u64, then: Option<Exit>, works: bool },
    Silent { for_ms: u64, then: Option<Exit> },
}

#[derive(Debug, Clone)]
struct Child {
    habit: Habit,
    born: Duration,
    /// When it obeys SIGTERM, and with what; `None`: never.
    obeys: Option<(u64, Exit)>,
    /// It obeys the second SIGTERM; from the first on it says that it has said all.
    stays: bool,
    asked: bool,
    dies: Option<(Duration, Exit)>,
}

fn exit() -> impl Strategy<Value = Exit> {
    prop_oneof![
        4 => Just(Exit::Signal(9)),
        3 => Just(Exit::Code(1)),
        1 => Just(Exit::Error { code: 1, message: "no such place".to_owned() }),
        1 => Just(Exit::Finished),
        1 => Just(Exit::BrokenDomain),
        1 => Just(Exit::NotStarted("no such file".to_owned())),
        1 => Just(Exit::BadInput),
    ]
}

fn habit() -> impl Strategy<Value = Habit> {
    prop_oneof![
        3 => (0u64..20_000, prop::option::of(exit()), any::<bool>()).prop_map(|(for_ms, then, works)| Habit::Beats { for_ms, then, works }),
        1 => (0u64..20_000, prop::option::of(exit())).prop_map(|(for_ms, then)| Habit::Silent { for_ms, then }),
    ]
}

fn child() -> impl Strategy<Value = Child> {
    let exit = prop_oneof![Just(Exit::Finished), Just(Exit::Signal(15)), Just(Exit::Code(1))];
    (habit(), prop::option::of((0u64..5000, exit)), any::<bool>()).prop_map(|(habit, obeys, stays)| Child {
        habit,
        born: Duration::ZERO,
        obeys,
        stays,
        asked: false,
        dies: None,
    })
}

fn plans() -> impl Strategy<Value = Vec<Plan>> {
    prop::collection::vec((any::<bool>(), any::<bool>(), any::<bool>()), 1..5).prop_map(|flags| {
        flags
            .iter()
            .enumerate()
            .map(|(i, (source, ends_run, essential))| Plan {
                name: format!("p{i}"),
                role: if *source { Role::Source } else { Role::Consumer },
                ends_run: *ends_run,
                essential: *essential,
            })
            .collect()
    })
}

/// Runs a deployment of random processes; checks what must hold at every step.
struct World {
    it: Deployment,
    children: Vec<Option<Child>>,
    supply: VecDeque<Child>,
    rebuild_times: Vec<Duration>,
    backed_off: Vec<bool>,
    restart_times: Vec<Vec<Duration>>,
    silent_since: Vec<Duration>,
    now: Duration,
}

impl World {
    fn new(plans: Vec<Plan>, supply: Vec<Child>) -> Self {
        let n = plans.len();
        Self {
            it: Deployment::new(policy(), plans, 3),
            children: vec![None; n],
            supply: supply.into(),
            rebuild_times: vec![],
            backed_off: vec![false; n],
            restart_times: vec![vec![]; n],
            silent_since: vec![Duration::ZERO; n],
            now: Duration::ZERO,
        }
    }

    fn feed(&mut self, event: Event) {
        let mut events = VecDeque::from([event]);
        while let Some(event) = events.pop_front() {
            for action in self.it.step(event, self.now) {
                self.obey(action, &mut events);
            }
        }
    }

    fn obey(&mut self, action: Action, events: &mut VecDeque<Event>) {
        match action {
            Action::Spawn { process, .. } => {
                assert!(self.children[process].is_none(), "two children for one process");
                if std::mem::take(&mut self.backed_off[process]) {
                    self.restart_times[process].push(self.now);
                }
                let mut child = self.supply.pop_front().unwrap_or(Child {
                    habit: Habit::Beats { for_ms: 0, then: None, works: true },
                    born: self.now,
                    obeys: None,
                    stays: false,
                    asked: false,
                    dies: None,
                });
                child.born = self.now;
                let (Habit::Beats { for_ms, then, .. } | Habit::Silent { for_ms, then }) = child.habit.clone();
                child.dies = then.map(|exit| (self.now + ms(for_ms), exit));
                self.silent_since[process] = self.now;
                self.children[process] = Some(child);
            }
            Action::Terminate(process) => {
                let now = self.now;
                let child = self.children[process].as_mut().expect("only a child can be asked to stop");
                let stays = child.stays && !std::mem::replace(&mut child.asked, true);
                if let Some((after, exit)) = child.obeys.clone().filter(|_| !stays) {
                    child.dies = Some((now + ms(after), exit));
                }
            }
            Action::Kill(process) => {
                let child = self.children[process].as_mut().expect("only a child can be killed");
                child.dies = Some((self.now, Exit::Signal(9)));
            }
            Action::Rebuild => {
                assert!(self.children.iter().all(Option::is_none), "something lives in the domain that is wiped");
                self.rebuild_times.push(self.now);
                events.push_back(Event::Rebuilt);
            }
            Action::Tell(Notice::Restarting { process, .. }) => self.backed_off[process] = true,
            Action::Tell(_) => {}
        }
    }

    fn advance(&mut self) {
        self.now += ms(100);
        for process in 0..self.children.len() {
            let Some(child) = &self.children[process] else { continue };
            if let Some((_, exit)) = child.dies.clone().filter(|(at, _)| *at <= self.now) {
                self.children[process] = None;
                self.feed(Event::Exited { process, exit });
            } else if let Habit::Beats { works, .. } = child.habit {
                self.silent_since[process] = self.now;
                let work = if works { self.now.as_millis() as u64 } else { 0 };
                let ending = child.stays && child.asked;
                self.feed(Event::Heartbeat { process, work, ending });
            }
        }
        self.feed(Event::Tick);
        for process in 0..self.children.len() {
            let live = self.it.processes()[process].is_live();
            assert_eq!(live, self.children[process].is_some(), "the machine and the world disagree about process {process}");
            let silence = self.now - self.silent_since[process];
            assert!(!live || silence <= ms(11_000), "process {process} hangs for {silence:?} and lives");
        }
    }
}

fn assert_budget(times: &[Duration]) {
    for window in times.windows(4) {
        assert!(window[3] - window[0] >= ms(30_000), "four restarts within 30 s: {window:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn whatever_the_processes_do(plans in plans(), supply in prop::collection::vec(child(), 0..40), stop_after in 0usize..900) {
        let mut world = World::new(plans, supply);
        world.feed(Event::Tick);
        for _ in 0..stop_after {
            world.advance();
        }
        world.feed(Event::StopAsked);
        // Longest drain, then two deadlines for each process. All begin again with a rebuild, after which processes resume their work.
        let limit = 40 * 30 + 2 * 30 * world.children.len() + 100;
        let (mut steps, mut rebuilds) = (0, world.rebuild_times.len());
        while !world.it.is_over() {
            world.advance();
            steps += 1;
            if world.rebuild_times.len() > rebuilds {
                (steps, rebuilds) = (0, world.rebuild_times.len());
            }
            prop_assert!(steps <= limit, "does not end: {:?}", world.it);
        }
        prop_assert!(world.children.iter().all(Option::is_none), "a child outlives the run");
        prop_assert!(world.it.ending().is_some());
        for times in &world.restart_times {
            assert_budget(times);
        }
        assert_budget(&world.rebuild_times);
    }
}
