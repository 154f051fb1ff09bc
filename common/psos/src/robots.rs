//! The robots, one line each, and their sonar rings: the one list of what is known of each type.
//!
//! Figures: the public parameter files of the robots' own client library (`params/*.p` of ARIA 2.9 and AriaCoda), all 49 types. Types
//! whose figures are all equal share a line.

use crate::identity::Identity;
use crate::model::{Model, Mount, System, mount};

/// What turns a packet's numbers into lengths.
struct Factors {
    distance_mm: f64,
    velocity_mm_s: f64,
    range_mm: f64,
}

/// A robot: name, the names by which it calls itself or people call it, what answers, factors, radius, width and length (mm), ring.
const fn robot(
    name: &'static str,
    subclasses: &'static [&'static str],
    system: System,
    factors: Factors,
    [radius_mm, width_mm, length_mm]: [f64; 3],
    ring: &'static [Mount],
) -> Model {
    let Factors { distance_mm, velocity_mm_s, range_mm } = factors;
    let heading_units = match system {
        System::Psos => 1024,
        System::P2os => 4096,
    };
    Model { name, subclasses, system, heading_units, distance_mm, velocity_mm_s, range_mm, radius_mm, width_mm, length_mm, ring }
}

/// A number that no sonar has.
const NONE: Mount = mount(0.0, 0.0, -180.0);

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

const AT_RING: [Mount; 16] = [
    mount(147.0, 136.0, 90.0),
    mount(193.0, 119.0, 50.0),
    mount(227.0, 79.0, 30.0),
    mount(245.0, 27.0, 10.0),
    mount(245.0, -27.0, -10.0),
    mount(227.0, -79.0, -30.0),
    mount(193.0, -119.0, -50.0),
    mount(147.0, -136.0, -90.0),
    mount(-144.0, -136.0, -90.0),
    mount(-189.0, -119.0, -130.0),
    mount(-223.0, -79.0, -150.0),
    mount(-241.0, -27.0, -170.0),
    mount(-241.0, 27.0, 170.0),
    mount(-223.0, 79.0, 150.0),
    mount(-189.0, 119.0, 130.0),
    mount(-144.0, 136.0, 90.0),
];

const AMIGO_RING: [Mount; 8] = [
    mount(76.0, 100.0, 90.0),
    mount(125.0, 75.0, 41.0),
    mount(150.0, 30.0, 15.0),
    mount(150.0, -30.0, -15.0),
    mount(125.0, -75.0, -41.0),
    mount(76.0, -100.0, -90.0),
    mount(-140.0, -58.0, -145.0),
    mount(-140.0, 58.0, 145.0),
];

const AMIGO_SH_RING: [Mount; 8] = [
    mount(70.0, 100.0, 90.0),
    mount(125.0, 75.0, 41.0),
    mount(144.0, 30.0, 15.0),
    mount(144.0, -30.0, -15.0),
    mount(120.0, -75.0, -41.0),
    mount(70.0, -100.0, -90.0),
    mount(-146.0, -58.0, -145.0),
    mount(-146.0, 58.0, 145.0),
];

const PATROLBOT_RING: [Mount; 16] = [
    mount(83.0, 229.0, 90.0),
    mount(169.0, 202.0, 55.0),
    mount(232.0, 134.0, 30.0),
    mount(263.0, 46.0, 10.0),
    mount(263.0, -46.0, -10.0),
    mount(232.0, -134.0, -30.0),
    mount(169.0, -202.0, -55.0),
    mount(83.0, -229.0, -90.0),
    mount(-83.0, -229.0, -90.0),
    mount(-169.0, -202.0, -125.0),
    mount(-232.0, -134.0, -150.0),
    mount(-263.0, -46.0, -170.0),
    mount(-263.0, 46.0, 170.0),
    mount(-232.0, 134.0, 150.0),
    mount(-169.0, 202.0, 125.0),
    mount(-83.0, 229.0, 90.0),
];

