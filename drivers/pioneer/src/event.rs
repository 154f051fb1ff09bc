//! What happened on the link, in words for the log and the status.

use psos::{Identity, Model};

use crate::condition::Condition;
use crate::odometry::Step;
use crate::scanner::Doubt;

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
    /// What answers the handshake gives no name, or nothing but an echo. Said for the 1st, 2nd, 4th … time.
    NotARobot {
        /// It sends back what is sent to it.
        echo: bool,
        /// Handshakes that ended so.
        times: u64,
    },
    /// No packet for the time limit.
    LinkLost {
        /// How long, s.
        silence_s: f64,
        /// Packets that arrived damaged meanwhile.
        damaged: u64,
    },
    /// From here on the pose may be off against the map before.
    PoseDoubtful {
        /// Why.
        doubt: Doubt,
    },
    /// The robot answers like one that has been switched off and on.
    RobotRestarted,
    /// Another program closes the robot on the shared port, to connect to it anew or to leave.
    ClientConnects,
    /// The other program has left an open robot: it is closed, which stops it.
    ClientLeft,
    /// A command of the other program is not forwarded. Reported for the 1st, 2nd, 4th … time.
    ClientRefused {
        /// Why.
        why: NotForwarded,
        /// Commands that were not forwarded so far.
        refused: u64,
    },
    /// A condition of the robot or its line that a person should know of.
    ConditionBegan {
        /// Which.
        condition: Condition,
        /// What it is, in words.
        words: String,
    },
    /// The condition holds no longer.
    ConditionEnded {
        /// Which.
        condition: Condition,
        /// Its last words.
        words: String,
        /// How long it held, s.
        lasted_s: f64,
    },
    /// A packet's odometry is beyond the limits. Said for the 1st, 2nd, 4th, 8th …
    OdometryRefused {
        /// What it claims.
        step: Step,
        /// Packets refused so far.
        refused: u64,
    },
}

/// Why a command of another program is not forwarded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NotForwarded {
    /// The driver itself is connecting to the robot, or there is none.
    NotConnected,
    /// It would change the speed of the line, which the driver has found.
    Speed,
    /// It is longer than a packet may be.
    Long,
}

impl Event {
    /// Whether it should draw attention.
    #[must_use]
    pub fn is_warning(&self) -> bool {
        match self {
            Self::Connected { .. } | Self::Resumed { .. } | Self::ConditionEnded { .. } | Self::ClientConnects | Self::ClientLeft => false,
            // A robot that is pushed by hand has its motors off.
            Self::ConditionBegan { condition, .. } => *condition != Condition::MotorsOff,
            _ => true,
        }
    }
}

impl std::fmt::Display for Event {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoAnswer { rounds: 1 } => write!(f, "no robot answers; still trying"),
            Self::NoAnswer { rounds } => write!(f, "no robot has answered in {rounds} rounds; still trying"),
            Self::AlreadyOpen { closings: 1 } => write!(f, "the robot was left open by an earlier client; closing it first"),
            Self::AlreadyOpen { closings } => {
                write!(f, "the robot stays open though it was told {closings} times to close: does the line carry what is sent to it?")
            }
            Self::Connected { identity: Identity { name, class, subclass }, model, baud } => {
                write!(f, "connected to {name:?}, a {class} {subclass} ({}){}", model.name, at_speed(*baud))
            }
            Self::OtherModel { settings, found } => {
                write!(f, "the robot is a {found} but robot.model is {settings}: using the factors of {found}; set robot.model")
            }
            Self::UnknownModel { subclass, settings } => write!(
                f,
                "UNKNOWN ROBOT {subclass:?}: using the factors of robot.model = {settings}; if they are not right, the map is not"
            ),
            Self::Resumed { model, baud } => {
                write!(f, "resumed the running session with the {}{}", model.name, at_speed(*baud))
            }
            Self::NotARobot { echo: true, times } => {
                write!(f, "the port sends back what is sent to it ({times} times): a loop-back plug or a modem, not a robot; still trying")
            }
            Self::NotARobot { echo: false, times } => {
                write!(f, "what answers the handshake gives no name ({times} times): not a robot; still trying")
            }
            Self::LinkLost { silence_s, damaged: 0 } => write!(f, "link lost: no packet for {silence_s:.1} s; connecting anew"),
            Self::LinkLost { silence_s, damaged } => {
                write!(f, "link lost: no intact packet for {silence_s:.1} s, {damaged} damaged ones; connecting anew")
            }
            Self::PoseDoubtful { doubt: Doubt::Wraps { elapsed_s, wrap_m, reach_m } } => write!(
                f,
                "POSE DOUBTFUL: in {elapsed_s:.1} s without a packet the robot may have gone {reach_m:.1} m, and its counters wrap around \
                 every {wrap_m:.2} m; the map from here on may be shifted by that against the map before"
            ),
            Self::PoseDoubtful { doubt: Doubt::Restarted { elapsed_s } } => write!(
                f,
                "POSE DOUBTFUL: the robot's counters have started anew after {elapsed_s:.1} s without it; the pose continues from where it \
                 was, which is right only if the robot has not moved meanwhile"
            ),
            Self::RobotRestarted => write!(f, "the robot has been switched off and on; connecting anew"),
            Self::ClientConnects => write!(f, "the program on the shared port closes the robot and may connect to it anew"),
            Self::ClientLeft => {
                write!(f, "the program on the shared port has left; closing the robot, which stops it, and connecting anew")
            }
            Self::ClientRefused { why, refused } => {
                write!(f, "a command from the shared port is not forwarded ({refused} so far): ")?;
                f.write_str(match why {
                    NotForwarded::NotConnected => "the driver is not connected to the robot",
                    NotForwarded::Speed => "it changes the speed of the line",
                    NotForwarded::Long => "it is longer than the robots take",
                })
            }
            Self::ConditionBegan { condition, words } => write!(f, "{words}{}", hint(*condition)),
            Self::ConditionEnded { words, lasted_s, .. } => write!(f, "over after {lasted_s:.1} s: {words}"),
            Self::OdometryRefused { step: Step::Refused { distance_m, turn_rad, elapsed_s, modulus }, refused } => {
                write!(
                    f,
                    "refused odometry ({refused} so far): {distance_m:.3} m and {turn_rad:.3} rad in {elapsed_s:.3} s is no motion of this robot"
                )?;
                match modulus {
                    Some(modulus) => write!(f, "; it would fit robot.odometry_modulus = {modulus}"),
                    None => write!(f, "; where that recurs on a straight drive, robot.odometry_modulus is wrong"),
                }
            }
            Self::OdometryRefused { refused, .. } => write!(f, "refused odometry ({refused} so far): is robot.odometry_modulus right?"),
        }
    }
}

/// The speed of a serial line in words; nothing for a connection in the network.
pub(crate) fn at_speed(baud: u32) -> String {
    if baud == 0 { String::new() } else { format!(" at {baud} baud") }
}

/// What a person can do about a condition.
fn hint(condition: Condition) -> &'static str {
    match condition {
        Condition::EmergencyStop => ": the robot does not move until it is released",
        Condition::PacketLoss => ": is the cable too long, its adapter loose, or this computer too busy?",
        Condition::LowBattery => ": charge it before it switches itself off",
        Condition::NoReadings => ": the map gets nothing",
        Condition::Stall | Condition::Bumper | Condition::SilentSonars | Condition::Odometry | Condition::MotorsOff => "",
    }
}
