//! `[pioneer]`: the driver of a robot that speaks the PSOS or P2OS protocol.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::bounded::{bounded, one_of};
use crate::text::Port;

bounded! {
    /// Time between two signs of life to the robot; its watchdog stops it after 2 s without.
    PulseInterval: f64 in 0.05..=1.0, "s", default 0.5;
    /// Time without a packet after which the link is lost.
    LinkTimeout: f64 in 1.0..=60.0, "s", default 8.0;
    /// Greatest speed that odometry is believed.
    SpeedLimit: f64 in 0.1..=5.0, "m/s", default 1.0;
    /// Greatest turn rate that odometry is believed.
    TurnLimit: f64 in 0.1..=20.0, "rad/s", default 3.0;
    /// A TCP port that needs no privilege.
    SharePort: u32 in 1024..=65535, "";
}

one_of! {
    /// A speed of the serial line, in bits a second.
    Baud: u32 of [9600, 19200, 38400, 57600, 115_200];
}

/// `[pioneer]`: the driver of a robot that speaks the PSOS or P2OS protocol.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Pioneer {
    /// Serial device of the robot, relative to the settings file, `"simulator"` for the simulator of this deployment, or the TCP port
    /// of a robot simulator or serial bridge, by default 8101.
    pub port: Port,
    /// Baud rates that are tried, in this order.
    #[schemars(length(min = 1, max = 5))]
    pub bauds: Vec<Baud>,
    /// Time between two keep-alive commands (PULSE). The watchdog of the robot stops it after 2 s without one.
    pub pulse_s: PulseInterval,
    /// Time without a packet after which the port is opened again.
    pub link_lost_s: LinkTimeout,
    /// Highest plausible speed. Odometry with a higher speed is rejected.
    pub speed_limit_m_s: SpeedLimit,
    /// Highest plausible turn rate. Odometry with a higher turn rate is rejected.
    pub turn_limit_rad_s: TurnLimit,
    /// Link to a pseudo-terminal on which another program uses the robot, relative to the settings file.
    #[serde(deserialize_with = "crate::text::optional_path", skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-form" = "path"))]
    pub share: Option<PathBuf>,
    /// TCP port of the loopback interface on which another program uses the robot.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub share_tcp: Option<SharePort>,
}

impl Default for Pioneer {
    fn default() -> Self {
        Self {
            port: Port::Device(PathBuf::from("/dev/pioneer")),
            bauds: [9600, 38400, 19200, 115_200, 57600].map(Baud).to_vec(),
            pulse_s: PulseInterval::default(),
            link_lost_s: LinkTimeout::default(),
            speed_limit_m_s: SpeedLimit::default(),
            turn_limit_rad_s: TurnLimit::default(),
            share: None,
            share_tcp: None,
        }
    }
}
