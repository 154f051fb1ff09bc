//! What this driver says to a robot.

use psos::number;

/// Everything the driver can say. The robot is driven by hand: there is no motion command here, nor a way to add an argument.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// First step of the handshake. An open robot takes it for [`Command::Pulse`].
    Sync0,
    /// Second step of the handshake. An open robot takes it for [`Command::Open`].
    Sync1,
    /// Third step of the handshake, which asks for the robot's name. An open robot takes it for [`Command::Close`].
    Sync2,
    /// Starts the status packets.
    Open,
    /// Keeps the robot's watchdog content.
    Pulse,
    /// Sonars on; P2OS and later.
    SonarsOn,
    /// Ends the session.
    Close,
}

impl Command {
    /// Every command there is.
    pub const ALL: [Self; 7] = [Self::Sync0, Self::Sync1, Self::Sync2, Self::Open, Self::Pulse, Self::SonarsOn, Self::Close];

    /// The packet, ready to be sent.
    #[must_use]
    pub fn packet(self) -> Vec<u8> {
        let command = match self {
            Self::Sync0 => psos::Command::plain(number::SYNC0),
            Self::Sync1 => psos::Command::plain(number::SYNC1),
            Self::Sync2 => psos::Command::plain(number::SYNC2),
            Self::Open => psos::Command::plain(number::OPEN),
            Self::Pulse => psos::Command::plain(number::PULSE),
            Self::SonarsOn => psos::Command::int(number::SONAR, 1),
            Self::Close => psos::Command::plain(number::CLOSE),
        };
        // Only a string can be too long for a packet, and no command of the driver carries one.
        command.encode().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_command_moves_the_robot() {
        let numbers: Vec<_> = Command::ALL
            .iter()
            .map(|command| {
                let frame = psos::Deframer::new().push(&command.packet()).remove(0);
                psos::Command::decode(&frame.data).unwrap().number
            })
            .collect();
        assert_eq!(numbers, [0, 1, 2, 1, 0, number::SONAR, 2]);
    }
}
