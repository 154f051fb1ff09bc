//! The robot's end of the serial line: bytes from a client in, bytes to the client out. No I/O.
//!
//! The robot is closed until a client has gone through SYNC0, SYNC1 and SYNC2 and sent OPEN; then it sends a status packet
//! whenever one is due. Bad packets and commands that it does not know are dropped in silence, as a robot does. It is driven by
//! hand: motion commands move nothing, and a client that falls silent stops nothing.

use messages::Pose;
use psos::{Argument, Command, Deframer, Identity, LinkCounters, RawReading, Sip, System, number};

use crate::body::Body;
use crate::config_packet;
use crate::odometry::seen_from;
use crate::simulation::{PACKET_INTERVAL_NS, Packet};

/// A robot's watchdog: a client that is silent for longer is taken to be gone.
const WATCHDOG_NS: u64 = 2_000_000_000;

/// A charged battery, 0.1 V.
const BATTERY: u8 = 126;

/// P2OS flags: the motors have power.
const MOTORS_FLAG: u16 = 1;

/// P2OS flags: the front array fires; the rear array's flag is the next bit.
const FRONT_SONARS_FLAG: u16 = 1 << 1;

/// P2OS charge state: the charger is not connected.
const NOT_CHARGING: u8 = 0;

/// P2OS temperature of a robot without a thermometer, -127 °C as a signed byte.
const NO_TEMPERATURE: u8 = 0x81;

/// P2OS state of charge of a robot that does not measure it, %.
const NO_CHARGE_METER: u8 = 0;

/// How far the handshake has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Link {
    /// Waits for SYNC0.
    Closed,
    /// SYNC0 has been answered.
    Synced0,
    /// SYNC1 has been answered.
    Synced1,
    /// SYNC2 has been answered: waits for OPEN. From here on 0, 1 and 2 are PULSE, OPEN and CLOSE.
    Ready,
    /// Sends status packets.
    Open,
}

/// A robot on a serial line.
#[derive(Debug, Clone)]
pub struct RobotEnd {
    body: Body,
    /// At which its position counters start again from 0.
    modulus: u32,
    identity: Identity,
    deframer: Deframer,
    link: Link,
    /// Where the odometry stood when the counters were last set to zero.
    origin: Pose,
    /// The odometry of the last packet.
    odometry: Pose,
    motors_on: bool,
    sonars_on: bool,
    /// Since the last command, by status packets.
    silent_ns: u64,
}

impl RobotEnd {
    /// A robot that has just been switched on, at `odometry` in the frame of the drive's start; its counters stand at zero.
    #[must_use]
    pub fn new(body: &Body, modulus: u32, odometry: Pose) -> Self {
        let subclass = body.model().subclass().to_owned();
        Self {
            body: body.clone(),
            modulus: modulus.clamp(1, 1 << 16),
            identity: Identity { name: "stillmap-simulator".to_owned(), class: "Pioneer".to_owned(), subclass },
            deframer: Deframer::new(),
            link: Link::Closed,
            origin: odometry,
            odometry,
            motors_on: false,
            sonars_on: true,
            silent_ns: 0,
        }
    }

