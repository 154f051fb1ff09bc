//! From status packets to scans: factors, odometry, plausibility.

use messages::{AFTER_DOUBT, AFTER_LOSS, MAX_READINGS, Pose, SonarScan};
use psos::{Model, Sip};

use crate::odometry::{Counters, Odometry, Scale, Step, Track};
use crate::parameters::Parameters;
use crate::readings::readings;

/// What was found wrong inside packets whose checksum agrees.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Refusals {
    /// Status packets that announce more than they hold.
    pub packets: u64,
    /// Packets whose odometry claims a motion beyond the limits; their readings are lost with them.
    pub odometry: u64,
    /// Readings that no sonar of this robot can have made.
    pub readings: u64,
    /// Readings replaced by a later one of the same sonar in the same packet.
    pub repeated: u64,
}

/// Why a pose may be off against those before it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Doubt {
    /// After a silence the counters may have wrapped around more than once.
    Wraps {
        /// The silence, s.
        elapsed_s: f64,
        /// Distance in which the counters wrap around, m.
        wrap_m: f64,
        /// How far the robot may have gone, m.
        reach_m: f64,
    },
    /// The counters have started anew while the robot was not connected: the pose stays.
    Restarted {
        /// Time without the robot, s.
        elapsed_s: f64,
    },
}

/// How long a robot that stood when a client closed it is taken to have stood, s: a client's handshake takes about two seconds, and a
/// closed robot has no power on its motors.
const STANDS_FOR_S: f64 = 6.0;

/// Makes scans of the status packets of one robot.
#[derive(Debug, Clone)]
pub struct Scanner {
    parameters: Parameters,
    model: &'static Model,
    ring: Vec<Pose>,
    odometry: Odometry,
    /// What was lost since the last scan, as [`SonarScan::after_gap`].
    gap: u32,
    /// Why the pose of the last scan is doubtful, until it is asked for.
    doubt: Option<Doubt>,
    /// The counters are about to start anew, of a robot that stands.
    restarts_standing: bool,
    /// What the last packet had more than a scan holds.
    rest: Vec<SonarScan>,
    refusals: Refusals,
}

impl Scanner {
    /// A scanner for a robot of this model that continues from `track`.
    #[must_use]
    pub fn new(parameters: &Parameters, model: &'static Model, track: Track) -> Self {
        Self {
            odometry: Odometry::new(scale(parameters, model), track),
            ring: parameters.ring_of(model),
            parameters: parameters.clone(),
            model,
            gap: 0,
            doubt: None,
            restarts_standing: false,
            rest: Vec::new(),
            refusals: Refusals::default(),
        }
    }

