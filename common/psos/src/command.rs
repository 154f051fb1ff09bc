//! Commands: what a client tells the robot.

use thiserror::Error;

use crate::frame::{self, FrameError};

/// The numbers of the commands. SYNC0 to SYNC2 share theirs with PULSE, OPEN and CLOSE: what 0, 1 and 2 mean depends on whether
/// the robot is open.
pub mod number {
    /// First step of the handshake, to a robot that is not open.
    pub const SYNC0: u8 = 0;
    /// Second step of the handshake.
    pub const SYNC1: u8 = 1;
    /// Third step of the handshake; the reply names the robot.
    pub const SYNC2: u8 = 2;
    /// Keeps the robot's watchdog content.
    pub const PULSE: u8 = 0;
    /// Starts the servers; status packets come from now on.
    pub const OPEN: u8 = 1;
    /// Ends the session.
    pub const CLOSE: u8 = 2;
    /// Sonar firing order, a string of sonar numbers from 1.
    pub const POLLING: u8 = 3;
    /// Motors on (1) or off (0); P2OS and later.
    pub const ENABLE: u8 = 4;
    /// Greatest translational velocity.
    pub const SETV: u8 = 6;
    /// Sets the odometry to 0, 0, 0.
    pub const SETO: u8 = 7;
    /// Greatest rotational velocity.
    pub const SETRV: u8 = 10;
    /// Translational velocity, mm/s.
    pub const VEL: u8 = 11;
    /// Heading, degrees.
    pub const HEAD: u8 = 12;
    /// Asks for a configuration packet; P2OS and later.
    pub const CONFIG: u8 = 18;
    /// Rotational velocity, degrees/s.
    pub const RVEL: u8 = 21;
    /// Sonars on (1) or off (0); P2OS and later.
    pub const SONAR: u8 = 28;
    /// Stops without disabling the motors.
    pub const STOP: u8 = 29;
    /// Wheel velocities, one byte each.
    pub const VEL2: u8 = 32;
    /// What bumpers and stalls do.
    pub const BUMP_STALL: u8 = 44;
    /// Changes the baud rate.
    pub const HOSTBAUD: u8 = 50;
    /// Stops at once.
    pub const E_STOP: u8 = 55;
}

const POSITIVE: u8 = 0x3B;
const NEGATIVE: u8 = 0x1B;
const STRING: u8 = 0x2B;

/// What goes with a command.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Argument {
    /// Nothing.
    None,
    /// An integer of 16 bits and a sign of its own: −65535 to 65535. The sender bounds it: more is cut to that range.
    Int(i32),
    /// A string of bytes, at most 195.
    Bytes(Vec<u8>),
}

/// A command and its argument.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Command {
    /// See [`number`].
    pub number: u8,
    /// What goes with it.
    pub argument: Argument,
}

/// Packet data that is no command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum CommandError {
    /// A packet without data.
    #[error("a command needs a number: found 0 bytes")]
    Empty,
    /// The byte after the number is none of the three types.
    #[error("command {number}: argument type 0x{found:02X} at byte 1, expected 0x3B, 0x1B or 0x2B")]
    UnknownType {
        /// The command's number.
        number: u8,
        /// The type byte.
        found: u8,
    },
    /// Half an integer, or fewer bytes than the string's length says.
    #[error("command {number}: argument of {found} bytes, expected {expected}")]
    ShortArgument {
        /// The command's number.
        number: u8,
        /// Bytes after the type (and a string's length).
        found: usize,
        /// Bytes that should be there.
        expected: usize,
    },
}

impl Command {
    /// A command without an argument.
    #[must_use]
    pub const fn plain(number: u8) -> Self {
        Self { number, argument: Argument::None }
    }

    /// A command with an integer.
    #[must_use]
    pub const fn int(number: u8, value: i32) -> Self {
        Self { number, argument: Argument::Int(value) }
    }

