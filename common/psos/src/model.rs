//! What is known of a type of robot: the factors that turn a packet's numbers into metres and radians, the sonar ring, the dimensions.

/// Where one sonar sits and looks, in the robot frame (x forward, y left, counter-clockwise).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mount {
    /// Forward of the centre of rotation, mm.
    pub x_mm: f64,
    /// Left of it, mm.
    pub y_mm: f64,
    /// Direction of the beam, degrees.
    pub heading_deg: f64,
}

/// Which operating system answers: it decides which commands there are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum System {
    /// Pioneer 1 and AT: no ENABLE, CONFIG, SONAR, STOP.
    Psos,
    /// P2OS, AROS, ARCOS: they have them, and say in the flags whether the sonars fire.
    P2os,
}

/// What stillmap knows of a kind of robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// Its own name in the settings: `pioneer-1`, `p3-dx`, `p3-at` …
    pub name: &'static str,
    /// Its other names: subclasses by which such robots name themselves, the most usual first.
    pub subclasses: &'static [&'static str],
    /// What answers.
    pub system: System,
    /// Units of a full turn of the heading.
    pub heading_units: u16,
    /// mm per unit of x and y.
    pub distance_mm: f64,
    /// mm/s per unit of the wheel velocities.
    pub velocity_mm_s: f64,
    /// mm per unit of a sonar range.
    pub range_mm: f64,
    /// Radius of the circle that the robot turns in, mm.
    pub radius_mm: f64,
    /// Width, mm.
    pub width_mm: f64,
    /// Length, mm.
    pub length_mm: f64,
    /// The sonars, in the order of their numbers.
    pub ring: &'static [Mount],
}

pub(crate) const fn mount(x_mm: f64, y_mm: f64, heading_deg: f64) -> Mount {
    Mount { x_mm, y_mm, heading_deg }
}

impl Mount {
    /// Whether no sonar sits here: some rings leave numbers out.
    #[must_use]
    pub fn is_absent(&self) -> bool {
        (self.x_mm, self.y_mm, self.heading_deg) == (0.0, 0.0, -180.0)
    }
}

impl Model {
    /// All of its names, its own first.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        [self.name].into_iter().chain(self.subclasses.iter().copied())
    }

    /// The subclass by which such a robot names itself.
    #[must_use]
    pub fn subclass(&self) -> &'static str {
        self.subclasses.first().unwrap_or(&self.name)
    }

    /// Radians per unit of the heading.
    #[must_use]
    pub fn heading_rad(&self) -> f64 {
        std::f64::consts::TAU / f64::from(self.heading_units)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MODELS;
    use crate::identity::Identity;

    #[track_caller]
    fn check(subclass: &str, expect: Option<&str>) {
        let identity = Identity { name: "any".into(), class: "Pioneer".into(), subclass: subclass.into() };
        assert_eq!(Model::of(&identity).map(|model| model.name), expect);
    }

    #[test]
    fn robots_are_known_by_their_subclass() {
        for subclass in ["psos", "pion1m", "pion1x", "PION1X"] {
            check(subclass, Some("pioneer-1"));
        }
        check("pionat", Some("pioneer-at"));
        check("p2dx", Some("p2-dx"));
        check("p3dx", Some("p3-dx"));
        for (subclass, name) in [
            ("p3dx-sh-lms1xx", "p3-dx-sh"),
            ("p2d8+", "p3-dx"),
            ("p3at", "p3-at"),
            ("P2AT", "p2-at"),
            ("amigo", "amigobot"),
            ("perfpb", "peoplebot"),
            ("patrolbot-sh", "patrolbot"),
            ("powerbot", "powerbot"),
            ("seekurjr", "seekurjr"),
        ] {
            check(subclass, Some(name));
        }
    }

    #[test]
    fn an_unknown_robot_has_no_factors() {
        for subclass in ["", "p4", "p2", "p3dx-", "pioneer"] {
            check(subclass, None);
        }
    }

    #[test]
    fn every_public_type_is_known_and_no_name_is_given_twice() {
        let names: Vec<_> = MODELS.iter().flat_map(Model::names).collect();
        let mut single: Vec<_> = names.iter().map(|name| name.to_ascii_lowercase()).collect();
        single.sort();
        single.dedup();
        assert_eq!(single.len(), names.len(), "{names:?}");
        assert!(names.len() >= 49, "{}", names.len());
        for model in &MODELS {
            assert!(model.ring.len() <= 32 && model.distance_mm > 0.0 && model.range_mm > 0.0, "{}", model.name);
        }
    }

    #[test]
    fn factors_are_those_of_the_manuals() {
        let pioneer = Model::named("pioneer-1").unwrap();
        assert!((pioneer.heading_rad() - 0.006_135_9).abs() < 1e-6);
        assert!((10784.0 * pioneer.range_mm - 1870.0).abs() < 0.1, "2000 mm less the sonar's own 130");
        assert!((Model::named("p3-dx").unwrap().heading_rad() - 0.001_534).abs() < 1e-6);
        assert_eq!(Model::named("p4"), None);
    }

    #[test]
    fn rings_are_mirrored_left_to_right() {
        // The published ring of the AmigoBot with an SH-2 controller is not symmetrical by 5 mm.
        for model in MODELS.iter().filter(|model| model.name != "amigobot-sh") {
            for mount in model.ring.iter().filter(|mount| !mount.is_absent()) {
                let mirrored = Mount { y_mm: -mount.y_mm, heading_deg: -mount.heading_deg, ..*mount };
                assert!(model.ring.contains(&mirrored), "{} {mount:?}", model.name);
            }
        }
    }
}
