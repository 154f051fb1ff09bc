//! Packets that arrive twice: some serial bridges repeat what they send. A robot at rest sends equal packets, too.

use psos::Sip;

/// Sum of the wheels' speeds, in the robot's units, from which on two packets of a robot differ: 20 mm/s move the counters by two
/// units between two packets.
const MOVING: i32 = 40;

/// Of the last sixteen packets every other one is equal to the one before: a line that doubles what it carries. A robot at rest sends
/// packets that are all equal, or none.
const ALTERNATING: u16 = 0x5555;

/// Tells a packet that was sent twice from the next one of a robot at rest.
#[derive(Debug, Clone, Default)]
pub(crate) struct Duplicates {
    last: Vec<u8>,
    /// Whether each of the last packets was equal to the one before, the newest in the lowest bit.
    equal: u16,
    count: u64,
}

impl Duplicates {
    /// Whether the data of a status packet is the packet before once more.
    pub(crate) fn is_duplicate(&mut self, data: &[u8]) -> bool {
        let equal = data == self.last;
        self.equal = self.equal << 1 | u16::from(equal);
        if equal && (is_moving(data) || self.equal == ALTERNATING) {
            self.count += 1;
            return true;
        }
        self.last.clear();
        self.last.extend_from_slice(data);
        false
    }

    /// Packets that came twice.
    pub(crate) fn count(&self) -> u64 {
        self.count
    }
}

fn is_moving(data: &[u8]) -> bool {
    Sip::decode(data).is_ok_and(|sip| i32::from(sip.left_velocity).abs() + i32::from(sip.right_velocity).abs() >= MOVING)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Feeds packets of a robot at rest and returns how many are duplicates.
    fn at_rest(packets: impl IntoIterator<Item = u8>) -> u64 {
        let mut duplicates = Duplicates::default();
        for content in packets {
            duplicates.is_duplicate(&[content]);
        }
        duplicates.count()
    }

    #[test]
    fn a_moving_robot_sends_no_two_equal_packets() {
        let mut data = [0; 20];
        (data[0], data[7]) = (0x32, 79);
        let mut duplicates = Duplicates::default();
        assert_eq!([0; 3].map(|_| duplicates.is_duplicate(&data)), [false, true, true]);
        data[1] = 4;
        assert!(!duplicates.is_duplicate(&data));
    }

    #[test]
    fn of_a_robot_at_rest_every_other_packet_is_a_duplicate() {
        assert_eq!(at_rest((0..100).flat_map(|content| [content; 2])), 93, "all but those before the rule shows");
    }

    #[test]
    fn the_equal_packets_of_a_robot_at_rest_all_count() {
        assert_eq!(at_rest((0..100).map(|_| 7)), 0);
        assert_eq!(at_rest((0..100).map(|packet| packet / 10)), 0);
        assert_eq!(at_rest(0..100), 0);
    }
}
