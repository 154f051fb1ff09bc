//! The conversation with a robot as a state machine: bytes and time in, commands and scans out.
//!
//! ```text
//!            echo of SYNC0, SYNC1, SYNC2: OPEN
//!  Syncing ------------------------------------> Open -- silence, restart --> Syncing
//!     |  ^                                        ^
//!     |  | 400 ms                                 | status packets of a session that was cut off a moment ago
//!     v  |                                        |
//!  Closing <-- status packets: left open ---------+
//!          <-- an echo is missing, or a round over all baud rates was silent: left synchronised
//! ```
//!
//! A robot that was synchronised but never opened takes SYNC0 for PULSE and answers nothing until it is closed.
//! To a robot that is open, SYNC0 and SYNC1 are PULSE and OPEN: a handshake tried on it does no harm, and what comes back tells
//! which of the two it was. Every wrong turn ends in a time limit and a new handshake.

use psos::{Deframer, Frame, Identity, LinkCounters, Model, Sip, System, number};

use crate::arrivals::{Arrivals, Rhythm};
use crate::checkpoint::Checkpoint;
use crate::command::Command;
use crate::event::Event;
use crate::exchange::{Input, Output};
use crate::odometry::Track;
use crate::parameters::Parameters;
use crate::scanner::{Refusals, Scanner};

/// Handshakes that may break off after an echo before another baud rate is tried: an echo shows that this one is right.
const TRIES_AFTER_ECHO: u32 = 3;

/// Time between two requests (OPEN, sonars on) that the robot has not followed: it acknowledges nothing, so either may be lost.
const REPEAT_NS: u64 = 1_000_000_000;

/// Seven sonars take 0.28 s, sixteen 0.64 s: without a reading for this long they do not fire.
const SONARS_SILENT_NS: u64 = 2_000_000_000;

/// A silence of more than three cycles: packets were lost.
const GAP_NS: u64 = 350_000_000;

/// How long after an adapter was pulled out the robot's counters still tell where it went: over this time they unwind a robot that
/// drove on as well as one that stopped at once (`odometry`).
const RESUMABLE_NS: u64 = 4_000_000_000;

/// More damaged packets in a row than noise makes: the limits are too low for this robot.
const MANY_REFUSED: u32 = 10;

/// Where the conversation is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// No port.
    Absent,
    /// SYNC `step` is sent, its echo is due.
    Syncing { step: u8, due_ns: u64 },
    /// CLOSE is sent to a robot that is, or may have been, left in a session.
    Closing {
        due_ns: u64,
        /// Its status packets show that it was left open.
        left_open: bool,
    },
    /// OPEN is sent, status packets come or should.
    Open(Open),
    /// CLOSE is sent for good.
    Ended,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Open {
    pulse_due_ns: u64,
    /// When OPEN or SONAR is sent again unless what they ask for has come.
    repeat_due_ns: u64,
    /// When the last status packet came; the opening before the first.
    heard_ns: u64,
    /// When the last status packet with readings or with its sonar flag set came; the opening before the first.
    sonars_ns: u64,
    /// Status packets have come.
    heard: bool,
}

/// The conversation with a robot, over any number of connections.
#[derive(Debug, Clone)]
pub struct Session {
    parameters: Parameters,
    state: State,
    deframer: Deframer,
    arrivals: Arrivals,
    scanner: Scanner,
    seq: u64,
    /// The robot may still be in a session that was cut off, of an earlier process or before its adapter was pulled out: until this
    /// time its status packets are taken for that session's.
    resumable_until_ns: Option<u64>,
    /// Place of the baud rate in the parameters' list.
    baud: usize,
    tries_after_echo: u32,
    rounds: u64,
    /// Times that a robot left open was told to close, since the last connection.
    closings: u64,
    connections: u64,
    /// What the deframer had counted when the last scan was made.
    counted: LinkCounters,
    battery_v: Option<f64>,
    /// Packets in a row whose odometry was refused.
    refused_in_a_row: u32,
    /// What a robot calls itself that is of no known model.
    unknown: Option<String>,
}

