//! A world as its file describes it: what stands, what walks, and the robot's way through it.
//!
//! Places are `[x, y]` in metres in the world's frame (right-handed), headings counter-clockwise from x.

use serde::Deserialize;

use crate::quantity::{
    BlindRange, BuiltHeight, BuiltLength, Crosstalk, DriveSpeed, EchoLimit, EdgeLimit, ErrorShare, HalfBeam, Heading, HeadingWander,
    Mirrored, Missed, Position, RangeNoise, RangeNoiseShare, RoughCritical, Seconds, SmoothCritical, StepLength, TurnSpeed, WalkSpeed,
    WalkerHeight,
};
pub use crate::wall::Wall;

/// Most walkers of a world: what a truth message can tell of.
pub const MAX_WALKERS: usize = 16;

/// A world.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct World {
    /// `[robot]`: where it starts and how it drives.
    pub robot: Robot,
    /// `[sonar]`: how the sonars echoes_of.
    #[serde(default)]
    pub sonar: Sonar,
    /// `[odometry]`: how it errs.
    #[serde(default)]
    pub odometry: OdometryError,
    /// `[surfaces]`: how they reflect.
    #[serde(default)]
    pub surfaces: Surfaces,
    /// `[[wall]]`: walls with their doors.
    #[serde(default, rename = "wall")]
    pub walls: Vec<Wall>,
    /// `[[box]]`: furniture.
    #[serde(default, rename = "box")]
    pub boxes: Vec<Furniture>,
    /// `[[pillar]]`: what is round.
    #[serde(default, rename = "pillar")]
    pub pillars: Vec<Pillar>,
    /// `[[walker]]`: people.
    #[serde(default, rename = "walker")]
    pub walkers: Vec<Walker>,
}

/// `[robot]`: where the robot starts and how it is driven.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct Robot {
    /// Where it starts: the origin of the map.
    pub start_m: Position,
    /// Which way it looks at the start.
    #[serde(default)]
    pub heading_deg: Heading,
    /// Its speed along the way.
    #[serde(default)]
    pub speed_m_s: DriveSpeed,
    /// How fast it turns on the spot, towards the next place.
    #[serde(default)]
    pub turn_deg_s: TurnSpeed,
    /// `[[robot.way]]`: the places it drives to, in order.
    #[serde(rename = "way")]
    pub path: Vec<Goal>,
}

/// A place on a way, and how long to stand there.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct Goal {
    /// The place.
    pub to_m: Position,
    /// How long to stand there.
    #[serde(default)]
    pub stop_s: Seconds,
}

/// `[sonar]`: how the sonars echoes_of.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Sonar {
    /// Half the opening angle of the beam.
    pub half_beam_deg: HalfBeam,
    /// Farthest echo; what is as far or farther reads as this: no echo.
    pub limit_m: EchoLimit,
    /// Nearest range; what is nearer reads as this.
    pub blind_m: BlindRange,
    /// Spread of a range (one standard deviation).
    pub noise_m: RangeNoise,
    /// Further spread in proportion to the range.
    pub noise_share: RangeNoiseShare,
    /// Farthest edge whose echo is heard.
    pub edge_limit_m: EdgeLimit,
    /// Share of pings in which another sonar's ping is heard, at any range, when it comes before the echo.
    pub crosstalk: Crosstalk,
    /// Share of pings whose echo is missed.
    pub missed: Missed,
    /// Share of pings in which echoes by way of a mirror-like surface are strong enough to be heard.
    pub mirrored: Mirrored,
}

/// `[odometry]`: how the robot's odometry errs. By default it does not.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct OdometryError {
    /// Distances are counted too long by this share.
    pub distance_share: ErrorShare,
    /// Turns are counted too far by this share.
    pub turn_share: ErrorShare,
    /// Random walk of the heading: standard deviation after one metre of way; grows with the square root.
    pub wander_deg: HeadingWander,
}

/// How a surface reflects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Surface {
    /// Like a mirror: painted plaster, glass, varnish.
    #[default]
    Smooth,
    /// In all directions: brick, cloth, a curtain.
    Rough,
}

/// `[surfaces]`: the angle of incidence beyond which each kind of surface sends nothing back.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Surfaces {
    /// Of a smooth one; beyond it the sound continues as from a mirror.
    pub smooth_critical_deg: SmoothCritical,
    /// Of a rough one; beyond it the sound is lost.
    pub rough_critical_deg: RoughCritical,
}

/// `[[box]]`: a rectangular thing.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct Furniture {
    /// Its middle.
    pub centre_m: Position,
    /// Its length along the heading and its width across.
    pub size_m: [BuiltLength; 2],
    /// Its height.
    #[serde(default)]
    pub height_m: BuiltHeight,
    /// Direction of its length.
    #[serde(default)]
    pub heading_deg: Heading,
    /// How it reflects.
    #[serde(default)]
    pub surface: Surface,
}

/// `[[pillar]]`: a round thing.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct Pillar {
    /// Its middle.
    pub centre_m: Position,
    /// Its radius.
    pub radius_m: BuiltLength,
    /// Its height; without it, it reaches the ceiling.
    #[serde(default)]
    pub height_m: Option<BuiltHeight>,
    /// How it reflects.
    #[serde(default)]
    pub surface: Surface,
}

/// `[[walker]]`: a person on two legs, in the world from `start_s` until the end of the path.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct Walker {
    /// Where the walker comes in.
    pub from_m: Position,
    /// When, counted from the start of the drive.
    #[serde(default)]
    pub start_s: Seconds,
    /// Walking speed.
    #[serde(default)]
    pub speed_m_s: WalkSpeed,
    /// Length of a step.
    #[serde(default)]
    pub step_m: StepLength,
    /// Height. Legs and shoulders are in proportion.
    #[serde(default)]
    pub height_m: WalkerHeight,
    /// `[[walker.way]]`: the places to walk to, in order; at the last one the walker leaves.
    #[serde(rename = "way")]
    pub path: Vec<Goal>,
}
