//! The robots as data: the factors that turn a packet's numbers into metres and radians, the sonar ring, the dimensions.
//!
//! Figures: parameter files of the robots' own client library (`pion1m.p`, `pionat.p`, `p2dx.p`, `p3dx.p`, `p3dx-sh.p`; `psos43m.p` and
//! `p2d8.p` hold the same figures as `pion1m.p` and `p3dx.p`).

use crate::identity::Identity;

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
    /// As in the settings: `pioneer-1`, `pioneer-at`, `p2-dx`, `p3-dx`, `p3-dx-sh`.
    pub name: &'static str,
    /// Subclasses by which such robots name themselves.
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

const fn mount(x_mm: f64, y_mm: f64, heading_deg: f64) -> Mount {
    Mount { x_mm, y_mm, heading_deg }
}

const PIONEER_1_RING: [Mount; 7] = [
    mount(100.0, 100.0, 90.0),
    mount(120.0, 80.0, 30.0),
    mount(130.0, 40.0, 15.0),
    mount(130.0, 0.0, 0.0),
    mount(130.0, -40.0, -15.0),
    mount(120.0, -80.0, -30.0),
    mount(100.0, -100.0, -90.0),
];

const DX_RING: [Mount; 16] = [
    mount(69.0, 136.0, 90.0),
    mount(114.0, 119.0, 50.0),
    mount(148.0, 78.0, 30.0),
    mount(166.0, 27.0, 10.0),
    mount(166.0, -27.0, -10.0),
    mount(148.0, -78.0, -30.0),
    mount(114.0, -119.0, -50.0),
    mount(69.0, -136.0, -90.0),
    mount(-157.0, -136.0, -90.0),
    mount(-203.0, -119.0, -130.0),
    mount(-237.0, -78.0, -150.0),
    mount(-255.0, -27.0, -170.0),
    mount(-255.0, 27.0, 170.0),
    mount(-237.0, 78.0, 150.0),
    mount(-203.0, 119.0, 130.0),
    mount(-157.0, 136.0, 90.0),
];

const PIONEER_1: Model = Model {
    name: "pioneer-1",
    subclasses: &["psos", "pion1m", "pion1x", "psos1m", "psos1x", "psos43m"],
    system: System::Psos,
    heading_units: 1024,
    distance_mm: 0.05066,
    velocity_mm_s: 2.5332,
    range_mm: 0.1734,
    radius_mm: 220.0,
    width_mm: 400.0,
    length_mm: 500.0,
    ring: &PIONEER_1_RING,
};

const PIONEER_AT: Model = Model { name: "pioneer-at", subclasses: &["pionat"], distance_mm: 0.07, radius_mm: 330.0, ..PIONEER_1 };

const P3_DX: Model = Model {
    name: "p3-dx",
    subclasses: &["p3dx", "p2d8"],
    system: System::P2os,
    heading_units: 4096,
    distance_mm: 0.485,
    velocity_mm_s: 1.0,
    range_mm: 1.0,
    radius_mm: 250.0,
    width_mm: 425.0,
    length_mm: 511.0,
    ring: &DX_RING,
};

const P2_DX: Model = Model { name: "p2-dx", subclasses: &["p2dx"], distance_mm: 0.84, range_mm: 0.268, ..P3_DX };

/// The later P3-DX with an SH-2 controller: the same body, but it counts in millimetres.
const P3_DX_SH: Model = Model { name: "p3-dx-sh", subclasses: &["p3dx-sh"], distance_mm: 1.0, ..P3_DX };

/// The robots that stillmap knows.
pub static MODELS: [Model; 5] = [PIONEER_1, PIONEER_AT, P2_DX, P3_DX, P3_DX_SH];

impl Model {
    /// The model of that name in the settings.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        MODELS.iter().find(|model| model.name == name)
    }

    /// The model of a robot that says who it is; `None` for one that stillmap has no factors for. Letter case is no matter.
    #[must_use]
    pub fn of(identity: &Identity) -> Option<&'static Self> {
        MODELS.iter().find(|model| model.subclasses.iter().any(|known| known.eq_ignore_ascii_case(&identity.subclass)))
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
        check("p3dx-sh", Some("p3-dx-sh"));
    }

    #[test]
    fn an_unknown_robot_has_no_factors() {
        for subclass in ["", "p3at", "p2", "p3dx-", "pioneer"] {
            check(subclass, None);
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
        for model in &MODELS {
            for mount in model.ring {
                let mirrored = Mount { y_mm: -mount.y_mm, heading_deg: -mount.heading_deg, ..*mount };
                assert!(model.ring.contains(&mirrored), "{} {mount:?}", model.name);
            }
        }
    }
}