impl Session {
    /// A session with a robot that is still to be found. `checkpoint` is what an earlier process of the same run kept.
    #[must_use]
    pub fn new(parameters: Parameters, checkpoint: Option<Checkpoint>) -> Self {
        let (model, track) = checkpoint.map_or((parameters.model, Track::default()), |kept| (kept.model(), kept.track));
        let baud = checkpoint.and_then(|kept| parameters.bauds.iter().position(|&baud| baud == kept.baud));
        Self {
            state: State::Absent,
            deframer: Deframer::new(),
            arrivals: Arrivals::after(checkpoint.map_or(0, |kept| kept.stamp_ns)),
            scanner: Scanner::new(&parameters, model, track),
            seq: checkpoint.map_or(0, |kept| kept.seq),
            // A process is back at once, whatever the clock of a fast simulation says.
            resumable_until_ns: baud.map(|_| u64::MAX),
            baud: baud.unwrap_or(0),
            tries_after_echo: 0,
            rounds: 0,
            closings: 0,
            connections: 0,
            counted: LinkCounters::default(),
            battery_v: None,
            refused_in_a_row: 0,
            unknown: None,
            parameters,
        }
    }

    /// The baud rate in use.
    #[must_use]
    pub fn baud(&self) -> u32 {
        self.parameters.bauds.get(self.baud).copied().unwrap_or(9600)
    }

    /// When [`Input::Tick`] is wanted, if ever.
    #[must_use]
    pub fn due_ns(&self) -> Option<u64> {
        match self.state {
            State::Absent | State::Ended => None,
            State::Syncing { due_ns, .. } | State::Closing { due_ns, .. } => Some(due_ns),
            State::Open(open) => {
                Some(open.pulse_due_ns.min(open.repeat_due_ns).min(open.heard_ns.saturating_add(self.parameters.link_lost_ns)))
            }
        }
    }

    /// Rounds over all baud rates without an answer since the last connection.
    #[must_use]
    pub fn rounds(&self) -> u64 {
        self.rounds
    }

    /// Number of the last scan; 0 before the first.
    #[must_use]
    pub fn seq(&self) -> u64 {
        self.seq
    }

    /// What came over the link, over all connections.
    #[must_use]
    pub fn link(&self) -> LinkCounters {
        self.deframer.counters()
    }

    /// What was refused inside good packets.
    #[must_use]
    pub fn refusals(&self) -> Refusals {
        self.scanner.refusals()
    }

    /// The rhythm of the packets as they arrive.
    #[must_use]
    pub fn rhythm(&self) -> Rhythm {
        self.arrivals.rhythm()
    }

    /// Times that the link was established after the first.
    #[must_use]
    pub fn reconnects(&self) -> u64 {
        self.connections.saturating_sub(1)
    }

    /// In words, for the status: what the session is doing or missing on this port.
    #[must_use]
    pub fn note(&self, port: &str) -> String {
        match self.state {
            State::Absent => format!("waiting for {port}"),
            State::Syncing { .. } | State::Closing { left_open: false, .. } if self.rounds == 0 => {
                format!("looking for a robot on {port} at {} baud", self.baud())
            }
            State::Syncing { .. } | State::Closing { left_open: false, .. } => {
                format!("no robot answers on {port}; trying {} baud", self.baud())
            }
            State::Closing { left_open: true, .. } => format!("closing the robot on {port}, which was left open"),
            State::Open(Open { heard: false, .. }) => format!("waiting for the robot's packets on {port}"),
            State::Open(_) if self.refused_in_a_row >= MANY_REFUSED => {
                format!("{} packets in a row refused: pioneer.speed_limit_m_s or turn_limit_rad_s is too low?", self.refused_in_a_row)
            }
            State::Open(_) => {
                let battery = self.battery_v.map_or_else(String::new, |volts| format!(", battery {volts:.1} V"));
                let Rhythm { interval_s, jitter_s } = self.rhythm();
                let (interval_ms, jitter_ms) = (interval_s * 1e3, jitter_s * 1e3);
                let unknown =
                    self.unknown.as_ref().map_or_else(String::new, |subclass| format!("UNKNOWN ROBOT {subclass:.16?} taken for a "));
                let (model, baud) = (self.scanner.model().name, self.baud());
                format!("{unknown}{model} at {baud} baud{battery}, a packet every {interval_ms:.0} ± {jitter_ms:.0} ms")
            }
            State::Ended => "the robot is closed".to_owned(),
        }
    }

