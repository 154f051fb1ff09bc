//! The standard information packet: what an open robot says ten times a second.

use thiserror::Error;

use crate::frame::{self, FrameError};

/// Data bytes before the sonar readings.
const FIXED: usize = 20;

/// Type byte of a packet while the robot stands.
pub const STOPPED: u8 = 0x32;

/// Type byte of a packet while the robot moves.
pub const MOVING: u8 = 0x33;

/// One reading, in the robot's own units.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RawReading {
    /// The sonar's number, from 0.
    pub sonar: u8,
    /// Range; multiply by the model's factor.
    pub range: u16,
}

/// A standard information packet in the robot's own units; a [`Model`](crate::Model) gives the factors.
/// Field offsets: Pioneer 1 operation manual, appendix B.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sip {
    /// Low nibble of the type byte: 2 stopped, 3 moving. Some robots always say 2.
    pub status: u8,
    /// Along x, wraps around.
    pub x: u16,
    /// Along y, wraps around.
    pub y: u16,
    /// Heading, counter-clockwise; wraps around at a full turn of the model's units, whatever the sign.
    pub heading: i16,
    /// Left wheel's velocity.
    pub left_velocity: i16,
    /// Right wheel's velocity.
    pub right_velocity: i16,
    /// Battery, 0.1 V.
    pub battery: u8,
    /// Bit 0: the left wheel stalls; the rest are bumpers.
    pub left_stall_bumpers: u8,
    /// Bit 0: the right wheel stalls; the rest are bumpers.
    pub right_stall_bumpers: u8,
    /// Set-point of the heading servo.
    pub control: i16,
    /// P2OS and later: see [`Sip::sonars_on`]. PSOS means something else by it.
    pub flags: u16,
    /// P2OS and later: compass, in units of 2 degrees. PSOS means something else by it.
    pub compass: u8,
    /// The readings that are new since the last packet.
    pub readings: Vec<RawReading>,
    /// What follows the readings: 5 bytes (timer, analog, digital in, digital out) from PSOS, more from later systems.
    pub tail: Vec<u8>,
}

/// Packet data that is no status packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum SipError {
    /// Another kind of packet.
    #[error("packet type 0x{found:02X} is no status packet, expected 0x30 to 0x34")]
    OtherType {
        /// The type byte.
        found: u8,
    },
    /// It ends before what it announces.
    #[error("status packet of {found} data bytes, expected at least {expected}")]
    Short {
        /// Data bytes in the packet.
        found: usize,
        /// Data bytes that its sonar count asks for.
        expected: usize,
    },
}

impl Sip {
    /// True when a packet's data is of a status packet's type.
    #[must_use]
    pub fn is_sip(data: &[u8]) -> bool {
        matches!(data.first(), Some(0x30..=0x34))
    }

    /// The status packet in a packet's data. Any tail is borne.
    ///
    /// # Errors
    /// Another type of packet, or fewer bytes than it announces.
    pub fn decode(data: &[u8]) -> Result<Self, SipError> {
        if !Self::is_sip(data) {
            return Err(SipError::OtherType { found: data.first().copied().unwrap_or(0) });
        }
        let (fixed, rest) = data.split_first_chunk::<FIXED>().ok_or(SipError::Short { found: data.len(), expected: FIXED })?;
        let count = usize::from(fixed[19]);
        let (readings, tail) =
            rest.split_at_checked(3 * count).ok_or(SipError::Short { found: data.len(), expected: FIXED + 3 * count })?;
        let unsigned = |at: usize| u16::from_le_bytes([fixed[at], fixed[at + 1]]);
        let signed = |at: usize| i16::from_le_bytes([fixed[at], fixed[at + 1]]);
        Ok(Self {
            status: fixed[0] & 0x0F,
            x: unsigned(1),
            y: unsigned(3),
            heading: signed(5),
            left_velocity: signed(7),
            right_velocity: signed(9),
            battery: fixed[11],
            left_stall_bumpers: fixed[12],
            right_stall_bumpers: fixed[13],
            control: signed(14),
            flags: unsigned(16),
            compass: fixed[18],
            readings: readings.chunks_exact(3).map(|r| RawReading { sonar: r[0], range: u16::from_le_bytes([r[1], r[2]]) }).collect(),
            tail: tail.to_vec(),
        })
    }

    /// The whole packet, ready to be sent by a robot.
    ///
    /// # Errors
    /// Readings and tail that do not fit into a packet.
    pub fn encode(&self) -> Result<Vec<u8>, FrameError> {
        let mut data = Vec::with_capacity(FIXED + 3 * self.readings.len() + self.tail.len());
        data.push(0x30 | (self.status & 0x0F));
        for value in [self.x, self.y, self.heading as u16, self.left_velocity as u16, self.right_velocity as u16] {
            data.extend_from_slice(&value.to_le_bytes());
        }
        data.extend_from_slice(&[self.battery, self.left_stall_bumpers, self.right_stall_bumpers]);
        data.extend_from_slice(&self.control.to_le_bytes());
        data.extend_from_slice(&self.flags.to_le_bytes());
        data.push(self.compass);
        // A count that its byte cannot hold comes with more readings than a packet can: `encode_frame` refuses it.
        data.push(u8::try_from(self.readings.len()).unwrap_or(u8::MAX));
        for reading in &self.readings {
            data.push(reading.sonar);
            data.extend_from_slice(&reading.range.to_le_bytes());
        }
        data.extend_from_slice(&self.tail);
        frame::encode_frame(&data)
    }

    /// Battery voltage, V.
    #[must_use]
    pub fn battery_v(&self) -> f64 {
        f64::from(self.battery) / 10.0
    }

    /// P2OS and later: the motors have power.
    #[must_use]
    pub fn motors_on(&self) -> bool {
        self.flags & 1 != 0
    }

    /// P2OS and later: at least one of the four sonar arrays fires.
    #[must_use]
    pub fn sonars_on(&self) -> bool {
        self.flags & 0b1_1110 != 0
    }

    /// P2OS and later: the emergency stop button is pressed.
    #[must_use]
    pub fn stop_button(&self) -> bool {
        self.flags & 0b10_0000 != 0
    }

    /// Either wheel stalls.
    #[must_use]
    pub fn stalled(&self) -> bool {
        (self.left_stall_bumpers | self.right_stall_bumpers) & 1 != 0
    }
}
