//! The state machine of a camera: events and the time in, actions out.
//!
//! ```text
//!              opened                      stalled or broken: start the stream again
//!  Waiting ---------------> Streaming <------------------------+
//!     ^                         |                              |
//!     |   a while later         +------------------------------+
//!     +---- gone, refused, or started again too often
//! ```
//!
//! No state is final: a camera that has been pulled out, is in use elsewhere or refuses its format is opened again and again, and
//! reported once.

use messages::StreamCursor;

use crate::coding::Damage;
use crate::stream::About;
use crate::trouble::Trouble;

/// Time between two tries to open a camera, s.
const RETRY_S: f64 = 0.25;

/// Shortest silence that is a stall, s. Cameras take pictures more slowly in the dark, and need half a second for the first.
const STALL_S: f64 = 1.0;

/// Pictures that may be missing in a row before that is a stall.
const STALL_PICTURES: f64 = 10.0;

/// Times that a stream is started again without giving a picture before the camera is closed and opened instead.
const RESTARTS_IN_A_ROW: u32 = 2;

/// A picture that is older than this when it is taken from the device has a wrong time stamp, ns.
const OLDEST_NS: u64 = 1_000_000_000;

/// Numbers that a device's count may skip at once; beyond, it has started anew or gone back.
const MOST_LOST: u32 = 1 << 16;

/// Weight of a new interval in the measured rate.
const RATE_GAIN: f64 = 0.1;

/// What happens to a session.
#[derive(Debug, Clone, PartialEq)]
pub enum Input {
    /// The camera has been opened, or its stream started again.
    Opened,
    /// Opening it, starting its stream or taking a picture failed.
    Trouble(Trouble),
    /// A picture came, of this number by the device's count: it was published, or was none.
    Picture(u32, Result<StreamCursor, Damage>),
    /// Time has passed; wanted by [`Session::due_ns`] at the latest.
    Tick,
}

/// What a session wants done, in this order.
#[derive(Debug, Clone, PartialEq)]
pub enum Output {
    /// Open the camera.
    Open,
    /// Start its stream again.
    Restart,
    /// Close it.
    Close,
    /// Something to say.
    Event(Event),
}

/// An event for the log. Its words follow the name of the device.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Event {
    /// There are no pictures, for this reason; each is reported once in a silence.
    #[error("{0}; still trying")]
    Trouble(Trouble),
    /// The camera gives no pictures though nothing is known to be wrong.
    #[error("no picture for {silence_s:.1} s; starting the stream again")]
    Stalled {
        /// For how long, s.
        silence_s: f64,
    },
    /// There are pictures again.
    #[error("pictures again after {silence_s:.1} s")]
    Recovered {
        /// How long there were none, s.
        silence_s: f64,
    },
    /// A picture was damaged.
    #[error("damaged picture ({damaged} so far): {damage}")]
    Damaged {
        /// What is wrong with it.
        damage: Damage,
        /// Damaged pictures so far.
        damaged: u64,
    },
}

/// What has been counted since the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Pictures published.
    pub pictures: u64,
    /// Pictures that the device counted but did not give.
    pub lost: u64,
    /// Pictures that were damaged.
    pub damaged: u64,
    /// Times the stream was started again.
    pub restarts: u64,
    /// Times the camera was opened, after the first.
    pub reopenings: u64,
}

/// The time limits, in deployment time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    retry_ns: u64,
    stall_ns: u64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum State {
    /// No camera; to be opened at `due_ns`.
    Waiting { due_ns: u64 },
    /// Pictures come or should.
    Streaming(Streaming),
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Streaming {
    /// When the last picture came, or the stream was started.
    last_ns: u64,
    /// Times the stream was started again since the last picture.
    restarts: u32,
    /// The device's number of the last picture.
    sequence: Option<u32>,
    /// Mean time between two pictures, ns; 0 before the second.
    interval_ns: f64,
}

/// There are no pictures.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Silent {
    since_ns: u64,
    /// Why, if that is known.
    why: Option<Trouble>,
    /// The reasons that have been reported.
    reported: Vec<Trouble>,
}