    /// Takes what happened at `now_ns` and returns what to do about it.
    #[must_use]
    pub fn step(&mut self, input: Input<'_>, now_ns: u64) -> Vec<Output> {
        let mut out = Vec::new();
        match input {
            Input::Opened => {
                self.deframer.flush();
                self.sync(now_ns, &mut out);
            }
            Input::Bytes(bytes) => self.receive(bytes, now_ns, &mut out),
            Input::Tick => self.tick(now_ns, &mut out),
            Input::Vanished => self.vanished(),
            Input::Stop => {
                if self.state != State::Absent {
                    out.push(Output::Send(Command::Close));
                }
                self.state = State::Ended;
            }
        }
        out
    }

    fn receive(&mut self, bytes: &[u8], now_ns: u64, out: &mut Vec<Output>) {
        self.arrivals.note_read(self.deframer.position(), now_ns);
        let frames = self.deframer.push(bytes);
        let starts: Vec<_> = frames.iter().filter(|frame| Sip::is_sip(&frame.data)).map(|frame| frame.start).collect();
        let mut stamps = self.arrivals.stamps(&starts, self.deframer.open_from()).into_iter();
        for frame in frames {
            if Sip::is_sip(&frame.data) {
                let stamp_ns = stamps.next().unwrap_or(now_ns);
                self.heard_sip(&frame, stamp_ns, now_ns, out);
            } else {
                self.heard_other(&frame, now_ns, out);
            }
        }
    }

    fn heard_sip(&mut self, frame: &Frame, stamp_ns: u64, now_ns: u64, out: &mut Vec<Output>) {
        // A status packet that announces more than it has is damaged; its checksum agrees by accident.
        let Ok(sip) = Sip::decode(&frame.data) else {
            self.scanner.refuse_packet();
            return;
        };
        match self.state {
            State::Syncing { .. } => match self.resumable_until_ns.take() {
                Some(until_ns) if now_ns <= until_ns => {
                    self.scanner.mark_gap();
                    self.connections += 1;
                    out.push(Output::Event(Event::Resumed { model: self.scanner.model(), baud: self.baud() }));
                    self.state = State::Open(self.opened(now_ns));
                    self.publish(&sip, stamp_ns, now_ns, out);
                }
                _ => {
                    self.closings += 1;
                    if self.closings.is_power_of_two() {
                        out.push(Output::Event(Event::AlreadyOpen { closings: self.closings }));
                    }
                    self.disconnected();
                    self.close(true, now_ns, out);
                }
            },
            State::Open(_) => self.publish(&sip, stamp_ns, now_ns, out),
            State::Absent | State::Closing { .. } | State::Ended => {}
        }
    }

