//! What the driver can be set to, in the units that it computes with.

use messages::Pose;
use psos::{MODELS, Model, Mount};

const NS_PER_S: f64 = 1e9;

/// The driver's parameters. Times are in deployment time.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    /// The model that the settings name: used for a robot that does not say what it is.
    pub model: &'static Model,
    /// The factors of the settings, which hold instead of the model's.
    pub factors: Factors,
    /// The sonar ring of the settings, if they have one; otherwise the model's is used.
    pub ring: Option<Vec<Pose>>,
    /// A reading at or above this range is no echo, m.
    pub range_limit_m: f64,
    /// The number at which the odometry's counters start again from 0.
    pub odometry_modulus: u32,
    /// Baud rates to try, in this order.
    pub bauds: Vec<u32>,
    /// Time between two PULSEs, ns.
    pub pulse_ns: u64,
    /// Time to wait for each echo of the handshake, ns.
    pub echo_ns: u64,
    /// Time that a robot is given to close, ns.
    pub closing_ns: u64,
    /// Time without a packet after which the link is lost, ns.
    pub link_lost_ns: u64,
    /// Greatest speed that odometry is believed, m/s.
    pub speed_limit_m_s: f64,
    /// Greatest turn rate that odometry is believed, rad/s.
    pub turn_limit_rad_s: f64,
}

/// Factors that hold instead of those of a robot's model.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Factors {
    /// mm per unit of x and y.
    pub distance_mm: Option<f64>,
    /// mm per unit of a sonar range.
    pub range_mm: Option<f64>,
    /// Units of a full turn of the heading.
    pub heading_units: Option<u16>,
}

/// In a simulation that runs fast, the other program needs its time on the wall to answer all the same.
const LEAST_ANSWER_WALL_S: f64 = 0.25;

/// A busy machine that stalls both programs for this long on the wall has lost no link.
const LEAST_LINK_LOST_WALL_S: f64 = 2.0;

impl Default for Parameters {
    /// A Pioneer 1 on a line of unknown speed.
    fn default() -> Self {
        Self {
            model: &MODELS[0],
            factors: Factors::default(),
            ring: None,
            range_limit_m: 3.0,
            odometry_modulus: 1 << 15,
            bauds: vec![9600, 38400, 19200, 115_200, 57600],
            pulse_ns: 500_000_000,
            echo_ns: 1_000_000_000,
            closing_ns: 400_000_000,
            link_lost_ns: 8_000_000_000,
            speed_limit_m_s: 1.0,
            turn_limit_rad_s: 3.0,
        }
    }
}

impl Parameters {
    /// The parameters for a deployment that runs `speed` times faster than the wall clock.
    #[must_use]
    pub fn at_speed(self, speed: f64) -> Self {
        let answer_ns = nanoseconds(LEAST_ANSWER_WALL_S * speed);
        Self {
            echo_ns: self.echo_ns.max(answer_ns),
            closing_ns: self.closing_ns.max(answer_ns),
            link_lost_ns: self.link_lost_ns.max(nanoseconds(LEAST_LINK_LOST_WALL_S * speed)),
            ..self
        }
    }

    /// The sonar ring to use with a robot of this model.
    #[must_use]
    pub fn ring_of(&self, model: &Model) -> Vec<Pose> {
        self.ring.clone().unwrap_or_else(|| ring(model))
    }
}

/// The sonar ring of a model in the robot frame, in the order of the sonars' numbers.
fn ring(model: &Model) -> Vec<Pose> {
    let pose = |mount: &Mount| Pose { x_m: mount.x_mm / 1e3, y_m: mount.y_mm / 1e3, yaw_rad: mount.heading_deg.to_radians() };
    model.ring.iter().map(pose).collect()
}

fn nanoseconds(seconds: f64) -> u64 {
    (seconds * NS_PER_S) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fast_simulation_leaves_the_other_program_its_time() {
        let at = |speed| Parameters::default().at_speed(speed);
        assert_eq!((at(1.0).echo_ns, at(1.0).link_lost_ns), (1_000_000_000, 8_000_000_000));
        assert_eq!((at(20.0).echo_ns, at(20.0).link_lost_ns), (5_000_000_000, 40_000_000_000));
    }
}
