//! The robot as the world needs it: where its sonars sit, and in which units it speaks.

use messages::{MAX_READINGS, Pose};
use psos::Model;

/// A robot of a model, with the model's sonar ring or one of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    model: &'static Model,
    ring: Vec<Pose>,
}

impl Body {
    /// A robot as its model has it.
    #[must_use]
    pub fn of(model: &'static Model) -> Self {
        let ring = model.ring.iter().map(|mount| Pose {
            x_m: mount.x_mm / 1000.0,
            y_m: mount.y_mm / 1000.0,
            yaw_rad: mount.heading_deg.to_radians(),
        });
        Self { model, ring: ring.collect() }
    }

    /// The same robot with its sonars mounted elsewhere, in the order of their numbers; at most 16 are used.
    #[must_use]
    pub fn with_ring(mut self, mounts: &[Pose]) -> Self {
        self.ring = mounts.iter().copied().take(MAX_READINGS).collect();
        self
    }

    /// Its model.
    #[must_use]
    pub fn model(&self) -> &'static Model {
        self.model
    }

    /// Where its sonars sit and look, in the robot frame, in the order in which they fire.
    #[must_use]
    pub fn ring(&self) -> &[Pose] {
        &self.ring
    }

    /// A range rounded to the robot's units, m.
    #[must_use]
    pub fn in_units(&self, range_m: f64) -> f64 {
        f64::from(self.range_units(range_m)) * self.model.range_mm / 1000.0
    }

    /// A range in the robot's units; what a packet cannot hold reads as the most it can.
    #[must_use]
    pub fn range_units(&self, range_m: f64) -> u16 {
        (range_m * 1000.0 / self.model.range_mm).round() as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_rounded_to_the_robots_units() {
        let body = Body::of(&psos::MODELS[0]);
        assert_eq!(body.range_units(1.87), 10784);
        assert!((body.in_units(1.87) - 10784.0 * 0.000_173_4).abs() < 1e-12);
        assert_eq!(body.range_units(99.0), u16::MAX);
    }
}
