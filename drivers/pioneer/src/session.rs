//! The conversation with a robot as a state machine: bytes and time in, commands and scans out.
//!
//! ```text
//!            echo of SYNC0, SYNC1, SYNC2: OPEN
//!  Syncing ------------------------------------> Open -- silence, restart --> Syncing
//!     |  ^                                        ^
//!     |  | 400 ms                                 | status packets of a session that was cut off
//!     v  |                                        |
//!  Closing <-- status packets: left open ---------+
//!          <-- an echo is missing, or a round over all baud rates was silent: left synchronised
//! ```
//!
//! A robot that was synchronised but never opened takes SYNC0 for PULSE and answers nothing until it is closed.
//! Another program may use the robot through the shared port. Its CLOSE hands the robot over: the session is *lent* until status
//! packets come again, or the program is silent for too long, which ends in a handshake of the driver's own. While the program
//! commands an open robot, the driver sends no PULSE, so that the robot's watchdog stops it when the program dies.
//!
//! To a robot that is open, SYNC0 and SYNC1 are PULSE and OPEN: a handshake tried on it does no harm, and what comes back tells
//! which of the two it was. Every wrong turn ends in a time limit and a new handshake.

use psos::{Deframer, Frame, Identity, LinkCounters, Model, Sip, System, number};

use crate::arrivals::{Arrivals, Rhythm};
use crate::checkpoint::Checkpoint;
use crate::command::Command;
use crate::condition::{Condition, shown_by};
use crate::conditions::Conditions;
use crate::duplicates::Duplicates;
use crate::event::{Event, NotForwarded, at_speed};
use crate::exchange::{Input, Output};
use crate::loss::PacketLoss;
use crate::odometry::{Step, Track};
use crate::parameters::Parameters;
use crate::scanner::{Refusals, Scanner};
use crate::sonar_watch::SonarWatch;

/// Handshakes that may break off after an echo before another baud rate is tried: an echo shows that this one is right.
const TRIES_AFTER_ECHO: u32 = 3;

/// Time between two requests (OPEN, sonars on) that the robot has not followed: it acknowledges nothing, so either may be lost.
const REPEAT_NS: u64 = 1_000_000_000;

/// Seven sonars take 0.28 s, sixteen 0.64 s: without a reading for this long they do not fire.
const SONARS_SILENT_NS: u64 = 2_000_000_000;

/// A silence of more than three cycles: packets were lost.
const GAP_NS: u64 = 350_000_000;

/// Share of packets whose loss is said, and the share below which it is over: single packets are lost on every line.
const LOSS: (f64, f64) = (0.1, 0.05);

/// Refused packets in a row that another modulus of the counters would explain: a few may be damage, three are the firmware.
const MODULUS_HINTS: u32 = 3;

/// A modulus that has explained no packet for this long, ns, is forgotten: at 0.1 m/s the shortest wrap of 0.21 m recurs sooner.
const MODULUS_HINTED_NS: u64 = 5_000_000_000;

/// More damaged packets in a row than noise makes: the limits are too low for this robot.
const MANY_REFUSED: u32 = 10;

/// Silence of a program in its handshake after which the driver connects for itself, ns: real clients wait at most a second for an
/// echo before they repeat.
const LENT_NS: u64 = 3_000_000_000;

/// How long a robot may take to stop after its client has left, ns: the watchdog's 2 s, and braking from full speed.
const STOPS_WITHIN_NS: u64 = 5_000_000_000;

/// How long after SETO counters near zero are taken for its effect, ns: a packet on its way, and the command's.
const ZEROED_WITHIN_NS: u64 = 500_000_000;