    /// The model whose factors are in use.
    #[must_use]
    pub fn model(&self) -> &'static Model {
        self.model
    }

    /// Takes the factors of another model. The pose stays.
    pub fn set_model(&mut self, model: &'static Model) {
        if model != self.model {
            self.model = model;
            self.ring = self.parameters.ring_of(model);
            self.odometry.rescale(scale(&self.parameters, model));
        }
    }

    /// Says that something was lost: the next scan is marked.
    pub fn mark_gap(&mut self) {
        self.gap = self.gap.max(AFTER_LOSS);
    }

    /// Says that more time has passed than stamps tell: the clock stood still meanwhile.
    pub fn add_unseen(&mut self, time_ns: u64) {
        self.odometry.add_unseen(time_ns);
    }

    /// Further scans of the last packet, of the same pose: a ring may have more sonars than a scan holds readings.
    pub fn take_rest(&mut self) -> Vec<SonarScan> {
        std::mem::take(&mut self.rest)
    }

    /// Why the pose of the last scan is doubtful, if it is; said once.
    pub fn take_doubt(&mut self) -> Option<Doubt> {
        self.doubt.take()
    }

    /// Counts a status packet that cannot be read.
    pub fn refuse_packet(&mut self) {
        self.refusals.packets += 1;
        self.mark_gap();
    }

    /// Says that the link was down: the robot's counters may start anew. The pose continues from where it was.
    pub fn link_was_down(&mut self) {
        if self.odometry.track().stamp_ns > 0 {
            self.mark_gap();
        }
        self.odometry.lift();
    }

    /// Tells that a client makes the counters start anew, and whether the robot stands meanwhile.
    pub fn expect_restart(&mut self, stands: bool) {
        self.restarts_standing = stands;
    }

    /// Where counters have just been set to zero, the pose continues from where it is: true when those of this packet are that low.
    /// The odometry alone would take a jump of a few centimetres for motion.
    pub fn restart_at_zero(&mut self, sip: &Sip) -> bool {
        let is_zero = self.odometry.is_near_zero(Counters { x: sip.x, y: sip.y, heading: sip.heading });
        if is_zero {
            self.restarts_standing = true;
            self.link_was_down();
        }
        is_zero
    }

    /// Where the robot is, for a later process.
    #[must_use]
    pub fn track(&self) -> Track {
        self.odometry.track()
    }

    /// What was refused so far.
    #[must_use]
    pub fn refusals(&self) -> Refusals {
        self.refusals
    }

    /// The scan of a status packet.
    ///
    /// # Errors
    /// The step, when the packet's odometry claims a motion beyond the limits. The next scan is marked then.
    pub fn scan(&mut self, sip: &Sip, stamp_ns: u64) -> Result<SonarScan, Step> {
        let counters = Counters { x: sip.x, y: sip.y, heading: sip.heading };
        let before = self.odometry.track();
        match self.odometry.step(counters, stamp_ns) {
            Step::Taken => {}
            Step::Guessed { wrap_m, reach_m, elapsed_s } => self.doubt(Doubt::Wraps { elapsed_s, wrap_m, reach_m }),
            // The first counters ever.
            Step::Anchored if before.stamp_ns == 0 => {}
            // They have started anew under way: two packets are missing, and no more.
            Step::Anchored if before.anchored == 1 => self.mark_gap(),
            Step::Anchored => {
                let elapsed_s = stamp_ns.saturating_sub(before.stamp_ns) as f64 / 1e9;
                let stood = std::mem::take(&mut self.restarts_standing) && elapsed_s <= STANDS_FOR_S;
                if stood { self.mark_gap() } else { self.doubt(Doubt::Restarted { elapsed_s }) }
            }
            refused @ Step::Refused { .. } => {
                self.refusals.odometry += 1;
                self.mark_gap();
                return Err(refused);
            }
        }
        let range_m = self.parameters.factors.range_mm.unwrap_or(self.model.range_mm) / 1e3;
        let readings = readings(&sip.readings, &self.ring, range_m, self.parameters.range_limit_m);
        self.refusals.readings += readings.refused;
        self.refusals.repeated += readings.repeated;
        let mut scans = readings.good.chunks(MAX_READINGS).map(|part| SonarScan::new(self.odometry.pose(), part, false));
        let scan = scans.next().unwrap_or_else(|| SonarScan::new(self.odometry.pose(), &[], false));
        self.rest = scans.collect();
        Ok(SonarScan { after_gap: std::mem::take(&mut self.gap), ..scan })
    }

    fn doubt(&mut self, doubt: Doubt) {
        self.gap = AFTER_DOUBT;
        self.doubt = Some(doubt);
    }
}

fn scale(parameters: &Parameters, model: &Model) -> Scale {
    Scale {
        modulus: parameters.odometry_modulus,
        heading_units: parameters.factors.heading_units.unwrap_or(model.heading_units),
        distance_m: parameters.factors.distance_mm.unwrap_or(model.distance_mm) / 1e3,
        speed_limit_m_s: parameters.speed_limit_m_s,
        turn_limit_rad_s: parameters.turn_limit_rad_s,
    }
}
