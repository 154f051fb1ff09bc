//! The drive: a status packet every 100 ms with the readings that are new, and the truth behind it.

use messages::{EchoLabel, MAX_READINGS, MAX_SURFACES_PER_CHUNK, Pose, Surface, TrueReading, TruthScan, TruthSurfaces, seconds};

use crate::body::Body;
use crate::chance::{self, PingChance};
use crate::journey::Journey;
use crate::odometry::Odometry;
use crate::sonar::{Acoustics, Echo, Leg, Source};
use crate::still::Still;
use crate::walker::Walker;
use crate::world::{MAX_WALKERS, World};

/// Time from one status packet to the next.
pub const PACKET_INTERVAL_NS: u64 = 100_000_000;

/// Time from one ping to the next: a Pioneer fires 25 sonars a second, in turn.
pub const PING_INTERVAL_NS: u64 = 40_000_000;

/// A reading that is new in a packet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// The sonar's number, from 0.
    pub sonar: u8,
    /// Range as the robot's units tell it, m; the sonars' limit when nothing came back.
    pub range_m: f64,
}

/// What the robot knows when a packet is due.
#[derive(Debug, Clone, PartialEq)]
pub struct Packet {
    /// From 1.
    pub number: u64,
    /// Since the start of the drive.
    pub stamp_ns: u64,
    /// By odometry, in the frame of the start. The yaw counts whole turns.
    pub odometry: Pose,
    /// Forward.
    pub speed_m_s: f64,
    /// Counter-clockwise.
    pub turn_rad_s: f64,
    /// In the order in which the sonars fired.
    pub readings: Vec<Reading>,
}

/// A robot on its way through a world. The same world, robot and seed give the same packets.
#[derive(Debug, Clone)]
pub struct Simulation {
    world: World,
    body: Body,
    seed: u64,
    still: Still,
    walkers: Vec<Walker>,
    acoustics: Acoustics,
    journey: Journey,
    start: Pose,
    odometry: Odometry,
    /// Packets made so far.
    packets: u64,
}

impl Simulation {
    /// At the start of the drive.
    #[must_use]
    pub fn new(world: &World, body: &Body, seed: u64) -> Self {
        let journey = Journey::of_robot(&world.robot);
        let start = journey.at(0.0).pose;
        Self {
            still: Still::of(world),
            walkers: world.walkers.iter().take(MAX_WALKERS).map(Walker::new).collect(),
            acoustics: Acoustics::new(&world.sonar, &world.surfaces),
            journey,
            odometry: Odometry::new(world.odometry, start),
            world: world.clone(),
            body: body.clone(),
            seed,
            start,
            packets: 0,
        }
    }

    /// Packets made so far.
    #[must_use]
    pub fn packets(&self) -> u64 {
        self.packets
    }

    /// Packets of the whole drive.
    #[must_use]
    pub fn total_packets(&self) -> u64 {
        (self.journey.end_s() * 1e9 / PACKET_INTERVAL_NS as f64).ceil() as u64
    }