const MTX_RING: [Mount; 8] = [
    mount(324.0, 90.0, 16.0),
    mount(331.0, 607.0, 10.0),
    mount(331.0, -607.0, -10.0),
    mount(324.0, -90.0, -16.0),
    mount(-316.0, -90.0, -164.0),
    mount(-325.0, -30.0, -175.0),
    mount(-325.0, 30.0, 175.0),
    mount(-316.0, 90.0, 164.0),
];

const P2_PEOPLEBOT_RING: [Mount; 24] = [
    mount(69.0, 136.0, 90.0),
    mount(114.0, 119.0, 50.0),
    mount(148.0, 78.0, 30.0),
    mount(166.0, 27.0, 10.0),
    mount(166.0, -27.0, -10.0),
    mount(148.0, -78.0, -30.0),
    mount(114.0, -119.0, -50.0),
    mount(69.0, -136.0, -90.0),
    mount(-20.0, 136.0, 90.0),
    mount(24.0, 119.0, 50.0),
    mount(58.0, 78.0, 30.0),
    mount(77.0, 27.0, 10.0),
    mount(77.0, -27.0, -10.0),
    mount(58.0, -78.0, -30.0),
    mount(24.0, -119.0, -50.0),
    mount(-20.0, -136.0, -90.0),
    mount(-157.0, -136.0, -90.0),
    mount(-203.0, -119.0, -130.0),
    mount(-237.0, -78.0, -150.0),
    mount(-255.0, -27.0, -170.0),
    mount(-255.0, 27.0, 170.0),
    mount(-237.0, 78.0, 150.0),
    mount(-203.0, 119.0, 130.0),
    mount(-157.0, 136.0, 90.0),
];

const PEOPLEBOT_SH_RING: [Mount; 32] = [
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
    mount(-20.0, 136.0, 90.0),
    mount(24.0, 119.0, 50.0),
    mount(58.0, 78.0, 30.0),
    mount(77.0, 27.0, 10.0),
    mount(77.0, -27.0, -10.0),
    mount(58.0, -78.0, -30.0),
    mount(24.0, -119.0, -50.0),
    mount(-20.0, -136.0, -90.0),
    mount(-191.0, -136.0, -90.0),
    mount(-237.0, -119.0, -130.0),
    mount(-271.0, -78.0, -150.0),
    mount(-290.0, -27.0, -170.0),
    mount(-290.0, 27.0, 170.0),
    mount(-271.0, 78.0, 150.0),
    mount(-237.0, 119.0, 130.0),
    mount(-191.0, 136.0, 90.0),
];

const PERFORMANCE_PEOPLEBOT_RING: [Mount; 32] = [
    mount(69.0, 136.0, 90.0),
    mount(114.0, 119.0, 50.0),
    mount(148.0, 78.0, 30.0),
    mount(166.0, 27.0, 10.0),
    mount(166.0, -27.0, -10.0),
    mount(148.0, -78.0, -30.0),
    mount(114.0, -119.0, -50.0),
    mount(69.0, -136.0, -90.0),
    mount(-20.0, 136.0, 90.0),
    mount(24.0, 119.0, 50.0),
    mount(58.0, 78.0, 30.0),
    mount(77.0, 27.0, 10.0),
    mount(77.0, -27.0, -10.0),
    mount(58.0, -78.0, -30.0),
    mount(24.0, -119.0, -50.0),
    mount(-20.0, -136.0, -90.0),
    mount(-157.0, -136.0, -90.0),
    mount(-203.0, -119.0, -130.0),
    mount(-237.0, -78.0, -150.0),
    mount(-255.0, -27.0, -170.0),
    mount(-255.0, 27.0, 170.0),
    mount(-237.0, 78.0, 150.0),
    mount(-203.0, 119.0, 130.0),
    mount(-157.0, 136.0, 90.0),
    mount(-191.0, -136.0, -90.0),
    mount(-237.0, -119.0, -130.0),
    mount(-271.0, -78.0, -150.0),
    mount(-290.0, -27.0, -170.0),
    mount(-290.0, 27.0, 170.0),
    mount(-271.0, 78.0, 150.0),
    mount(-237.0, 119.0, 130.0),
    mount(-191.0, 136.0, 90.0),
];

