//! What is done next about a camera.

use messages::StreamCursor;
use stillmap_camera::{About, Counters, Damage, Event, Input, Limits, Output, Session, Trouble};

const MS: u64 = 1_000_000;
/// At 10 Hz.
const STALL: u64 = 1000 * MS;
const RETRY: u64 = 250 * MS;

/// A session at the time of its own clock.
struct Bench {
    session: Session,
    now_ns: u64,
}

fn absent() -> Output {
    said(Trouble::Absent)
}

fn said(trouble: Trouble) -> Output {
    Output::Event(Event::Trouble(trouble))
}

fn broken() -> Trouble {
    Trouble::of("VIDIOC_DQBUF", rustix::io::Errno::IO)
}

impl Bench {
    fn new() -> Self {
        let last = StreamCursor::default();
        Self { session: Session::new(Limits::new(10.0, 1.0), 1.0, last), now_ns: 5000 * MS }
    }

    fn streaming() -> Self {
        let mut bench = Self::new();
        assert_eq!(bench.after(0, Input::Tick), [Output::Open]);
        assert_eq!(bench.after(0, Input::Opened), []);
        bench
    }

    fn after(&mut self, ns: u64, input: Input) -> Vec<Output> {
        self.now_ns += ns;
        self.session.step(input, self.now_ns)
    }

    /// A picture of this number comes 100 ms later and is published.
    fn publishes(&mut self, sequence: u32) -> Vec<Output> {
        let about = About { sequence, damaged: false, taken_ns: None };
        let position = self.session.next_position(&about, self.now_ns + 100 * MS, 0);
        self.after(100 * MS, Input::Picture(sequence, Ok(position)))
    }

    fn counters(&self) -> Counters {
        self.session.counters()
    }
}

#[test]
fn pictures_are_numbered_and_stamped() {
    let mut bench = Bench::streaming();
    for sequence in 0..5 {
        assert_eq!(bench.publishes(sequence), []);
    }
    assert_eq!(bench.session.last(), StreamCursor { seq: 5, stamp_ns: 5500 * MS });
    assert_eq!(bench.counters(), Counters { pictures: 5, ..Counters::default() });
    assert_eq!(bench.session.note("/dev/video0", "Cam: 160 × 120", bench.now_ns), "Cam: 160 × 120, 10.0 pictures a second");
}

#[test]
fn the_stamp_is_when_the_picture_was_taken() {
    let mut bench = Bench::streaming();
    let mut stamp_of = |taken_ns: u64, clock_ns: u64| {
        let about = About { sequence: 0, damaged: false, taken_ns: Some(taken_ns) };
        let position = bench.session.next_position(&about, bench.now_ns + 100 * MS, clock_ns);
        bench.after(100 * MS, Input::Picture(0, Ok(position)));
        (bench.now_ns, position.stamp_ns)
    };
    let (now_ns, stamp_ns) = stamp_of(700 * MS, 730 * MS);
    assert_eq!(stamp_ns, now_ns - 30 * MS);
    let (now_ns, stamp_ns) = stamp_of(800 * MS, 785 * MS);
    assert_eq!(stamp_ns, now_ns, "in the future: the arrival counts");
    let (now_ns, stamp_ns) = stamp_of(0, 5000 * MS);
    assert_eq!(stamp_ns, now_ns, "of another clock: the arrival counts");
    let (now_ns, stamp_ns) = stamp_of(100 * MS, 250 * MS);
    assert_eq!(stamp_ns, now_ns - 100 * MS + 1, "stamps grow");
}

#[test]
fn what_the_device_skips_is_counted() {
    let mut bench = Bench::streaming();
    for sequence in [7, 8, 11, 11, u32::MAX - 1, u32::MAX, 0, 2, 3] {
        bench.publishes(sequence);
    }
    // 9 and 10, and 1: a repeated number and a jump of the whole count are no loss.
    assert_eq!(bench.counters().lost, 3);
    assert_eq!(bench.counters().pictures, 9);
    // A stream that starts again counts anew.
    bench.after(STALL, Input::Tick);
    bench.after(0, Input::Opened);
    bench.publishes(40);
    assert_eq!(bench.counters().lost, 3);
}

