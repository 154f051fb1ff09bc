//! What the settings mean to the driver, in the units it computes with.

use messages::{MAX_READINGS, Pose};
use psos::{Model, Mount};

const NS_PER_S: f64 = 1e9;

/// The driver's parameters. Times are in deployment time.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    /// The model that the settings name: used for a robot that does not say what it is.
    pub model: &'static Model,
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

/// Time for an echo at the pace of the wall clock.
const ECHO_S: f64 = 1.0;

/// Time for a robot to close at the pace of the wall clock.
const CLOSING_S: f64 = 0.4;

/// In a simulation that runs fast, the other program needs its time on the wall to answer all the same.
const LEAST_ANSWER_WALL_S: f64 = 0.25;

/// A busy machine that stalls both programs for this long on the wall has lost no link.
const LEAST_LINK_LOST_WALL_S: f64 = 2.0;

impl Parameters {
    /// The parameters that the settings say, for a deployment that runs `speed` times faster than the wall clock.
    #[must_use]
    pub fn new(robot: &settings::Robot, pioneer: &settings::Pioneer, speed: f64) -> Self {
        let ring: Vec<_> = robot.sonar.iter().take(MAX_READINGS).map(pose_of_setting).collect();
        Self {
            model: model(robot.model),
            ring: (!ring.is_empty()).then_some(ring),
            range_limit_m: robot.range_limit_m.get(),
            odometry_modulus: robot.odometry_modulus.get(),
            bauds: pioneer.bauds.iter().map(|baud| baud.get()).collect(),
            pulse_ns: nanoseconds(pioneer.pulse_s.get()),
            echo_ns: nanoseconds(ECHO_S.max(LEAST_ANSWER_WALL_S * speed)),
            closing_ns: nanoseconds(CLOSING_S.max(LEAST_ANSWER_WALL_S * speed)),
            link_lost_ns: nanoseconds(pioneer.link_lost_s.get().max(LEAST_LINK_LOST_WALL_S * speed)),
            speed_limit_m_s: pioneer.speed_limit_m_s.get(),
            turn_limit_rad_s: pioneer.turn_limit_rad_s.get(),
        }
    }

    /// The sonar ring to use with a robot of this model.
    #[must_use]
    pub fn ring_of(&self, model: &Model) -> Vec<Pose> {
        self.ring.clone().unwrap_or_else(|| model.ring.iter().map(pose_of_mount).collect())
    }
}

fn model(setting: settings::Model) -> &'static Model {
    let name = match setting {
        settings::Model::Pioneer1 => "pioneer-1",
        settings::Model::PioneerAt => "pioneer-at",
        settings::Model::P2Dx => "p2-dx",
        settings::Model::P3Dx => "p3-dx",
    };
    Model::named(name).unwrap_or(&psos::MODELS[0])
}

fn pose_of_setting(sonar: &settings::Sonar) -> Pose {
    Pose { x_m: sonar.x_m.get(), y_m: sonar.y_m.get(), yaw_rad: sonar.heading_deg.get().to_radians() }
}

fn pose_of_mount(mount: &Mount) -> Pose {
    Pose { x_m: mount.x_mm / 1e3, y_m: mount.y_mm / 1e3, yaw_rad: mount.heading_deg.to_radians() }
}

fn nanoseconds(seconds: f64) -> u64 {
    (seconds * NS_PER_S) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_model_of_the_settings_is_known() {
        for (setting, name) in [
            (settings::Model::Pioneer1, "pioneer-1"),
            (settings::Model::PioneerAt, "pioneer-at"),
            (settings::Model::P2Dx, "p2-dx"),
            (settings::Model::P3Dx, "p3-dx"),
        ] {
            assert_eq!(model(setting).name, name);
        }
    }

    #[test]
    fn a_fast_simulation_leaves_the_other_program_its_time() {
        let at = |speed| Parameters::new(&settings::Robot::default(), &settings::Pioneer::default(), speed);
        assert_eq!((at(1.0).echo_ns, at(1.0).link_lost_ns), (1_000_000_000, 8_000_000_000));
        assert_eq!((at(20.0).echo_ns, at(20.0).link_lost_ns), (5_000_000_000, 40_000_000_000));
    }
}