/// Rounds of handshakes without an answer after which a connection in the network is made anew, about 8 s: the host at its other end
/// may have restarted, of which TCP tells nothing.
const SILENT_ROUNDS: u64 = 6;

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
    /// A client has closed the robot and may be in a handshake with it.
    Lent(Lent),
    /// CLOSE is sent for good.
    Ended,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Open {
    pulse_due_ns: u64,
    /// When OPEN or SONAR is sent again unless what they ask for has come.
    repeat_due_ns: u64,
    /// When the last status packet came; the opening before the first.
    packet_ns: u64,
    /// When the last status packet with readings came; the opening before the first.
    fired_ns: u64,
    /// When the last status packet with a reading that a sonar of this robot can have made came; the opening before the first.
    usable_ns: u64,
    /// Status packets have come.
    has_packets: bool,
    /// Damaged packets before the last status packet.
    damaged: u64,
    /// A client commands the robot.
    client: bool,
    /// When the client has left, if it has.
    left_ns: Option<u64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct OtherModulus {
    modulus: u32,
    /// Packets that it explains, and when the last of them came.
    hints: u32,
    hinted_ns: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Lent {
    since_ns: u64,
    /// When the driver connects for itself.
    due_ns: u64,
    /// The robot has answered SYNC2 since: status packets are those of a new session.
    named: bool,
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
    /// The robot may still be in a session that was cut off, of an earlier process or before its adapter was pulled out: its status
    /// packets are taken for that session's, whose counters tell where it went. A robot that answers a handshake is not.
    resumable: bool,
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
    /// Another modulus with which refused packets would be believed.
    other_modulus: Option<OtherModulus>,
    /// Times that the pose became doubtful.
    doubts: u64,
    duplicates: Duplicates,
    loss: PacketLoss,
    sonars: SonarWatch,
    conditions: Conditions,
    /// Handshakes that were answered without a name, since the last connection.
    nameless: u64,
    /// Whether the last of these was an echo.
    echo: bool,
    /// Whether this handshake was answered without a name.
    nameless_now: bool,
    /// What a robot calls itself that is of no known model.
    unknown: Option<String>,
    /// Whether the wheels stood still in the last status packet.
    stands: bool,
    /// Until when counters near zero are the effect of a client's SETO.
    zeroed_until_ns: u64,
    forwarded: u64,
    refused_commands: u64,
    /// The state in which the connection ended, if the robot was lent then.
    lent: Option<Lent>,
}

impl Session {
    /// A session with a robot that is still to be found. `checkpoint` is what an earlier process of the same run saved.
    #[must_use]
    pub fn new(parameters: Parameters, checkpoint: Option<Checkpoint>) -> Self {
        let (model, track) = checkpoint.map_or((parameters.model, Track::default()), |saved| (saved.model(), saved.track));
        let baud = checkpoint.and_then(|saved| match parameters.bauds.as_slice() {
            [] => Some(0),
            bauds => bauds.iter().position(|&baud| baud == saved.baud),
        });
        Self {
            state: State::Absent,
            deframer: Deframer::new(),
            arrivals: Arrivals::after(checkpoint.map_or(0, |saved| saved.stamp_ns)),
            scanner: Scanner::new(&parameters, model, track),
            seq: checkpoint.map_or(0, |saved| saved.seq),
            resumable: baud.is_some(),
            baud: baud.unwrap_or(0),
            tries_after_echo: 0,
            rounds: 0,
            closings: 0,
            connections: 0,
            counted: LinkCounters::default(),
            battery_v: None,
            refused_in_a_row: 0,
            other_modulus: None,
            doubts: 0,
            duplicates: Duplicates::default(),
            loss: PacketLoss::default(),
            sonars: SonarWatch::default(),
            conditions: Conditions::default(),
            nameless: 0,
            echo: false,
            nameless_now: false,
            unknown: None,
            stands: false,
            zeroed_until_ns: 0,
            forwarded: 0,
            refused_commands: 0,
            lent: None,
            parameters,
        }
    }

    /// The baud rate in use; 0 for a connection in the network.
    #[must_use]
    pub fn baud(&self) -> u32 {
        self.parameters.bauds.get(self.baud).copied().unwrap_or(0)
    }

    /// Whether clients on the shared port receive what the robot sends: not while the driver is in a handshake of its own.
    #[must_use]
    pub fn is_shared(&self) -> bool {
        matches!(self.state, State::Open(_) | State::Lent(_))
    }

    /// Commands of clients that were forwarded, and those that were not.
    #[must_use]
    pub fn client_commands(&self) -> (u64, u64) {
        (self.forwarded, self.refused_commands)
    }

    /// When [`Input::Tick`] is wanted, if ever.
    #[must_use]
    pub fn due_ns(&self) -> Option<u64> {
        match self.state {
            State::Absent | State::Ended => None,
            State::Syncing { due_ns, .. } | State::Closing { due_ns, .. } => Some(due_ns),
            State::Lent(Lent { due_ns, .. }) => Some(due_ns),
            State::Open(open) => {
                let lost_ns = open.packet_ns.saturating_add(self.parameters.link_lost_ns);
                let pulse_ns = if open.client { u64::MAX } else { open.pulse_due_ns };
                let stopped_ns = open.left_ns.map_or(u64::MAX, |left_ns| left_ns.saturating_add(STOPS_WITHIN_NS));
                Some(pulse_ns.min(open.repeat_due_ns).min(lost_ns).min(stopped_ns))
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

    /// Takes account of a time in which the clock stood still, as while a computer is suspended: the robot had more time to move than
    /// the stamps tell.
    pub fn add_unseen(&mut self, time_ns: u64) {
        self.scanner.mark_gap();
        self.scanner.add_unseen(time_ns);
    }

    /// Times that the robot may have moved without its counters telling where to.
    #[must_use]
    pub fn doubtful_poses(&self) -> u64 {
        self.doubts
    }

    /// Status packets that came twice.
    #[must_use]
    pub fn duplicates(&self) -> u64 {
        self.duplicates.count()
    }

    /// Status packets that did not arrive, as far as the robot's rhythm tells.
    #[must_use]
    pub fn lost_packets(&self) -> u64 {
        self.loss.lost()
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
            State::Syncing { .. } | State::Closing { left_open: false, .. } if self.nameless > 0 && self.echo => {
                format!("{port} sends back what is sent to it: it is not a robot")
            }
            State::Syncing { .. } | State::Closing { left_open: false, .. } if self.rounds == 0 => {
                format!("looking for a robot on {port}{}", at_speed(self.baud()))
            }
            State::Syncing { .. } | State::Closing { left_open: false, .. } => {
                let trying = if self.baud() == 0 { "again".to_owned() } else { format!("{} baud", self.baud()) };
                format!("no robot answers on {port}; trying {trying}")
            }
            State::Closing { left_open: true, .. } => format!("closing the robot on {port}, which was left open"),
            State::Lent(_) => format!("lent to a program on the shared port, which connects to the robot on {port}"),
            State::Open(Open { has_packets: false, .. }) => format!("waiting for the robot's packets on {port}"),
            State::Open(Open { client, .. }) => {
                let conditions = self.conditions.words();
                let mut conditions = if conditions.is_empty() { conditions } else { conditions + "; " };
                if self.doubts > 0 {
                    conditions += &format!("POSE DOUBTFUL since {} gap{}; ", self.doubts, if self.doubts == 1 { "" } else { "s" });
                }
                let battery = self.battery_v.map_or_else(String::new, |volts| format!(", battery {volts:.1} V"));
                let Rhythm { interval_s, jitter_s } = self.rhythm();
                let (interval_ms, jitter_ms) = (interval_s * 1e3, jitter_s * 1e3);
                let unknown =
                    self.unknown.as_ref().map_or_else(String::new, |subclass| format!("UNKNOWN ROBOT {subclass:.16?} taken for a "));
                let (model, speed) = (self.scanner.model().name, at_speed(self.baud()));
                let shared = if client { ", commanded by a program on the shared port" } else { "" };
                format!("{conditions}{unknown}{model}{speed}{shared}{battery}, a packet every {interval_ms:.0} ± {jitter_ms:.0} ms")
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
                // Some simulators end the connection when a client closes the robot: the client continues its handshake.
                match self.lent {
                    Some(lent) if now_ns < lent.due_ns => self.state = State::Lent(lent),
                    _ => self.sync(now_ns, &mut out),
                }
                self.lent = None;
            }
            Input::Client(data) => self.forward(data, now_ns, &mut out),
            Input::ClientLeft => self.client_left(now_ns),
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
        let mut frames = self.deframer.push(bytes);
        frames.retain(|frame| !Sip::is_sip(&frame.data) || !self.is_duplicate(frame, now_ns));
        let starts: Vec<_> = frames.iter().filter(|frame| Sip::is_sip(&frame.data)).map(|frame| frame.start).collect();
        let mut stamps = self.arrivals.stamps(&starts, self.deframer.open_from()).into_iter();
        for frame in frames {
            if Sip::is_sip(&frame.data) {
                let stamp_ns = stamps.next().unwrap_or(now_ns);
                self.on_status_packet(&frame, stamp_ns, now_ns, out);
            } else {
                self.on_other_packet(&frame, now_ns, out);
            }
        }
    }

    /// A packet that came twice shows that the line is alive, and nothing else.
    fn is_duplicate(&mut self, frame: &Frame, now_ns: u64) -> bool {
        let duplicate = self.duplicates.is_duplicate(&frame.data);
        if let State::Open(open) = &mut self.state
            && duplicate
        {
            open.packet_ns = now_ns;
        }
        duplicate
    }

    fn on_status_packet(&mut self, frame: &Frame, stamp_ns: u64, now_ns: u64, out: &mut Vec<Output>) {
        // A status packet that announces more than it has is damaged; its checksum agrees by accident.
        let Ok(sip) = Sip::decode(&frame.data) else {
            self.scanner.refuse_packet();
            return;
        };
        match self.state {
            State::Syncing { .. } if std::mem::take(&mut self.resumable) => {
                self.scanner.mark_gap();
                self.connections += 1;
                out.push(Output::Event(Event::Resumed { model: self.scanner.model(), baud: self.baud() }));
                self.rounds = 0;
                self.state = State::Open(self.opened(now_ns));
                self.publish(&sip, stamp_ns, now_ns, out);
            }
            State::Syncing { .. } => {
                self.closings += 1;
                if self.closings.is_power_of_two() {
                    out.push(Output::Event(Event::AlreadyOpen { closings: self.closings }));
                }
                self.disconnected();
                self.close(true, now_ns, out);
            }
            State::Open(_) => self.publish(&sip, stamp_ns, now_ns, out),
            State::Lent(lent) => {
                if lent.named {
                    self.connections += 1;
                    self.scanner.mark_gap();
                }
                // Before the robot's answer to SYNC2, packets are of the session that the client has closed: they were on their way, or
                // the robot has missed CLOSE.
                if lent.named || now_ns.saturating_sub(lent.since_ns) >= self.parameters.closing_ns {
                    self.state = State::Open(Open { client: true, ..self.opened(now_ns) });
                }
                self.publish(&sip, stamp_ns, now_ns, out);
            }
            State::Absent | State::Closing { .. } | State::Ended => {}
        }
    }

    fn on_other_packet(&mut self, frame: &Frame, now_ns: u64, out: &mut Vec<Output>) {
        let answer = frame.data.first().copied();
        match self.state {
            // Whatever was asked: a robot that names itself is synchronised. Some take CLOSE for the last step of a handshake.
            State::Syncing { .. } | State::Closing { left_open: false, .. } if answer == Some(number::SYNC2) => {
                match Identity::decode(&frame.data) {
                    Ok(identity) => {
                        self.disconnected();
                        self.open(&identity, now_ns, out);
                    }
                    Err(_) => self.nameless(frame, out),
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
            State::Lent(lent) if answer == Some(number::SYNC2) => {
                if let Ok(identity) = Identity::decode(&frame.data) {
                    self.state = State::Lent(Lent { named: true, ..lent });
                    self.disconnected();
                    self.meet(&identity, out);
                }
            }
            // It echoes PULSE: it takes it for SYNC0, so it has been switched off and on.
            State::Open(open) if answer == Some(number::SYNC0) && now_ns.saturating_sub(open.packet_ns) > REPEAT_NS => {
                out.push(Output::Event(Event::RobotRestarted));
                self.disconnected();
                self.sync(now_ns, out);
            }
            _ => {}
        }
    }

    /// A handshake was answered, but not by a robot; its time limit ends it.
    fn nameless(&mut self, frame: &Frame, out: &mut Vec<Output>) {
        if !matches!(self.state, State::Syncing { step: number::SYNC2, .. }) {
            return;
        }
        let echo = frame.data == [number::SYNC2];
        self.nameless += 1;
        self.echo = echo;
        self.nameless_now = true;
        if self.nameless.is_power_of_two() {
            out.push(Output::Event(Event::NotARobot { echo, times: self.nameless }));
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
            State::Lent(Lent { due_ns, .. }) if now_ns >= due_ns => self.close(false, now_ns, out),
            _ => {}
        }
    }

    /// Forwards a client's command, and notes what it does to the session.
    fn forward(&mut self, data: &[u8], now_ns: u64, out: &mut Vec<Output>) {
        let number = data.first().copied().unwrap_or_default();
        let packet = match self.state {
            State::Open(_) | State::Lent(_) if number == number::HOSTBAUD => Err(NotForwarded::Speed),
            State::Open(_) | State::Lent(_) => psos::encode_frame(data).map_err(|_| NotForwarded::Long),
            _ => Err(NotForwarded::NotConnected),
        };
        match packet {
            Ok(packet) => out.push(Output::Forward(packet)),
            Err(why) => {
                self.refused_commands += 1;
                if self.refused_commands.is_power_of_two() {
                    out.push(Output::Event(Event::ClientRefused { why, refused: self.refused_commands }));
                }
                return;
            }
        }
        self.forwarded += 1;
        match &mut self.state {
            State::Open(_) if number == number::CLOSE => {
                out.push(Output::Event(Event::ClientConnects));
                self.lend(now_ns);
            }
            State::Open(open) => {
                (open.client, open.left_ns) = (true, None);
                if number == number::SETO {
                    self.zeroed_until_ns = now_ns + ZEROED_WITHIN_NS;
                }
            }
            State::Lent(lent) => {
                lent.due_ns = now_ns + LENT_NS;
                // To a synchronised robot the number of SYNC2 means CLOSE.
                lent.named &= number != number::CLOSE;
            }
            _ => {}
        }
    }

    fn lend(&mut self, now_ns: u64) {
        self.scanner.expect_restart(self.stands);
        self.forget_conditions();
        self.state = State::Lent(Lent { since_ns: now_ns, due_ns: now_ns + LENT_NS, named: false });
    }

    /// A client has left. An open robot that it commanded is closed once it stands: its watchdog stops it.
    fn client_left(&mut self, now_ns: u64) {
        match &mut self.state {
            State::Open(open) if open.client => open.left_ns = Some(now_ns),
            State::Lent(lent) => lent.due_ns = now_ns,
            _ => {}
        }
    }

    fn no_echo(&mut self, step: u8, now_ns: u64, out: &mut Vec<Output>) {
        if step != number::SYNC0 && !self.nameless_now && self.tries_after_echo < TRIES_AFTER_ECHO {
            self.tries_after_echo += 1;
            self.close(false, now_ns, out);
            return;
        }
        self.tries_after_echo = 0;
        if step == number::SYNC0 {
            self.nameless = 0;
        }
        self.baud += 1;
        if self.baud >= self.parameters.bauds.len() {
            self.baud = 0;
            self.rounds += 1;
            if self.rounds.is_power_of_two() {
                out.push(Output::Event(Event::NoAnswer { rounds: self.rounds }));
            }
        }
        if !self.parameters.bauds.is_empty() {
            out.push(Output::Baud(self.baud()));
        } else if self.rounds.is_multiple_of(SILENT_ROUNDS) {
            out.push(Output::Reopen);
            self.state = State::Absent;
            return;
        }
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
        let silence_ns = now_ns.saturating_sub(open.packet_ns);
        if silence_ns >= self.parameters.link_lost_ns {
            let damaged = self.deframer.counters().bad_checksums.saturating_sub(open.damaged);
            out.extend([Output::Event(Event::LinkLost { silence_s: silence_ns as f64 / 1e9, damaged }), Output::Reopen]);
            self.resumable = open.has_packets;
            self.forget_conditions();
            self.state = State::Absent;
            return;
        }
        if let Some(left_ns) = open.left_ns
            && (self.stands || now_ns.saturating_sub(left_ns) >= STOPS_WITHIN_NS)
        {
            out.push(Output::Event(Event::ClientLeft));
            self.scanner.expect_restart(self.stands);
            self.close(false, now_ns, out);
            return;
        }
        if now_ns >= open.pulse_due_ns && !open.client {
            out.push(Output::Send(Command::Pulse));
            open.pulse_due_ns = now_ns + self.parameters.pulse_ns;
        }
        if now_ns >= open.repeat_due_ns {
            if !open.has_packets {
                out.push(Output::Send(Command::Open));
            }
            // Of a line that is dead nothing is known of the sonars.
            let silent = open.packet_ns.saturating_sub(open.fired_ns) >= SONARS_SILENT_NS;
            if self.scanner.model().system == System::P2os && (silent || !open.has_packets) {
                out.push(Output::Send(Command::SonarsOn));
            }
            open.repeat_due_ns = now_ns + REPEAT_NS;
        }
        self.state = State::Open(open);
    }

    /// Starts a handshake at the baud rate in use.
    fn sync(&mut self, now_ns: u64, out: &mut Vec<Output>) {
        self.nameless_now = false;
        self.send_sync(Command::Sync0, number::SYNC0, now_ns, out);
    }

    fn send_sync(&mut self, command: Command, step: u8, now_ns: u64, out: &mut Vec<Output>) {
        out.push(Output::Send(command));
        self.state = State::Syncing { step, due_ns: now_ns + self.parameters.echo_ns };
    }

    fn open(&mut self, identity: &Identity, now_ns: u64, out: &mut Vec<Output>) {
        let model = self.meet(identity, out);
        out.push(Output::Send(Command::Open));
        if model.system == System::P2os {
            out.push(Output::Send(Command::SonarsOn));
        }
        self.connections += 1;
        self.rounds = 0;
        self.closings = 0;
        self.tries_after_echo = 0;
        self.nameless = 0;
        self.state = State::Open(self.opened(now_ns));
    }

    /// Takes the factors of a robot that names itself.
    fn meet(&mut self, identity: &Identity, out: &mut Vec<Output>) -> &'static Model {
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
        model
    }

    fn opened(&self, now_ns: u64) -> Open {
        Open {
            pulse_due_ns: now_ns + self.parameters.pulse_ns,
            repeat_due_ns: now_ns + REPEAT_NS,
            packet_ns: now_ns,
            fired_ns: now_ns,
            usable_ns: now_ns,
            has_packets: false,
            damaged: self.deframer.counters().bad_checksums,
            client: false,
            left_ns: None,
        }
    }

    /// The port is gone. The robot knows nothing of it: it stays open and counts on.
    fn vanished(&mut self) {
        match self.state {
            State::Open(Open { has_packets, .. }) => self.resumable = has_packets,
            State::Syncing { .. } if self.resumable => {}
            State::Lent(lent) => {
                self.lent = Some(lent);
                self.disconnected();
            }
            _ => self.disconnected(),
        }
        self.forget_conditions();
        self.state = State::Absent;
    }

    /// What was known of the robot's counters holds no longer.
    fn disconnected(&mut self) {
        self.resumable = false;
        self.scanner.link_was_down();
        self.forget_conditions();
    }

    /// Of a robot that is not connected nothing is known.
    fn forget_conditions(&mut self) {
        self.conditions.clear();
        self.loss.restart();
        self.sonars = SonarWatch::default();
        self.other_modulus = None;
        self.refused_in_a_row = 0;
    }

    fn publish(&mut self, sip: &Sip, stamp_ns: u64, now_ns: u64, out: &mut Vec<Output>) {
        let counted = self.deframer.counters();
        if let State::Open(open) = &mut self.state {
            if open.has_packets && stamp_ns.saturating_sub(self.scanner.track().stamp_ns) > GAP_NS {
                self.scanner.mark_gap();
            }
            open.packet_ns = now_ns;
            open.has_packets = true;
            open.damaged = counted.bad_checksums;
            if !sip.readings.is_empty() {
                open.fired_ns = now_ns;
            }
        }
        if (counted.bad_checksums, counted.skipped_bytes) != (self.counted.bad_checksums, self.counted.skipped_bytes) && self.seq > 0 {
            self.scanner.mark_gap();
        }
        self.counted = counted;
        self.battery_v = Some(sip.battery_v());
        self.stands = sip.left_velocity == 0 && sip.right_velocity == 0;
        if now_ns < self.zeroed_until_ns && self.scanner.restart_at_zero(sip) {
            self.zeroed_until_ns = 0;
        }
        self.loss.note(stamp_ns);
        self.sonars.note(&sip.readings, now_ns);
        let usable = match self.scanner.scan(sip, stamp_ns) {
            Ok(scan) => {
                self.refused_in_a_row = 0;
                let rest = self.scanner.take_rest();
                for (stamp_ns, scan) in (stamp_ns..).zip([scan].into_iter().chain(rest)) {
                    self.seq += 1;
                    let track = self.scanner.track();
                    let saved = Checkpoint::new(self.seq, stamp_ns, scan, track, self.scanner.model(), self.baud());
                    out.push(Output::Publish(Box::new(saved)));
                    self.arrivals.note_stamp(stamp_ns);
                }
                if let Some(doubt) = self.scanner.take_doubt() {
                    self.doubts += 1;
                    out.push(Output::Event(Event::PoseDoubtful { doubt }));
                }
                scan.count > 0
            }
            Err(step) => {
                self.refused(step, now_ns, out);
                !sip.readings.is_empty()
            }
        };
        if let State::Open(open) = &mut self.state
            && usable
        {
            open.usable_ns = now_ns;
        }
        self.observe(sip, now_ns, out);
    }

    fn refused(&mut self, step: Step, now_ns: u64, out: &mut Vec<Output>) {
        self.refused_in_a_row += 1;
        let refused = self.scanner.refusals().odometry;
        // A limit that is too low for the robot would otherwise fill the log.
        if refused.is_power_of_two() {
            out.push(Output::Event(Event::OdometryRefused { step, refused }));
        }
        // A packet that no modulus explains does not refute one: it may be damaged.
        let Step::Refused { modulus: Some(modulus), .. } = step else { return };
        let hints = self.other_modulus.filter(|other| other.modulus == modulus).map_or(0, |other| other.hints);
        self.other_modulus = Some(OtherModulus { modulus, hints: hints.saturating_add(1), hinted_ns: now_ns });
    }

    /// Judges what a person should know of after this packet.
    fn observe(&mut self, sip: &Sip, now_ns: u64, out: &mut Vec<Output>) {
        let State::Open(Open { fired_ns, usable_ns, .. }) = self.state else { return };
        let share = self.loss.share();
        let bearable = if self.conditions.holds(Condition::PacketLoss) { LOSS.1 } else { LOSS.0 };
        let silent_s = |since_ns: u64| now_ns.saturating_sub(since_ns) / 1_000_000_000;
        let no_readings = if now_ns.saturating_sub(fired_ns) >= SONARS_SILENT_NS {
            Some(format!("NO SONAR READINGS for {} s", silent_s(fired_ns)))
        } else if now_ns.saturating_sub(usable_ns) >= SONARS_SILENT_NS {
            Some(format!("NO USABLE SONAR READINGS for {} s: is robot.model right?", silent_s(usable_ns)))
        } else {
            None
        };
        self.other_modulus.take_if(|other| now_ns.saturating_sub(other.hinted_ns) >= MODULUS_HINTED_NS);
        let odometry = match self.other_modulus {
            Some(OtherModulus { modulus, hints: MODULUS_HINTS.., .. }) => {
                Some(format!("ODOMETRY REFUSED: set robot.odometry_modulus = {modulus}"))
            }
            _ if self.refused_in_a_row >= MANY_REFUSED => Some(format!(
                "{} packets in a row refused: are robot.odometry_modulus, pioneer.speed_limit_m_s and turn_limit_rad_s right?",
                self.refused_in_a_row
            )),
            _ => None,
        };
        let shown = shown_by(sip, self.scanner.model().system, self.conditions.holds(Condition::LowBattery));
        let measured = [
            (Condition::NoReadings, no_readings),
            (Condition::SilentSonars, self.sonars.silent(now_ns)),
            (Condition::PacketLoss, (share >= bearable).then(|| format!("{:.0} % OF THE PACKETS LOST", 100.0 * share))),
            (Condition::Odometry, odometry),
        ];
        for (condition, words) in shown.into_iter().chain(measured) {
            out.extend(self.conditions.observe(condition, words, now_ns).map(Output::Event));
        }
    }
}
