//! Angles.

/// The same angle between −π and π, rad.
#[must_use]
pub fn wrapped(angle_rad: f64) -> f64 {
    angle_rad.sin().atan2(angle_rad.cos())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn whole_turns_are_taken_off() {
        for (angle_rad, expected) in [(0.5, 0.5), (1.5 * PI, -0.5 * PI), (-7.0 * PI / 3.0, -PI / 3.0), (40.0 * PI + 1.0, 1.0)] {
            assert!((wrapped(angle_rad) - expected).abs() < 1e-12, "{angle_rad}");
        }
    }
}