    /// Whether a client has opened the robot, so that it sends status packets.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.link == Link::Open
    }

    /// Whether an open robot has not heard from its client for longer than its watchdog bears.
    #[must_use]
    pub fn client_is_silent(&self) -> bool {
        self.is_open() && self.silent_ns > WATCHDOG_NS
    }

    /// Whether the sonars fire, or the client has switched them off.
    #[must_use]
    pub fn sonars_on(&self) -> bool {
        self.sonars_on
    }

    /// What came over the line.
    #[must_use]
    pub fn line(&self) -> LinkCounters {
        self.deframer.counters()
    }

    /// Takes bytes from the client; returns the bytes of the answers.
    pub fn push(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut answers = Vec::new();
        for frame in self.deframer.push(bytes) {
            if let Ok(command) = Command::decode(&frame.data) {
                self.silent_ns = 0;
                answers.extend(self.obey(&command));
            }
        }
        answers
    }

    /// Takes what the robot knows when a packet is due; returns the bytes of the status packet, none unless a client has opened
    /// the robot.
    pub fn tick(&mut self, packet: &Packet) -> Vec<u8> {
        self.odometry = packet.odometry;
        self.silent_ns += PACKET_INTERVAL_NS;
        if !self.is_open() {
            return Vec::new();
        }
        // A full ring's readings and the tail always fit into a packet.
        self.status(packet).encode().unwrap_or_default()
    }

    fn obey(&mut self, command: &Command) -> Vec<u8> {
        match (self.link, command.number) {
            (Link::Open | Link::Ready, number::CLOSE) => self.link = Link::Closed,
            (Link::Open, number::SETO) => self.origin = self.odometry,
            (Link::Open, number::ENABLE) => self.motors_on = switched_on(command),
            (Link::Open, number::SONAR) => self.sonars_on = switched_on(command),
            (Link::Open, number::CONFIG) if self.body.model().system == System::P2os => {
                return config_packet::encode(&self.identity, self.body.ring().len());
            }
            // PULSE, OPEN, which a client that does not know of the open session sends as SYNC0 and SYNC1, and everything else.
            (Link::Open, _) => {}
            (Link::Ready, number::OPEN) => self.link = Link::Open,
            (Link::Ready, _) => {}
            (_, number::SYNC0) => return self.answer(Link::Synced0, Command::plain(number::SYNC0).encode()),
            (Link::Synced0 | Link::Synced1, number::SYNC1) => return self.answer(Link::Synced1, Command::plain(number::SYNC1).encode()),
            (Link::Synced1, number::SYNC2) => return self.answer(Link::Ready, self.identity.encode()),
            (Link::Closed | Link::Synced0 | Link::Synced1, _) => {}
        }
        Vec::new()
    }

    fn answer(&mut self, link: Link, packet: Result<Vec<u8>, psos::FrameError>) -> Vec<u8> {
        self.link = link;
        // The answers to the handshake are short.
        packet.unwrap_or_default()
    }

    fn status(&self, packet: &Packet) -> Sip {
        let model = self.body.model();
        let place = seen_from(&self.origin, &packet.odometry);
        let half_track_m = model.width_mm / 2000.0;
        let wheel = |side: f64| (packet.speed_m_s + side * half_track_m * packet.turn_rad_s) * 1000.0 / model.velocity_mm_s;
        let readings = packet.readings.iter().filter(|_| self.sonars_on);
        let moving = packet.speed_m_s != 0.0 || packet.turn_rad_s != 0.0;
        Sip {
            status: (if moving { psos::MOVING } else { psos::STOPPED }) & 0x0F,
            x: self.counter(place.x_m),
            y: self.counter(place.y_m),
            heading: heading(place.yaw_rad, model),
            left_velocity: wheel(-1.0).round() as i16,
            right_velocity: wheel(1.0).round() as i16,
            battery: BATTERY,
            left_stall_bumpers: 0,
            right_stall_bumpers: 0,
            control: 0,
            flags: self.flags(),
            compass: 0,
            readings: readings.map(|r| RawReading { sonar: r.sonar, range: self.body.range_units(r.range_m) }).collect(),
            tail: self.tail(packet),
        }
    }

    /// The bytes after the readings. PSOS ends with timer, analog input, digital inputs and outputs. P2OS and its successors have a
    /// port selection in place of the timer and eleven more bytes; some clients refuse packets without them.
    fn tail(&self, packet: &Packet) -> Vec<u8> {
        let since_start_ms = (packet.stamp_ns / 1_000_000) as u16;
        if self.body.model().system == System::Psos {
            return [&since_start_ms.to_le_bytes()[..], &[0; 3]].concat();
        }
        let turn = (packet.turn_rad_s.to_degrees() * 10.0).round() as i16;
        let (port, inputs_outputs, charge_state, faults, sideways) = ([0; 2], [0; 3], [NOT_CHARGING], [0; 2], [0; 2]);
        let battery = u16::from(BATTERY).to_le_bytes();
        let parts: [&[u8]; 8] =
            [&port, &inputs_outputs, &battery, &charge_state, &turn.to_le_bytes(), &faults, &sideways, &[NO_TEMPERATURE, NO_CHARGE_METER]];
        parts.concat()
    }

    fn counter(&self, distance_m: f64) -> u16 {
        let units = (distance_m * 1000.0 / self.body.model().distance_mm).round();
        units.rem_euclid(f64::from(self.modulus)) as u16
    }

    fn flags(&self) -> u16 {
        if self.body.model().system == System::Psos {
            return 0;
        }
        let arrays = if self.body.ring().len() > 8 { FRONT_SONARS_FLAG | FRONT_SONARS_FLAG << 1 } else { FRONT_SONARS_FLAG };
        (if self.motors_on { MOTORS_FLAG } else { 0 }) | (if self.sonars_on { arrays } else { 0 })
    }
}

/// The heading in the model's units, from minus half a turn up to half a turn.
fn heading(yaw_rad: f64, model: &psos::Model) -> i16 {
    let turn = f64::from(model.heading_units);
    let units = (yaw_rad / model.heading_rad()).round().rem_euclid(turn);
    (if units >= turn / 2.0 { units - turn } else { units }) as i16
}

/// What ENABLE or SONAR says: without a number it switches on.
fn switched_on(command: &Command) -> bool {
    command.argument != Argument::Int(0)
}
