//! What happened on the link, in words for the log and the status.

use psos::{Identity, Model};

use crate::odometry::Step;

/// Something that a person may want to know.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// No robot answered at any of the baud rates, this many times over.
    NoAnswer {
        /// Rounds over all baud rates.
        rounds: u64,
    },
    /// The robot was open already, left so by a client that was killed: it has been told to close. Said for the 1st, 2nd, 4th … time.
    AlreadyOpen {
        /// Times it was told.
        closings: u64,
    },
    /// The handshake succeeded.
    Connected {
        /// Who the robot says it is.
        identity: Identity,
        /// The factors in use.
        model: &'static Model,
        /// The baud rate.
        baud: u32,
    },
    /// The robot is of another model than the settings say; its own factors are used.
    OtherModel {
        /// What the settings say.
        settings: &'static str,
        /// What it is.
        found: &'static str,
    },
    /// The robot is of no model that has factors here; those of the settings are used.
    UnknownModel {
        /// What it calls itself.
        subclass: String,
        /// Whose factors are used.
        settings: &'static str,
    },
    /// A session that was cut off, by the death of a process or a pulled adapter, has been taken up.
    Resumed {
        /// The factors in use.
        model: &'static Model,
        /// The baud rate.
        baud: u32,
    },
    /// No packet for the time limit.
    LinkLost {
        /// How long, s.
        silence_s: f64,
    },
    /// The robot answers like one that has been switched off and on.
    RobotRestarted,
    /// The sonars do not fire; they have been told to.
    SonarsOff,
    /// A packet's odometry is beyond the limits. Said for the 1st, 2nd, 4th, 8th …
    OdometryRefused {
        /// What it claims.
        step: Step,
        /// Packets refused so far.
        refused: u64,
    },
}

impl Event {
    /// Whether it should draw attention.
    #[must_use]
    pub fn is_warning(&self) -> bool {
        !matches!(self, Self::Connected { .. } | Self::Resumed { .. })
    }
}

impl std::fmt::Display for Event {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoAnswer { rounds: 1 } => write!(f, "no robot answers at any baud rate; still trying"),
            Self::NoAnswer { rounds } => write!(f, "no robot has answered at any baud rate in {rounds} rounds; still trying"),
            Self::AlreadyOpen { closings: 1 } => write!(f, "the robot was left open by an earlier client; closing it first"),
            Self::AlreadyOpen { closings } => {
                write!(f, "the robot stays open though it was told {closings} times to close: does the line carry what is sent to it?")
            }
            Self::Connected { identity: Identity { name, class, subclass }, model, baud } => {
                write!(f, "connected to {name:?}, a {class} {subclass} ({}), at {baud} baud", model.name)
            }
            Self::OtherModel { settings, found } => {
                write!(f, "the robot is a {found} but robot.model is {settings}: using the factors of {found}; set robot.model")
            }
            Self::UnknownModel { subclass, settings } => write!(
                f,
                "UNKNOWN ROBOT {subclass:?}: using the factors of robot.model = {settings}; if they are not right, the map is not"
            ),
            Self::Resumed { model, baud } => {
                write!(f, "took up the running session with the {} at {baud} baud", model.name)
            }
            Self::LinkLost { silence_s } => write!(f, "link lost: no packet for {silence_s:.1} s; connecting anew"),
            Self::RobotRestarted => write!(f, "the robot has been switched off and on; connecting anew"),
            Self::SonarsOff => write!(f, "the sonars do not fire; told them to"),
            Self::OdometryRefused { step: Step::Refused { distance_m, turn_rad, elapsed_s }, refused } => write!(
                f,
                "refused odometry ({refused} so far): {distance_m:.3} m and {turn_rad:.3} rad in {elapsed_s:.3} s is no motion of this robot"
            ),
            Self::OdometryRefused { refused, .. } => write!(f, "refused odometry ({refused} so far)"),
        }
    }
}