/// What is known of a camera, over any number of openings.
#[derive(Debug, Clone)]
pub struct Session {
    limits: Limits,
    state: State,
    last: StreamCursor,
    counters: Counters,
    openings: u64,
    silent: Option<Silent>,
    speed: f64,
}

impl Limits {
    /// The limits for a camera of this rate in a deployment that runs `speed` times faster than the wall clock: a camera does not.
    #[must_use]
    pub fn new(rate_hz: f64, speed: f64) -> Self {
        let ns = |seconds: f64| (seconds * speed * 1e9) as u64;
        Self { retry_ns: ns(RETRY_S), stall_ns: ns(STALL_S.max(STALL_PICTURES / rate_hz)) }
    }
}

impl Session {
    /// A session with a camera that is still to be opened; `last` is the last picture that an earlier process of the run published.
    #[must_use]
    pub fn new(limits: Limits, speed: f64, last: StreamCursor) -> Self {
        let state = State::Waiting { due_ns: 0 };
        Self { limits, state, last, counters: Counters::default(), openings: 0, silent: None, speed }
    }

    /// When [`Input::Tick`] is wanted.
    #[must_use]
    pub fn due_ns(&self) -> u64 {
        match self.state {
            State::Waiting { due_ns } => due_ns,
            State::Streaming(streaming) => streaming.last_ns.saturating_add(self.limits.stall_ns),
        }
    }

    /// What has been counted.
    #[must_use]
    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// The last picture that was published; its number is 0 before the first.
    #[must_use]
    pub fn last(&self) -> StreamCursor {
        self.last
    }

    /// In words, for the status: what the camera does or why it does not.
    #[must_use]
    pub fn note(&self, device: &str, given: &str, now_ns: u64) -> String {
        match (&self.silent, self.state) {
            (Some(Silent { why: Some(trouble), .. }), _) => format!("{device}: {trouble}"),
            (Some(Silent { since_ns, why: None, .. }), _) => {
                format!("{device}: no picture for {:.0} s", seconds(now_ns.saturating_sub(*since_ns)))
            }
            (None, State::Waiting { .. }) => format!("{device}: waiting"),
            (None, State::Streaming(streaming)) if streaming.interval_ns > 0.0 => {
                format!("{given}, {:.1} pictures a second", 1e9 / streaming.interval_ns * self.speed)
            }
            (None, State::Streaming(_)) => format!("{given}, waiting for its first pictures"),
        }
    }

    /// Where a picture belongs that came at `now_ns`. Its own time is by the monotonic clock, which says `clock_ns` now.
    #[must_use]
    pub fn next_position(&self, about: &About, now_ns: u64, clock_ns: u64) -> StreamCursor {
        let age_ns = about.taken_ns.and_then(|taken_ns| clock_ns.checked_sub(taken_ns)).filter(|age_ns| *age_ns <= OLDEST_NS);
        let taken_ns = now_ns.saturating_sub((age_ns.unwrap_or(0) as f64 * self.speed) as u64);
        StreamCursor { seq: self.last.seq + 1, stamp_ns: taken_ns.max(self.last.stamp_ns + 1) }
    }

    /// Takes what happened at `now_ns` and returns what to do about it.
    #[must_use]
    pub fn step(&mut self, input: Input, now_ns: u64) -> Vec<Output> {
        let mut out = Vec::new();
        match input {
            Input::Opened => self.opened(now_ns),
            Input::Trouble(trouble) => self.trouble(trouble, now_ns, &mut out),
            Input::Picture(sequence, result) => {
                self.received(sequence, now_ns);
                match result {
                    Ok(position) => self.published(position, now_ns, &mut out),
                    Err(damage) => self.damaged(damage, &mut out),
                }
            }
            Input::Tick => self.tick(now_ns, &mut out),
        }
        out
    }

    fn opened(&mut self, now_ns: u64) {
        let restarts = match self.state {
            State::Waiting { .. } => {
                self.openings += 1;
                self.counters.reopenings = self.openings - 1;
                0
            }
            State::Streaming(streaming) => streaming.restarts,
        };
        self.state = State::Streaming(Streaming { last_ns: now_ns, restarts, sequence: None, interval_ns: 0.0 });
    }