    /// The whole packet, ready to be sent. Of a negative integer the magnitude travels, under a type of its own.
    ///
    /// # Errors
    /// A string that is longer than a packet can carry.
    pub fn encode(&self) -> Result<Vec<u8>, FrameError> {
        let mut data = vec![self.number];
        match &self.argument {
            Argument::None => {}
            Argument::Int(value) => {
                data.push(if *value < 0 { NEGATIVE } else { POSITIVE });
                let magnitude = u16::try_from(value.unsigned_abs()).unwrap_or(u16::MAX);
                data.extend_from_slice(&magnitude.to_le_bytes());
            }
            Argument::Bytes(bytes) => {
                data.push(STRING);
                // A string too long for its length byte is too long for a packet: `encode_frame` refuses it.
                data.push(u8::try_from(bytes.len()).unwrap_or(u8::MAX));
                data.extend_from_slice(bytes);
            }
        }
        frame::encode_frame(&data)
    }

    /// The command in a packet's data. A type byte without a value, which a public client sends with SETO, is no argument;
    /// bytes after the argument (a string's NUL) are ignored, as the robots do.
    ///
    /// # Errors
    /// Data that is empty, has an unknown argument type, or ends within the argument.
    pub fn decode(data: &[u8]) -> Result<Self, CommandError> {
        let (&number, rest) = data.split_first().ok_or(CommandError::Empty)?;
        let argument = match rest {
            [] | [POSITIVE | NEGATIVE | STRING] => Argument::None,
            [POSITIVE, low, high, ..] => Argument::Int(i32::from(u16::from_le_bytes([*low, *high]))),
            [NEGATIVE, low, high, ..] => Argument::Int(-i32::from(u16::from_le_bytes([*low, *high]))),
            [STRING, length, bytes @ ..] => {
                let expected = usize::from(*length);
                let text = bytes.get(..expected).ok_or(CommandError::ShortArgument { number, found: bytes.len(), expected })?;
                Argument::Bytes(text.to_vec())
            }
            [POSITIVE | NEGATIVE, bytes @ ..] => return Err(CommandError::ShortArgument { number, found: bytes.len(), expected: 2 }),
            [found, ..] => return Err(CommandError::UnknownType { number, found: *found }),
        };
        Ok(Self { number, argument })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(command: Command, data: &[u8]) {
        let packet = command.encode().unwrap();
        assert_eq!(&packet[3..packet.len() - 2], data);
        assert_eq!(Command::decode(data), Ok(command));
    }

    #[test]
    fn commands_both_ways() {
        check(Command::plain(number::OPEN), &[1]);
        check(Command::int(number::ENABLE, 1), &[4, 0x3B, 1, 0]);
        check(Command::int(number::VEL, 400), &[11, 0x3B, 0x90, 1]);
        check(Command::int(number::VEL, -300), &[11, 0x1B, 0x2C, 1]);
        check(Command { number: number::POLLING, argument: Argument::Bytes(vec![1, 4, 7]) }, &[3, 0x2B, 3, 1, 4, 7]);
    }

    #[test]
    fn what_real_clients_send_is_borne() {
        assert_eq!(Command::decode(&[7, 0x3B]), Ok(Command::plain(number::SETO)));
        assert_eq!(Command::decode(&[3, 0x2B, 1, 5, 0]), Ok(Command { number: 3, argument: Argument::Bytes(vec![5]) }));
    }

    #[test]
    fn what_is_no_command_is_refused() {
        assert_eq!(Command::decode(&[]), Err(CommandError::Empty));
        assert_eq!(Command::decode(&[9, 1, 2]), Err(CommandError::UnknownType { number: 9, found: 1 }));
        assert_eq!(Command::decode(&[9, 0x3B, 2]), Err(CommandError::ShortArgument { number: 9, found: 1, expected: 2 }));
        assert_eq!(Command::decode(&[3, 0x2B, 4, 2]), Err(CommandError::ShortArgument { number: 3, found: 1, expected: 4 }));
        let long = Command { number: 3, argument: Argument::Bytes(vec![0; 300]) };
        assert_eq!(long.encode(), Err(FrameError::TooLong { found: 303 }));
    }
}
