//! What a simulator keeps between its incarnations: how far the drive has come.

/// How far the drive has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct DriveState {
    /// Packets made of the drive.
    pub(super) packets: u64,
    /// Packets sent to a client.
    pub(super) sent: u64,
}

impl DriveState {
    pub(super) fn to_bytes(self) -> [u8; 16] {
        let mut bytes = [0; 16];
        bytes[..8].copy_from_slice(&self.packets.to_le_bytes());
        bytes[8..].copy_from_slice(&self.sent.to_le_bytes());
        bytes
    }

    /// `None` for bytes that are no drive state.
    pub(super) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (packets, sent) = <&[u8; 16]>::try_from(bytes).ok()?.split_at(8);
        let number = |bytes: &[u8]| Some(u64::from_le_bytes(bytes.try_into().ok()?));
        Some(Self { packets: number(packets)?, sent: number(sent)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ways() {
        let state = DriveState { packets: 7, sent: u64::MAX - 1 };
        assert_eq!(DriveState::from_bytes(&state.to_bytes()), Some(state));
        assert_eq!(DriveState::from_bytes(&[0; 15]), None);
        assert_eq!(DriveState::from_bytes(&[0; 17]), None);
    }
}