    /// Whether the robot has come to the end of its way.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.packets >= self.total_packets()
    }

    /// The odometry of the last packet, in the frame of the start.
    #[must_use]
    pub fn odometry(&self) -> Pose {
        self.odometry.counted()
    }

    /// Takes the drive up after `packets` packets, as if they had been made.
    pub fn advance_to(&mut self, packets: u64) {
        while self.packets < packets.min(self.total_packets()) {
            self.step();
        }
    }

    /// The next packet and the truth behind it; `None` at the end of the way.
    pub fn next_packet(&mut self) -> Option<(Packet, TruthScan)> {
        if self.is_over() {
            return None;
        }
        let pings =
            (self.packets * PACKET_INTERVAL_NS / PING_INTERVAL_NS + 1)..=((self.packets + 1) * PACKET_INTERVAL_NS / PING_INTERVAL_NS);
        let odometry = self.step();
        let stamp_ns = self.packets * PACKET_INTERVAL_NS;
        let moment = self.journey.at(seconds(stamp_ns));
        let truths: Vec<TrueReading> = pings.filter_map(|ping| self.ping(ping)).take(MAX_READINGS).collect();
        let readings = truths.iter().map(|truth| Reading { sonar: truth.sonar as u8, range_m: truth.range_m }).collect();
        let packet =
            Packet { number: self.packets, stamp_ns, odometry, speed_m_s: moment.speed_m_s, turn_rad_s: moment.turn_rad_s, readings };
        Some((packet, self.truth(stamp_ns, moment.pose, odometry, &truths)))
    }

    /// Every surface that stands still, and where the robot starts.
    #[must_use]
    pub fn surfaces(&self) -> Vec<TruthSurfaces> {
        let surfaces: Vec<Surface> =
            self.still.pieces().map(|piece| Surface { from_m: piece.from.into(), to_m: piece.to.into() }).collect();
        let chunks = surfaces.chunks(MAX_SURFACES_PER_CHUNK).enumerate().map(|(index, chunk)| {
            let mut message = TruthSurfaces {
                start: self.start,
                first: (index * MAX_SURFACES_PER_CHUNK) as u32,
                total: surfaces.len() as u32,
                count: chunk.len() as u32,
                ..TruthSurfaces::default()
            };
            message.surfaces[..chunk.len()].copy_from_slice(chunk);
            message
        });
        chunks.collect()
    }

    /// Time advances to the next packet, and the odometry with it.
    fn step(&mut self) -> Pose {
        self.packets += 1;
        let now = self.journey.at(seconds(self.packets * PACKET_INTERVAL_NS)).pose;
        self.odometry.step(now, &mut chance::of_step(self.seed, self.packets))
    }

    /// One sonar's ping, by its number from 1; `None` for a robot without sonars.
    fn ping(&self, ping: u64) -> Option<TrueReading> {
        let index = (ping - 1).checked_rem(self.body.ring().len() as u64)? as usize;
        let mount = self.body.ring().get(index)?;
        let time_s = seconds(ping * PING_INTERVAL_NS);
        let sonar = self.journey.at(time_s).pose.then(mount);
        let chance = PingChance::of(self.seed, ping);
        let mirrored = chance.mirrored < self.world.sonar.mirrored.get();
        let echo = self.acoustics.first_echo(&self.still, &self.legs(time_s), &sonar, mirrored);
        Some(self.reading(index as u32, echo, &chance))
    }

    /// What the sonar reports of an echo, and what it came from.
    fn reading(&self, sonar: u32, echo: Option<Echo>, chance: &PingChance) -> TrueReading {
        let rules = &self.world.sonar;
        let limit_m = rules.limit_m.get();
        let nearest = echo.filter(|_| chance.missed >= rules.missed.get()).map(|echo| {
            let spread_m = rules.noise_m.get() + rules.noise_share.get() * echo.range_m;
            let (label, walker) = match echo.source {
                Source::Still => (EchoLabel::Still, 0),
                Source::Walker(walker) => (EchoLabel::Walker, walker),
                Source::Mirrored(walker) => (EchoLabel::Ghost, walker.unwrap_or(0)),
            };
            ((echo.range_m + spread_m * chance.noise).max(rules.blind_m.get()), label, walker)
        });
        let crosstalk_m = rules.blind_m.get() + chance.crosstalk_range * (limit_m - rules.blind_m.get());
        let (range_m, label, walker) = match nearest {
            Some((range_m, ..)) if chance.crosstalk < rules.crosstalk.get() && crosstalk_m < range_m => {
                (crosstalk_m, EchoLabel::Crosstalk, 0)
            }
            None if chance.crosstalk < rules.crosstalk.get() => (crosstalk_m, EchoLabel::Crosstalk, 0),
            Some(reading) if reading.0 < limit_m => reading,
            _ => (limit_m, EchoLabel::NoEcho, 0),
        };
        TrueReading { range_m: self.body.in_units(range_m), sonar, label: label as u32, walker, reserved: 0 }
    }

    fn legs(&self, time_s: f64) -> Vec<Leg> {
        let numbered = (1..).zip(&self.walkers);
        numbered
            .filter_map(|(number, walker)| Some((number, walker.legs(time_s)?)))
            .flat_map(|(walker, legs)| legs.map(|circle| Leg { circle, walker }))
            .collect()
    }

    fn truth(&self, stamp_ns: u64, pose: Pose, odometry: Pose, readings: &[TrueReading]) -> TruthScan {
        let mut truth =
            TruthScan { pose, odometry, count: readings.len() as u32, walkers_count: self.walkers.len() as u32, ..TruthScan::default() };
        truth.readings[..readings.len()].copy_from_slice(readings);
        for (place, walker) in truth.walkers_m.iter_mut().zip(&self.walkers) {
            *place = walker.place(seconds(stamp_ns)).into();
        }
        truth
    }
}