const PIONEER_LX_RING: [Mount; 4] =
    [mount(331.0, 61.0, 10.0), mount(331.0, -61.0, -10.0), mount(-317.0, 90.0, 164.0), mount(-317.0, -90.0, -164.0)];

const POWERBOT_RING: [Mount; 31] = [
    mount(152.0, 278.0, 90.0),
    mount(200.0, 267.0, 65.0),
    mount(241.0, 238.0, 45.0),
    mount(274.0, 200.0, 35.0),
    mount(300.0, 153.0, 25.0),
    mount(320.0, 96.0, 15.0),
    mount(332.0, 33.0, 5.0),
    NONE,
    mount(332.0, -33.0, -5.0),
    mount(320.0, -96.0, -15.0),
    mount(300.0, -153.0, -25.0),
    mount(274.0, -200.0, -35.0),
    mount(241.0, -238.0, -45.0),
    mount(200.0, -267.0, -65.0),
    mount(152.0, -278.0, -90.0),
    NONE,
    mount(-298.0, -278.0, -90.0),
    mount(-347.0, -267.0, -115.0),
    mount(-388.0, -238.0, -135.0),
    mount(-420.0, -200.0, -145.0),
    mount(-447.0, -153.0, -155.0),
    mount(-467.0, -96.0, -165.0),
    mount(-478.0, -33.0, -175.0),
    NONE,
    mount(-478.0, 33.0, 175.0),
    mount(-467.0, 96.0, 165.0),
    mount(-447.0, 153.0, 155.0),
    mount(-420.0, 200.0, 145.0),
    mount(-388.0, 238.0, 135.0),
    mount(-347.0, 267.0, 115.0),
    mount(-298.0, 278.0, 90.0),
];

const POWERBOT_SH_RING: [Mount; 32] = [
    mount(152.0, 278.0, 90.0),
    mount(200.0, 267.0, 65.0),
    mount(241.0, 238.0, 45.0),
    mount(274.0, 200.0, 35.0),
    mount(300.0, 153.0, 25.0),
    mount(320.0, 96.0, 15.0),
    mount(332.0, 33.0, 5.0),
    NONE,
    mount(332.0, -33.0, -5.0),
    mount(320.0, -96.0, -15.0),
    mount(300.0, -153.0, -25.0),
    mount(274.0, -200.0, -35.0),
    mount(241.0, -238.0, -45.0),
    mount(200.0, -267.0, -65.0),
    mount(152.0, -278.0, -90.0),
    NONE,
    mount(-298.0, -278.0, -90.0),
    mount(-347.0, -267.0, -115.0),
    mount(-388.0, -238.0, -135.0),
    mount(-420.0, -200.0, -145.0),
    mount(-447.0, -153.0, -155.0),
    mount(-467.0, -96.0, -165.0),
    mount(-478.0, -33.0, -175.0),
    NONE,
    mount(-478.0, 33.0, 175.0),
    mount(-467.0, 96.0, 165.0),
    mount(-447.0, 153.0, 155.0),
    mount(-420.0, 200.0, 145.0),
    mount(-388.0, 238.0, 135.0),
    mount(-347.0, 267.0, 115.0),
    mount(-298.0, 278.0, 90.0),
    NONE,
];

const POWERBOT_SH_UARCS_RING: [Mount; 16] = [
    mount(-298.0, -278.0, -90.0),
    mount(-347.0, -267.0, -115.0),
    mount(-388.0, -238.0, -135.0),
    mount(-420.0, -200.0, -145.0),
    mount(-447.0, -153.0, -155.0),
    mount(-467.0, -96.0, -165.0),
    mount(-478.0, -33.0, -175.0),
    NONE,
    mount(-478.0, 33.0, 175.0),
    mount(-467.0, 96.0, 165.0),
    mount(-447.0, 153.0, 155.0),
    mount(-420.0, 200.0, 145.0),
    mount(-388.0, 238.0, 135.0),
    mount(-347.0, 267.0, 115.0),
    mount(-298.0, 278.0, 90.0),
    NONE,
];

