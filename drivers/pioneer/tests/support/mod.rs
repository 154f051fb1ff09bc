//! A robot in virtual time, and a driver session in front of it.
#![allow(dead_code, clippy::unwrap_used, reason = "each test file uses its part; tests fail by panicking")]

use psos::{Deframer, Identity, RawReading, Sip, number};
use stillmap_pioneer::{Checkpoint, Condition, Event, Input, Output, Parameters, Session};

pub(crate) const MS: u64 = 1_000_000;
pub(crate) const S: u64 = 1000 * MS;

pub(crate) fn recording(name: &str) -> Vec<u8> {
    std::fs::read(std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/pioneer").join(name)).unwrap()
}

/// A robot that drives straight on, at 0.3 m/s unless told otherwise, and whose counters wrap around at 2^15.
pub(crate) struct Robot {
    pub subclass: &'static str,
    pub baud: u32,
    pub open: bool,
    /// Whether the handshake is done: until it is opened or closed, the robot takes SYNC0 for PULSE.
    pub named: bool,
    /// Whether the next OPEN is lost on its way.
    pub misses_open: bool,
    /// Whether sonars fire.
    pub sonars: bool,
    /// Whether it follows the command SONAR.
    pub has_sonar_command: bool,
    /// Metres travelled.
    pub x_m: f64,
    pub m_per_cycle: f64,
    /// mm per unit of its counters, where that is not its model's.
    pub unit_mm: Option<f64>,
    /// Readings of every packet, instead of one of sonar 3.
    pub readings: Vec<RawReading>,
    /// Where it was when it was opened.
    pub opened_at_m: f64,
    /// Whether its counters start at zero when it is opened.
    pub zeroes: bool,
    /// The number at which its counters start again from 0.
    pub modulus: u64,
    pub battery: u8,
    /// Stall and bumper bits of the left and right wheel.
    pub stall_bumpers: (u8, u8),
    /// Its flags where they are not what its sonars say.
    pub flags: Option<u16>,
    /// Whether its answer to SYNC2 has no names.
    pub nameless: bool,
    /// Whether what is said to it is lost.
    pub unresponsive: bool,
    pub received: Vec<u8>,
    pub next_sip_ns: u64,
    pub deframer: Deframer,
}

impl Robot {
    pub(crate) fn pioneer_1() -> Self {
        Self {
            subclass: "pion1m",
            baud: 9600,
            open: false,
            named: false,
            misses_open: false,
            sonars: true,
            has_sonar_command: false,
            x_m: 0.0,
            m_per_cycle: 0.03,
            unit_mm: None,
            readings: Vec::new(),
            opened_at_m: 0.0,
            zeroes: false,
            modulus: 32768,
            battery: 131,
            stall_bumpers: (0, 0),
            flags: None,
            nameless: false,
            unresponsive: false,
            received: Vec::new(),
            next_sip_ns: 0,
            deframer: Deframer::new(),
        }
    }

    pub(crate) fn p3_dx() -> Self {
        Self { subclass: "p3dx", sonars: false, has_sonar_command: true, ..Self::pioneer_1() }
    }

    fn unit_mm(&self) -> f64 {
        self.unit_mm.unwrap_or_else(|| psos::Model::of(&self.identity()).map_or(0.05066, |model| model.distance_mm))
    }

    fn identity(&self) -> Identity {
        Identity { name: "test".into(), class: "Pioneer".into(), subclass: self.subclass.into() }
    }

    /// What it answers to bytes that arrive at this baud rate.
    pub(crate) fn receive(&mut self, bytes: &[u8], baud: u32, now_ns: u64) -> Vec<u8> {
        if self.unresponsive || baud != self.baud {
            return Vec::new();
        }
        let mut answer = Vec::new();
        for frame in self.deframer.push(bytes) {
            let command = psos::Command::decode(&frame.data).unwrap();
            self.received.push(command.number);
            match (self.open, command.number) {
                // After the handshake the number of SYNC1 means OPEN.
                (false, number::OPEN) if self.named && std::mem::take(&mut self.misses_open) => {}
                (false, number::OPEN) if self.named => {
                    self.open = true;
                    self.opened_at_m = self.x_m;
                    self.next_sip_ns = now_ns + 100 * MS;
                }
                (false, number::CLOSE) if self.named => self.named = false,
                (false, number::PULSE) if self.named => {}
                (false, number::SYNC0 | number::SYNC1) => answer.extend(psos::encode_frame(&[command.number]).unwrap()),
                (false, number::SYNC2) if self.nameless => answer.extend(psos::encode_frame(&[number::SYNC2, 0]).unwrap()),
                (false, number::SYNC2) => {
                    self.named = true;
                    answer.extend(self.identity().encode().unwrap());
                }
                (true, number::CLOSE) => (self.open, self.named) = (false, false),
                (true, number::SETO) => self.opened_at_m = self.x_m,
                (true, number::SONAR) => self.sonars |= self.has_sonar_command,
                _ => {}
            }
        }
        answer
    }

    /// What it says by itself.
    pub(crate) fn speak(&mut self, now_ns: u64) -> Vec<u8> {
        let mut said = Vec::new();
        while now_ns >= self.next_sip_ns {
            self.next_sip_ns += 100 * MS;
            self.x_m += self.m_per_cycle;
            if self.open {
                said.extend(self.sip().encode().unwrap());
            }
        }
        said
    }

    pub(crate) fn sip(&self) -> Sip {
        let readings = if self.readings.is_empty() { vec![RawReading { sonar: 3, range: 1000 }] } else { self.readings.clone() };
        let origin_m = if self.zeroes { self.opened_at_m } else { 0.0 };
        let units = ((self.x_m - origin_m) * 1000.0 / self.unit_mm()) as u64;
        Sip {
            status: 2,
            x: (units % self.modulus) as u16,
            y: 0,
            heading: 0,
            left_velocity: (self.m_per_cycle * 4000.0) as i16,
            right_velocity: (self.m_per_cycle * 4000.0) as i16,
            battery: self.battery,
            left_stall_bumpers: self.stall_bumpers.0,
            right_stall_bumpers: self.stall_bumpers.1,
            control: 0,
            flags: self.flags.unwrap_or(1 | u16::from(self.sonars) << 1),
            compass: 0,
            readings: if self.sonars { readings } else { Vec::new() },
            tail: vec![0; 5],
        }
    }
}

/// A session, its robot and the line between them.
pub(crate) struct Drive {
    pub session: Session,
    pub robot: Robot,
    pub now_ns: u64,
    pub line_baud: u32,
    /// Whether the port is there.
    pub plugged: bool,
    /// Whether bytes pass.
    pub quiet: bool,
    pub scans: Vec<Checkpoint>,
    pub events: Vec<Event>,
    pub sent: Vec<Vec<u8>>,
    /// Whether what the driver sends comes back at once.
    pub echo: bool,
    /// What a program on the shared port has received.
    pub client_received: Vec<u8>,
    /// Changes what the robot says on its way.
    pub damage: Box<dyn FnMut(Vec<u8>) -> Vec<u8>>,
    opened: bool,
}

impl Drive {
    pub(crate) fn new(robot: Robot) -> Self {
        Self::going_on(robot, None, 1000 * S)
    }

    pub(crate) fn going_on(robot: Robot, checkpoint: Option<Checkpoint>, now_ns: u64) -> Self {
        Self::with(robot, Parameters::default(), checkpoint, now_ns)
    }

    pub(crate) fn with(robot: Robot, parameters: Parameters, checkpoint: Option<Checkpoint>, now_ns: u64) -> Self {
        let session = Session::new(parameters, checkpoint);
        let line_baud = session.baud();
        let mut robot = robot;
        robot.next_sip_ns = robot.next_sip_ns.max(now_ns);
        Self {
            session,
            robot,
            now_ns,
            line_baud,
            plugged: true,
            quiet: false,
            scans: Vec::new(),
            events: Vec::new(),
            sent: Vec::new(),
            echo: false,
            client_received: Vec::new(),
            damage: Box::new(|bytes| bytes),
            opened: false,
        }
    }

    /// Lets time pass in steps of 10 ms.
    pub(crate) fn run(&mut self, for_ns: u64) {
        let end_ns = self.now_ns + for_ns;
        while self.now_ns < end_ns {
            self.now_ns += 10 * MS;
            let said = self.robot.speak(self.now_ns);
            match (self.plugged, self.opened) {
                (true, false) => {
                    self.opened = true;
                    self.line_baud = self.session.baud();
                    self.step(Input::Opened);
                }
                (false, true) => {
                    self.opened = false;
                    self.step(Input::Vanished);
                }
                _ => {}
            }
            if self.opened && !self.quiet && self.line_baud == self.robot.baud {
                let said = (self.damage)(said);
                if !said.is_empty() {
                    self.step(Input::Bytes(&said));
                }
            }
            self.step(Input::Tick);
        }
    }

    pub(crate) fn step(&mut self, input: Input<'_>) {
        if let Input::Bytes(bytes) = input
            && self.session.is_shared()
        {
            self.client_received.extend(bytes);
        }
        for output in self.session.step(input, self.now_ns) {
            match output {
                Output::Send(command) => {
                    self.sent.push(command.packet());
                    if !self.opened || self.quiet {
                        continue;
                    }
                    if self.echo {
                        self.step(Input::Bytes(&command.packet()));
                        continue;
                    }
                    let answer = self.robot.receive(&command.packet(), self.line_baud, self.now_ns);
                    let answer = (self.damage)(answer);
                    if !answer.is_empty() {
                        self.step(Input::Bytes(&answer));
                    }
                }
                Output::Forward(packet) => {
                    if !self.opened || self.quiet {
                        continue;
                    }
                    let answer = self.robot.receive(&packet, self.line_baud, self.now_ns);
                    if !answer.is_empty() {
                        self.step(Input::Bytes(&answer));
                    }
                }
                Output::Baud(baud) => self.line_baud = baud,
                Output::Flush => {}
                Output::Reopen => self.opened = false,
                Output::Publish(saved) => self.scans.push(*saved),
                Output::Event(event) => self.events.push(event),
            }
        }
    }

    /// A program on the shared port sends a command without an argument.
    pub(crate) fn client(&mut self, number: u8) {
        self.step(Input::Client(&[number]));
    }

    /// The packets that this program has received since the last call.
    pub(crate) fn client_packets(&mut self) -> Vec<Vec<u8>> {
        let received = std::mem::take(&mut self.client_received);
        Deframer::new().push(&received).into_iter().map(|frame| frame.data).collect()
    }

    /// Conditions whose beginning was said, each with its words.
    pub(crate) fn conditions(&self) -> Vec<(Condition, &str)> {
        let began = |event| match event {
            &Event::ConditionBegan { condition, ref words } => Some((condition, words.as_str())),
            _ => None,
        };
        self.events.iter().filter_map(began).collect()
    }

    /// Conditions whose end was said.
    pub(crate) fn ended(&self) -> Vec<Condition> {
        let ended = |event: &Event| if let Event::ConditionEnded { condition, .. } = event { Some(*condition) } else { None };
        self.events.iter().filter_map(ended).collect()
    }

    pub(crate) fn pose_x_m(&self) -> f64 {
        self.scans.last().unwrap().scan.pose.x_m
    }

    /// What must hold of every stream of scans: numbers without a hole, stamps that grow, no jump.
    pub(crate) fn check_stream(&self) {
        for pair in self.scans.windows(2) {
            assert_eq!(pair[1].seq, pair[0].seq + 1);
            assert!(pair[1].stamp_ns > pair[0].stamp_ns);
            let moved = (pair[1].scan.pose.x_m - pair[0].scan.pose.x_m).abs();
            let time_s = (pair[1].stamp_ns - pair[0].stamp_ns) as f64 / 1e9;
            assert!(moved <= time_s.max(0.1) + 0.1, "{moved} m in {time_s} s before scan {}", pair[1].seq);
            messages::Payload::validate(&pair[1].scan).unwrap();
        }
    }
}
