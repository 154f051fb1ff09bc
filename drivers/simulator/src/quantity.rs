//! Numbers of a world file that know their limits.

use serde::de::{Deserialize, Deserializer, Error, Unexpected};

use crate::geometry::Vector;

/// Declares newtypes of numbers with limits: `Name: 0.1..=5.0, "0.1 to 5 m", default 1.0;`. A value outside cannot be made.
macro_rules! quantities {
    ($($(#[$doc:meta])* $name:ident: $min:literal..=$max:literal, $expected:literal $(, default $default:literal)?;)+) => {$(
        $(#[$doc])*
        #[doc = concat!(" ", $expected, $(", by default ", stringify!($default),)? ".")]
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
        pub struct $name(f64);

        impl $name {
            /// The number; `None` outside the limits.
            #[must_use]
            pub fn new(number: f64) -> Option<Self> {
                ($min..=$max).contains(&number).then_some(Self(number))
            }

            /// The number.
            #[must_use]
            pub const fn get(self) -> f64 {
                self.0
            }
        }

        $(impl Default for $name {
            fn default() -> Self {
                Self($default)
            }
        })?

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let number = f64::deserialize(deserializer)?;
                Self::new(number).ok_or_else(|| D::Error::invalid_value(Unexpected::Float(number), &$expected))
            }
        }
    )+};
}

quantities! {
    /// Half the opening angle of a sonar's beam.
    HalfBeam: 1.0..=45.0, "1 to 45 deg", default 12.5;
    /// Farthest echo that the robot hears.
    EchoLimit: 0.5..=10.0, "0.5 to 10 m", default 5.0;
    /// Nearest range: the transducer still rings, so that what is nearer reads as this.
    BlindRange: 0.0..=1.0, "0 to 1 m", default 0.15;
    /// Spread of a range (one standard deviation).
    RangeNoise: 0.0..=0.5, "0 to 0.5 m", default 0.006;
    /// Further spread in proportion to the range.
    RangeNoiseShare: 0.0..=0.2, "0 to 0.2", default 0.003;
    /// Share of pings in which another sonar is heard.
    Crosstalk: 0.0..=1.0, "0 to 1", default 0.003;
    /// Share of pings whose echo is missed.
    Missed: 0.0..=1.0, "0 to 1", default 0.01;
    /// Share of pings in which mirrored echoes are heard.
    Mirrored: 0.0..=1.0, "0 to 1", default 0.5;
    /// Farthest edge (a door's frame, a box's corner) whose weak echo is heard.
    EdgeLimit: 0.0..=20.0, "0 to 20 m", default 2.0;
    /// Angle of incidence beyond which a smooth surface sends nothing back.
    SmoothCritical: 1.0..=90.0, "1 to 90 deg", default 25.0;
    /// Angle of incidence beyond which a rough surface sends nothing back.
    RoughCritical: 1.0..=90.0, "1 to 90 deg", default 70.0;
    /// Systematic error as a share.
    ErrorShare: -0.2..=0.2, "-0.2 to 0.2", default 0.0;
    /// Random walk of the heading.
    HeadingWander: 0.0..=45.0, "0 to 45 deg after one metre", default 0.0;
    /// Speed of the robot.
    DriveSpeed: 0.01..=2.0, "0.01 to 2 m/s", default 0.25;
    /// Speed of a turn on the spot.
    TurnSpeed: 1.0..=180.0, "1 to 180 deg/s", default 45.0;
    /// Direction, counter-clockwise from x.
    Heading: -360.0..=360.0, "-360 to 360 deg", default 0.0;
    /// A time.
    Seconds: 0.0..=36000.0, "0 to 36000 s", default 0.0;
    /// Speed of a walker.
    WalkSpeed: 0.05..=3.0, "0.05 to 3 m/s", default 1.2;
    /// Length of a step.
    StepLength: 0.1..=1.2, "0.1 to 1.2 m", default 0.6;
    /// Height of a walker; legs and shoulders are in proportion.
    WalkerHeight: 0.8..=2.1, "0.8 to 2.1 m", default 1.7;
    /// A length of something built.
    BuiltLength: 0.01..=100.0, "0.01 to 100 m";
    /// How high something stands above the floor, for the camera; sound is flat.
    BuiltHeight: 0.05..=10.0, "0.05 to 10 m", default 0.75;
    /// How far a closed door stands behind its wall; negative: before it.
    Recess: -5.0..=5.0, "-5 to 5 m", default 0.0;
    /// Depth of the jambs of an open door.
    JambDepth: 0.0..=5.0, "0 to 5 m", default 0.12;
    /// A place along a wall.
    AlongWall: 0.0..=1000.0, "0 to 1000 m";
    /// One coordinate.
    Coordinate: -1000.0..=1000.0, "-1000 to 1000 m";
}

/// A place in the world's frame, `[x, y]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Position([Coordinate; 2]);

impl Position {
    /// A place; `None` beyond a kilometre.
    #[must_use]
    pub fn new(x_m: f64, y_m: f64) -> Option<Self> {
        Some(Self([Coordinate::new(x_m)?, Coordinate::new(y_m)?]))
    }

    /// x and y, m.
    #[must_use]
    pub fn get(self) -> [f64; 2] {
        self.0.map(Coordinate::get)
    }

    pub(crate) fn vector(self) -> Vector {
        self.get().into()
    }
}

impl<'de> Deserialize<'de> for Position {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        <[Coordinate; 2]>::deserialize(deserializer).map(Self)
    }
}