    fn trouble(&mut self, trouble: Trouble, now_ns: u64, out: &mut Vec<Output>) {
        let since_ns = match (&self.silent, self.state) {
            (Some(silent), _) => silent.since_ns,
            (None, State::Streaming(streaming)) => streaming.last_ns,
            (None, State::Waiting { .. }) => now_ns,
        };
        let mut reported = self.silent.take().map_or_else(Vec::new, |silent| silent.reported);
        if !reported.contains(&trouble) {
            out.push(Output::Event(Event::Trouble(trouble.clone())));
            reported.push(trouble.clone());
        }
        let broken = matches!(trouble, Trouble::Broken { .. });
        self.silent = Some(Silent { since_ns, why: Some(trouble), reported });
        match self.state {
            State::Streaming(streaming) if broken => self.restart(streaming, now_ns, out),
            State::Streaming(_) => self.close(now_ns, out),
            State::Waiting { .. } => self.state = State::Waiting { due_ns: now_ns + self.limits.retry_ns },
        }
    }

    fn tick(&mut self, now_ns: u64, out: &mut Vec<Output>) {
        match self.state {
            State::Waiting { due_ns } if now_ns >= due_ns => out.push(Output::Open),
            State::Streaming(streaming) if now_ns >= self.due_ns() => {
                let silence_s = seconds(now_ns.saturating_sub(streaming.last_ns));
                let (since_ns, reported) = match self.silent.take() {
                    Some(silent) => (silent.since_ns, silent.reported),
                    None => {
                        out.push(Output::Event(Event::Stalled { silence_s }));
                        (streaming.last_ns, Vec::new())
                    }
                };
                // Whatever was wrong before is over: the stream runs, but gives nothing.
                self.silent = Some(Silent { since_ns, why: None, reported });
                self.restart(streaming, now_ns, out);
            }
            _ => {}
        }
    }

    fn restart(&mut self, streaming: Streaming, now_ns: u64, out: &mut Vec<Output>) {
        if streaming.restarts >= RESTARTS_IN_A_ROW {
            self.close(now_ns, out);
            return;
        }
        self.counters.restarts += 1;
        self.state = State::Streaming(Streaming { last_ns: now_ns, restarts: streaming.restarts + 1, ..streaming });
        out.push(Output::Restart);
    }

    fn close(&mut self, now_ns: u64, out: &mut Vec<Output>) {
        out.push(Output::Close);
        self.state = State::Waiting { due_ns: now_ns + self.limits.retry_ns };
    }

    fn received(&mut self, sequence: u32, now_ns: u64) {
        let State::Streaming(streaming) = &mut self.state else { return };
        let ahead = streaming.sequence.map_or(1, |last| sequence.wrapping_sub(last));
        if (1..=MOST_LOST).contains(&ahead) {
            self.counters.lost += u64::from(ahead - 1);
        }
        streaming.sequence = Some(sequence);
        streaming.last_ns = now_ns;
    }

    fn published(&mut self, position: StreamCursor, now_ns: u64, out: &mut Vec<Output>) {
        let silent = self.silent.take();
        if let Some(silent) = &silent {
            out.push(Output::Event(Event::Recovered { silence_s: seconds(now_ns.saturating_sub(silent.since_ns)) }));
        }
        if let State::Streaming(streaming) = &mut self.state {
            let interval_ns = position.stamp_ns.saturating_sub(self.last.stamp_ns) as f64;
            streaming.interval_ns = match streaming.interval_ns {
                // A silence before is none of the rhythm.
                _ if silent.is_some() || self.counters.pictures == 0 => 0.0,
                0.0 => interval_ns,
                mean_ns => mean_ns + RATE_GAIN * (interval_ns - mean_ns),
            };
            streaming.restarts = 0;
        }
        self.last = position;
        self.counters.pictures += 1;
    }

    fn damaged(&mut self, damage: Damage, out: &mut Vec<Output>) {
        self.counters.damaged += 1;
        out.push(Output::Event(Event::Damaged { damage, damaged: self.counters.damaged }));
    }
}

fn seconds(ns: u64) -> f64 {
    ns as f64 / 1e9
}