    fn heard_other(&mut self, frame: &Frame, now_ns: u64, out: &mut Vec<Output>) {
        let answer = frame.data.first().copied();
        match self.state {
            // Whatever was asked: a robot that names itself is synchronised. Some take CLOSE for the last step of a handshake.
            State::Syncing { .. } | State::Closing { left_open: false, .. } if answer == Some(number::SYNC2) => {
                if let Ok(identity) = Identity::decode(&frame.data) {
                    self.disconnected();
                    self.open(&identity, now_ns, out);
                }
            }
            State::Syncing { step, .. } if answer == Some(step) => {
                // A robot that answers a handshake is not in the session of an earlier process.
                self.disconnected();
                match step {
                    number::SYNC0 => self.send_sync(Command::Sync1, number::SYNC1, now_ns, out),
                    _ => self.send_sync(Command::Sync2, number::SYNC2, now_ns, out),
                }
            }
            // It echoes PULSE: it takes it for SYNC0, so it has been switched off and on.
            State::Open(open) if answer == Some(number::SYNC0) && now_ns.saturating_sub(open.heard_ns) > REPEAT_NS => {
                out.push(Output::Event(Event::RobotRestarted));
                self.disconnected();
                self.sync(now_ns, out);
            }
            _ => {}
        }
    }

    fn tick(&mut self, now_ns: u64, out: &mut Vec<Output>) {
        match self.state {
            State::Syncing { step, due_ns } if now_ns >= due_ns => self.no_echo(step, now_ns, out),
            State::Closing { due_ns, .. } if now_ns >= due_ns => {
                out.push(Output::Flush);
                self.deframer.flush();
                self.sync(now_ns, out);
            }
            State::Open(open) => self.tick_open(open, now_ns, out),
            _ => {}
        }
    }

    fn no_echo(&mut self, step: u8, now_ns: u64, out: &mut Vec<Output>) {
        if step != number::SYNC0 && self.tries_after_echo < TRIES_AFTER_ECHO {
            self.tries_after_echo += 1;
            self.close(false, now_ns, out);
            return;
        }
        self.tries_after_echo = 0;
        self.baud += 1;
        if self.baud >= self.parameters.bauds.len() {
            self.baud = 0;
            self.rounds += 1;
            if self.rounds.is_power_of_two() {
                out.push(Output::Event(Event::NoAnswer { rounds: self.rounds }));
            }
        }
        out.push(Output::Baud(self.baud()));
        self.deframer.flush();
        // Where a whole round was silent, the robot may be in a session that shows no sign of life: synchronised, never opened.
        match self.rounds {
            0 => self.sync(now_ns, out),
            _ => self.close(false, now_ns, out),
        }
    }

    /// Ends whatever session the robot may be in; a handshake follows.
    fn close(&mut self, left_open: bool, now_ns: u64, out: &mut Vec<Output>) {
        out.push(Output::Send(Command::Close));
        self.state = State::Closing { due_ns: now_ns + self.parameters.closing_ns, left_open };
    }

    fn tick_open(&mut self, mut open: Open, now_ns: u64, out: &mut Vec<Output>) {
        let silence_ns = now_ns.saturating_sub(open.heard_ns);
        if silence_ns >= self.parameters.link_lost_ns {
            out.extend([Output::Event(Event::LinkLost { silence_s: silence_ns as f64 / 1e9 }), Output::Reopen]);
            self.disconnected();
            self.state = State::Absent;
            return;
        }
        if now_ns >= open.pulse_due_ns {
            out.push(Output::Send(Command::Pulse));
            open.pulse_due_ns = now_ns + self.parameters.pulse_ns;
        }
        if now_ns >= open.repeat_due_ns {
            if !open.heard {
                out.push(Output::Send(Command::Open));
            }
            let silent = now_ns.saturating_sub(open.sonars_ns) >= SONARS_SILENT_NS;
            if self.scanner.model().system == System::P2os && (silent || !open.heard) {
                if open.heard {
                    out.push(Output::Event(Event::SonarsOff));
                }
                out.push(Output::Send(Command::SonarsOn));
            }
            open.repeat_due_ns = now_ns + REPEAT_NS;
        }
        self.state = State::Open(open);
    }