const NO_RING: [Mount; 0] = [];

impl Model {
    /// The model of that name, or of that subclass. Letter case is no matter.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        MODELS.iter().find(|model| model.names().any(|known| known.eq_ignore_ascii_case(name)))
    }

    /// The model of a robot that says who it is; `None` for one that stillmap has no factors for.
    #[must_use]
    pub fn of(identity: &Identity) -> Option<&'static Self> {
        Self::named(&identity.subclass)
    }
}

/// The robots that stillmap knows. The first is what it takes a robot for that says nothing else.
#[rustfmt::skip]
pub static MODELS: [Model; 30] = [
    robot("pioneer-1", &["pion1m", "pion1x", "psos1m", "psos1x", "psos43m", "psos"], System::Psos, Factors { distance_mm: 0.05066, velocity_mm_s: 2.5332, range_mm: 0.1734 }, [220.0, 400.0, 500.0], &PIONEER_1_RING),
    robot("pioneer-at", &["pionat"], System::Psos, Factors { distance_mm: 0.07, velocity_mm_s: 2.5332, range_mm: 0.1734 }, [330.0, 400.0, 500.0], &PIONEER_1_RING),
    robot("p2-dx", &["p2dx"], System::P2os, Factors { distance_mm: 0.84, velocity_mm_s: 1.0, range_mm: 0.268 }, [250.0, 425.0, 511.0], &DX_RING),
    robot("p3-dx", &["p3dx", "p2d8", "p2d8+"], System::P2os, Factors { distance_mm: 0.485, velocity_mm_s: 1.0, range_mm: 1.0 }, [250.0, 425.0, 511.0], &DX_RING),
    robot("p3-dx-sh", &["p3dx-sh", "p3dx-sh-lms1xx", "p3dx-sh-lms500"], System::P2os, Factors { distance_mm: 1.0, velocity_mm_s: 1.0, range_mm: 1.0 }, [250.0, 425.0, 511.0], &DX_RING),
    robot("amigobot", &["amigo"], System::P2os, Factors { distance_mm: 0.5083, velocity_mm_s: 0.6154, range_mm: 1.0 }, [180.0, 279.0, 330.0], &AMIGO_RING),
    robot("amigobot-sh", &["amigo-sh", "amigo-sh-tim3xx"], System::P2os, Factors { distance_mm: 1.0, velocity_mm_s: 1.0, range_mm: 1.0 }, [180.0, 279.0, 330.0], &AMIGO_SH_RING),
    robot("patrolbot", &["patrolbot-sh", "mt400", "researchPB", "researchPB-lms500"], System::P2os, Factors { distance_mm: 1.0, velocity_mm_s: 1.0, range_mm: 1.0 }, [250.0, 425.0, 510.0], &PATROLBOT_RING),
    robot("mtx", &[], System::P2os, Factors { distance_mm: 1.0, velocity_mm_s: 1.0, range_mm: 1.0 }, [348.0, 500.0, 696.0], &MTX_RING),
    robot("p2-at", &["p2at", "pioneer-2-at"], System::P2os, Factors { distance_mm: 1.32, velocity_mm_s: 1.0, range_mm: 0.268 }, [500.0, 505.0, 626.0], &AT_RING),
    robot("p2at8", &[], System::P2os, Factors { distance_mm: 1.32, velocity_mm_s: 1.0, range_mm: 1.0 }, [500.0, 505.0, 626.0], &AT_RING),
    robot("p3-at", &["p3at", "p2at8+", "pioneer-3-at"], System::P2os, Factors { distance_mm: 0.465, velocity_mm_s: 1.0, range_mm: 1.0 }, [500.0, 505.0, 626.0], &AT_RING),
    robot("p2ce", &[], System::P2os, Factors { distance_mm: 0.826, velocity_mm_s: 1.0, range_mm: 0.268 }, [250.0, 425.0, 511.0], &DX_RING),
    robot("p2de", &[], System::P2os, Factors { distance_mm: 0.969, velocity_mm_s: 1.0, range_mm: 0.268 }, [250.0, 425.0, 511.0], &DX_RING),
    robot("p2df", &[], System::P2os, Factors { distance_mm: 0.485, velocity_mm_s: 1.0, range_mm: 0.268 }, [250.0, 425.0, 511.0], &DX_RING),
    robot("p2it", &[], System::P2os, Factors { distance_mm: 1.136, velocity_mm_s: 1.0, range_mm: 0.268 }, [500.0, 505.0, 626.0], &AT_RING),
    robot("p2pb", &[], System::P2os, Factors { distance_mm: 0.424, velocity_mm_s: 1.0, range_mm: 0.268 }, [300.0, 425.0, 513.0], &P2_PEOPLEBOT_RING),
    robot("p2pp", &[], System::P2os, Factors { distance_mm: 0.485, velocity_mm_s: 1.0, range_mm: 0.268 }, [300.0, 425.0, 513.0], &P2_PEOPLEBOT_RING),
    robot("p3-at-sh", &["p3at-sh", "p3at-sh-lms1xx", "p3at-sh-lms500"], System::P2os, Factors { distance_mm: 1.0, velocity_mm_s: 1.0, range_mm: 1.0 }, [500.0, 505.0, 626.0], &AT_RING),
    robot("p3atiw-sh", &[], System::P2os, Factors { distance_mm: 1.0, velocity_mm_s: 1.0, range_mm: 1.0 }, [500.0, 490.0, 626.0], &AT_RING),
    robot("peoplebot-sh", &["peoplebot-sh-lms1xx", "peoplebot-sh-lms500"], System::P2os, Factors { distance_mm: 1.0, velocity_mm_s: 1.0, range_mm: 1.0 }, [340.0, 425.0, 513.0], &PEOPLEBOT_SH_RING),
    robot("peoplebot", &["perfpb"], System::P2os, Factors { distance_mm: 0.485, velocity_mm_s: 1.0, range_mm: 1.0 }, [340.0, 425.0, 513.0], &PERFORMANCE_PEOPLEBOT_RING),
    robot("perfpb+", &[], System::P2os, Factors { distance_mm: 0.485, velocity_mm_s: 1.0, range_mm: 1.0 }, [340.0, 425.0, 511.0], &PERFORMANCE_PEOPLEBOT_RING),
    robot("pioneer-lx", &["pioneer-lx-ld"], System::P2os, Factors { distance_mm: 1.0, velocity_mm_s: 1.0, range_mm: 1.0 }, [348.0, 500.0, 696.0], &PIONEER_LX_RING),
    robot("powerbot", &[], System::P2os, Factors { distance_mm: 0.5813, velocity_mm_s: 1.0, range_mm: 1.0 }, [550.0, 680.0, 911.0], &POWERBOT_RING),
    robot("powerbot-sh", &["powerbot-sh-lms500"], System::P2os, Factors { distance_mm: 1.0, velocity_mm_s: 1.0, range_mm: 1.0 }, [550.0, 680.0, 911.0], &POWERBOT_SH_RING),
    robot("powerbot-sh-uarcs", &[], System::P2os, Factors { distance_mm: 1.0, velocity_mm_s: 1.0, range_mm: 1.0 }, [550.0, 680.0, 911.0], &POWERBOT_SH_UARCS_RING),
    robot("seekur", &[], System::P2os, Factors { distance_mm: 1.0, velocity_mm_s: 1.0, range_mm: 1.0 }, [833.0, 1270.0, 1410.0], &NO_RING),
    robot("seekurjr", &[], System::P2os, Factors { distance_mm: 1.0, velocity_mm_s: 1.0, range_mm: 1.0 }, [600.0, 830.0, 1200.0], &NO_RING),
    robot("wheelchair-sh", &[], System::P2os, Factors { distance_mm: 1.0, velocity_mm_s: 1.0, range_mm: 1.0 }, [550.0, 680.0, 1340.0], &NO_RING),
];