#[test]
fn damaged_pictures_are_counted_and_not_published() {
    let mut bench = Bench::streaming();
    bench.publishes(0);
    for (damage, damaged) in [(Damage::Marked, 1), (Damage::Short { found: 3, expected: 10 }, 2), (Damage::Marked, 3)] {
        let said = Output::Event(Event::Damaged { damage: damage.clone(), damaged });
        assert_eq!(bench.after(100 * MS, Input::Picture(damaged as u32, Err(damage))), [said]);
    }
    assert_eq!(bench.publishes(4), []);
    assert_eq!(bench.session.last().seq, 2, "numbers are those of published pictures");
    assert_eq!(bench.counters(), Counters { pictures: 2, damaged: 3, ..Counters::default() });
}

#[test]
fn a_camera_that_is_not_there_is_waited_for_and_said_once() {
    let mut bench = Bench::new();
    assert_eq!(bench.after(0, Input::Tick), [Output::Open]);
    assert_eq!(bench.after(0, Input::Trouble(Trouble::Absent)), [absent()]);
    for _ in 0..3 {
        assert_eq!(bench.session.due_ns(), bench.now_ns + RETRY);
        assert_eq!(bench.after(RETRY - 1, Input::Tick), []);
        assert_eq!(bench.after(1, Input::Tick), [Output::Open]);
        assert_eq!(bench.after(0, Input::Trouble(Trouble::Absent)), []);
    }
    assert_eq!(bench.after(0, Input::Trouble(Trouble::Busy)), [said(Trouble::Busy)]);
    assert_eq!(bench.session.note("/dev/video0", "", bench.now_ns), "/dev/video0: in use by another program");
    bench.after(0, Input::Opened);
    assert_eq!(bench.publishes(0), [Output::Event(Event::Recovered { silence_s: 0.85 })]);
    assert_eq!(bench.counters().reopenings, 0);
}

#[test]
fn a_camera_pulled_out_and_put_back_costs_what_lies_between() {
    let mut bench = Bench::streaming();
    bench.publishes(0);
    bench.publishes(1);
    assert_eq!(bench.after(50 * MS, Input::Trouble(Trouble::Absent)), [absent(), Output::Close]);
    assert_eq!(bench.after(RETRY, Input::Tick), [Output::Open]);
    bench.after(0, Input::Trouble(Trouble::Absent));
    assert_eq!(bench.after(RETRY, Input::Tick), [Output::Open]);
    bench.after(0, Input::Opened);
    assert_eq!(bench.publishes(0), [Output::Event(Event::Recovered { silence_s: 0.65 })]);
    assert_eq!(bench.session.last(), StreamCursor { seq: 3, stamp_ns: bench.now_ns });
    assert_eq!(bench.counters(), Counters { pictures: 3, reopenings: 1, ..Counters::default() });
}

#[test]
fn a_stalled_stream_is_restarted_then_the_camera_is_reopened() {
    let mut bench = Bench::streaming();
    bench.publishes(0);
    assert_eq!(bench.session.due_ns(), bench.now_ns + STALL);
    assert_eq!(bench.after(STALL - 1, Input::Tick), []);
    assert_eq!(bench.after(1, Input::Tick), [Output::Event(Event::Stalled { silence_s: 1.0 }), Output::Restart]);
    bench.after(0, Input::Opened);
    assert_eq!(bench.after(STALL, Input::Tick), [Output::Restart], "said once");
    bench.after(0, Input::Opened);
    assert_eq!(bench.session.note("/dev/video0", "", bench.now_ns), "/dev/video0: no picture for 2 s");
    assert_eq!(bench.after(STALL, Input::Tick), [Output::Close]);
    assert_eq!(bench.after(RETRY, Input::Tick), [Output::Open]);
    bench.after(0, Input::Opened);
    assert_eq!(bench.publishes(0), [Output::Event(Event::Recovered { silence_s: 3.35 })]);
    assert_eq!(bench.counters(), Counters { pictures: 2, restarts: 2, reopenings: 1, ..Counters::default() });
}