    /// Starts a handshake at the baud rate in use.
    fn sync(&mut self, now_ns: u64, out: &mut Vec<Output>) {
        self.send_sync(Command::Sync0, number::SYNC0, now_ns, out);
    }

    fn send_sync(&mut self, command: Command, step: u8, now_ns: u64, out: &mut Vec<Output>) {
        out.push(Output::Send(command));
        self.state = State::Syncing { step, due_ns: now_ns + self.parameters.echo_ns };
    }

    fn open(&mut self, identity: &Identity, now_ns: u64, out: &mut Vec<Output>) {
        let settings = self.parameters.model;
        let known = Model::of(identity);
        self.unknown = known.is_none().then(|| identity.subclass.clone());
        let model = known.unwrap_or(settings);
        self.scanner.set_model(model);
        out.push(Output::Event(Event::Connected { identity: identity.clone(), model, baud: self.baud() }));
        match known {
            None => out.push(Output::Event(Event::UnknownModel { subclass: identity.subclass.clone(), settings: settings.name })),
            Some(found) if found != settings => {
                out.push(Output::Event(Event::OtherModel { settings: settings.name, found: found.name }));
            }
            Some(_) => {}
        }
        out.push(Output::Send(Command::Open));
        if model.system == System::P2os {
            out.push(Output::Send(Command::SonarsOn));
        }
        self.connections += 1;
        self.rounds = 0;
        self.closings = 0;
        self.tries_after_echo = 0;
        self.state = State::Open(self.opened(now_ns));
    }

    fn opened(&self, now_ns: u64) -> Open {
        Open {
            pulse_due_ns: now_ns + self.parameters.pulse_ns,
            repeat_due_ns: now_ns + REPEAT_NS,
            heard_ns: now_ns,
            sonars_ns: now_ns,
            heard: false,
        }
    }

    /// The port is gone. The robot knows nothing of it: it stays open and counts on.
    fn vanished(&mut self) {
        match self.state {
            State::Open(Open { heard: true, .. }) => {
                self.resumable_until_ns = Some(self.scanner.track().stamp_ns.saturating_add(RESUMABLE_NS));
            }
            State::Syncing { .. } if self.resumable_until_ns.is_some() => {}
            _ => self.disconnected(),
        }
        self.state = State::Absent;
    }

    /// What was known of the robot's counters holds no longer.
    fn disconnected(&mut self) {
        self.resumable_until_ns = None;
        self.scanner.link_was_down();
    }

    fn publish(&mut self, sip: &Sip, stamp_ns: u64, now_ns: u64, out: &mut Vec<Output>) {
        if let State::Open(open) = &mut self.state {
            if open.heard && stamp_ns.saturating_sub(self.scanner.track().stamp_ns) > GAP_NS {
                self.scanner.mark_gap();
            }
            open.heard_ns = now_ns;
            open.heard = true;
            if sip.sonars_on() || !sip.readings.is_empty() {
                open.sonars_ns = now_ns;
            }
        }
        let counted = self.deframer.counters();
        if (counted.bad_checksums, counted.skipped_bytes) != (self.counted.bad_checksums, self.counted.skipped_bytes) && self.seq > 0 {
            self.scanner.mark_gap();
        }
        self.counted = counted;
        self.battery_v = Some(sip.battery_v());
        match self.scanner.scan(sip, stamp_ns) {
            Ok(scan) => {
                self.refused_in_a_row = 0;
                self.seq += 1;
                let track = self.scanner.track();
                let kept = Checkpoint::new(self.seq, stamp_ns, scan, track, self.scanner.model(), self.baud());
                out.push(Output::Publish(Box::new(kept)));
            }
            Err(step) => {
                self.refused_in_a_row += 1;
                let refused = self.scanner.refusals().odometry;
                // A limit that is too low for the robot would otherwise fill the log.
                if refused.is_power_of_two() {
                    out.push(Output::Event(Event::OdometryRefused { step, refused }));
                }
            }
        }
    }
}
