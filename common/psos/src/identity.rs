//! Who the robot is: its answer to SYNC2.

use thiserror::Error;

use crate::command::number;
use crate::frame::{self, FrameError};

/// The robot's answer to SYNC2. Bytes that are not UTF-8 appear as replacement characters.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Identity {
    /// The name its owner gave it.
    pub name: String,
    /// The family, "Pioneer" for all robots that stillmap drives.
    pub class: String,
    /// What decides about its factors: "pion1m", "p3dx" …
    pub subclass: String,
}

/// Packet data that is no answer to SYNC2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("no answer to SYNC2: found {texts} texts after byte 0x{first:02X}, expected 3 after 0x02")]
pub struct IdentityError {
    /// The first data byte; 2 in an answer to SYNC2.
    pub first: u8,
    /// Texts that follow it.
    pub texts: usize,
}

impl Identity {
    /// Reads the data of an answer to SYNC2: the byte 2, then three texts, each ended by NUL (the last NUL may be missing).
    ///
    /// # Errors
    /// Another packet, or fewer than three texts.
    pub fn decode(data: &[u8]) -> Result<Self, IdentityError> {
        let (&first, rest) = data.split_first().unwrap_or((&0, &[]));
        let texts: Vec<_> = rest.split(|&b| b == 0).map(|text| String::from_utf8_lossy(text).trim().to_owned()).collect();
        match texts.as_slice() {
            [name, class, subclass, ..] if first == number::SYNC2 => {
                Ok(Self { name: name.clone(), class: class.clone(), subclass: subclass.clone() })
            }
            _ => Err(IdentityError { first, texts: texts.iter().filter(|text| !text.is_empty()).count() }),
        }
    }

    /// The whole answer, ready to be sent by a robot.
    ///
    /// # Errors
    /// Texts that do not fit into a packet.
    pub fn encode(&self) -> Result<Vec<u8>, FrameError> {
        let mut data = vec![number::SYNC2];
        for text in [&self.name, &self.class, &self.subclass] {
            data.extend_from_slice(text.as_bytes());
            data.push(0);
        }
        frame::encode_frame(&data)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_both_ways() {
        let identity = Identity { name: "MobileSim".into(), class: "Pioneer".into(), subclass: "pion1x".into() };
        let data = b"\x02MobileSim\0Pioneer\0pion1x\0";
        assert_eq!(Identity::decode(data), Ok(identity.clone()));
        let packet = identity.encode().unwrap();
        assert_eq!(&packet[3..packet.len() - 2], data);
    }

    #[test]
    fn what_is_no_answer_is_refused() {
        assert_eq!(Identity::decode(&[2]), Err(IdentityError { first: 2, texts: 0 }));
        assert_eq!(Identity::decode(b"\x02a\0b"), Err(IdentityError { first: 2, texts: 2 }));
        assert_eq!(Identity::decode(b"\x01a\0b\0c\0"), Err(IdentityError { first: 1, texts: 3 }));
        assert_eq!(Identity::decode(&[]), Err(IdentityError { first: 0, texts: 0 }));
    }
}