#[test]
fn a_broken_stream_is_started_again() {
    let mut bench = Bench::streaming();
    bench.publishes(0);
    assert_eq!(bench.after(0, Input::Trouble(broken())), [said(broken()), Output::Restart]);
    bench.after(0, Input::Opened);
    assert_eq!(bench.publishes(0).len(), 1, "recovered");
    assert_eq!(bench.counters(), Counters { pictures: 2, restarts: 1, ..Counters::default() });
}

#[test]
fn a_stream_that_always_breaks_causes_no_busy_loop() {
    let mut bench = Bench::streaming();
    bench.publishes(0);
    assert_eq!(bench.after(0, Input::Trouble(broken())), [said(broken()), Output::Restart]);
    bench.after(0, Input::Opened);
    assert_eq!(bench.after(0, Input::Trouble(broken())), [Output::Restart]);
    bench.after(0, Input::Opened);
    assert_eq!(bench.after(0, Input::Trouble(broken())), [Output::Close]);
    assert_eq!(bench.after(0, Input::Tick), []);
    assert_eq!(bench.session.due_ns(), bench.now_ns + RETRY);
}

#[test]
fn an_error_at_the_start_of_the_stream_closes_the_camera() {
    let mut bench = Bench::streaming();
    bench.publishes(0);
    bench.after(STALL, Input::Tick);
    let refused = Trouble::of("VIDIOC_STREAMON", rustix::io::Errno::INVAL);
    assert_eq!(bench.after(0, Input::Trouble(refused.clone())), [said(refused), Output::Close]);
    assert_eq!(bench.after(RETRY, Input::Tick), [Output::Open]);
}

#[test]
fn numbers_continue_after_those_of_an_earlier_process() {
    let last = StreamCursor { seq: 41, stamp_ns: 9000 * MS };
    let session = Session::new(Limits::new(10.0, 1.0), 1.0, last);
    let about = About { sequence: 0, damaged: false, taken_ns: None };
    assert_eq!(session.next_position(&about, 8000 * MS, 0), StreamCursor { seq: 42, stamp_ns: 9000 * MS + 1 });
}

#[test]
fn limits_follow_the_rate_and_the_deployment_s_speed() {
    let due_of = |rate_hz: f64, speed: f64| {
        let mut session = Session::new(Limits::new(rate_hz, speed), speed, StreamCursor::default());
        let _ = session.step(Input::Opened, 0);
        session.due_ns()
    };
    assert_eq!(due_of(30.0, 1.0), 1000 * MS);
    assert_eq!(due_of(5.0, 1.0), 2000 * MS);
    assert_eq!(due_of(30.0, 4.0), 4000 * MS);
}

#[test]
fn troubles_that_alternate_are_reported_once_each() {
    let mut bench = Bench::streaming();
    bench.publishes(0);
    assert_eq!(bench.after(0, Input::Trouble(Trouble::Absent)), [absent(), Output::Close]);
    for round in 0..4 {
        let expected = if round == 0 { vec![said(Trouble::Busy)] } else { Vec::new() };
        assert_eq!(bench.after(0, Input::Trouble(Trouble::Busy)), expected);
        assert_eq!(bench.after(RETRY, Input::Tick), [Output::Open]);
        bench.after(0, Input::Opened);
        assert_eq!(bench.after(STALL, Input::Tick), [Output::Restart], "it is silent already");
        bench.after(0, Input::Opened);
        assert_eq!(bench.after(0, Input::Trouble(Trouble::Absent)), [Output::Close]);
    }
}
