//! Framing: finding packets in a stream of bytes, and making them.
//!
//! A packet is `FA FB`, a count byte, the data and a two-byte checksum; the count is the data's length + 2. Nothing escapes
//! the header inside the data, so after a lost or damaged byte the only way back is to try every header that is seen.

use thiserror::Error;

/// The two bytes that every packet starts with.
pub const HEADER: [u8; 2] = [0xFA, 0xFB];

/// Most data bytes of a packet that PSOS and P2OS take (count at most 200).
pub const MAX_DATA: usize = 198;

/// Header, count and checksum: the bytes of a packet that are not data.
const OVERHEAD: usize = 5;

/// A packet whose checksum agrees, without its header and checksum.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// Position of the packet's first byte in the stream, counted from the first byte ever pushed.
    pub start: u64,
    /// Type or command number, then its content; 1 to 253 bytes.
    pub data: Vec<u8>,
}

/// What came over the link so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LinkCounters {
    /// Packets whose checksum agrees.
    pub packets: u64,
    /// Headers that were followed by a wrong checksum, or that gave way to a good packet inside what they announced.
    pub bad_checksums: u64,
    /// Bytes that belong to no good packet.
    pub skipped_bytes: u64,
}

/// Turns a stream of bytes into packets.
///
/// A packet is handed out as soon as its last byte has come, wherever it starts: also inside a damaged packet that announced
/// more bytes than it has, so that one bad count byte delays nothing. How the stream is cut into pushes makes no difference.
#[derive(Debug, Clone, Default)]
pub struct Deframer {
    /// Bytes from the earliest open header on; empty or starting with `FA`.
    buffer: Vec<u8>,
    /// Stream position of `buffer[0]`.
    buffer_start: u64,
    /// Bytes pushed so far.
    pushed: u64,
    counters: LinkCounters,
}

impl Deframer {
    /// A deframer at the start of a stream.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes the next bytes of the stream and returns the packets that they complete.
    pub fn push(&mut self, bytes: &[u8]) -> Vec<Frame> {
        bytes.iter().filter_map(|&byte| self.push_byte(byte)).collect()
    }

    /// Forgets a packet that has begun; its bytes count as skipped. For a line whose other end starts anew.
    pub fn flush(&mut self) {
        self.counters.skipped_bytes += self.buffer.len() as u64;
        self.buffer.clear();
    }

    /// Bytes of the stream pushed so far: the position of the next byte.
    #[must_use]
    pub fn position(&self) -> u64 {
        self.pushed
    }

    /// Position of the first byte that may still become part of a packet.
    #[must_use]
    pub fn open_from(&self) -> u64 {
        self.pushed - self.buffer.len() as u64
    }

    /// What came over the link so far.
    #[must_use]
    pub fn counters(&self) -> LinkCounters {
        self.counters
    }

    fn push_byte(&mut self, byte: u8) -> Option<Frame> {
        if self.buffer.is_empty() {
            self.buffer_start = self.pushed;
        }
        self.pushed += 1;
        self.buffer.push(byte);

        let mut start = 0;
        while start < self.buffer.len() {
            match examine(&self.buffer[start..]) {
                Candidate::Good(data) => return Some(self.take_good(start, data)),
                Candidate::Bad => self.counters.bad_checksums += 1,
                Candidate::Open | Candidate::Over | Candidate::NoHeader => {}
            }
            start += 1;
        }
        self.drop_hopeless();
        None
    }

    /// Everything before a good packet is lost: it can no longer complete without overlapping it.
    fn take_good(&mut self, start: usize, data: Vec<u8>) -> Frame {
        let abandoned = (0..start).filter(|&s| matches!(examine(&self.buffer[s..]), Candidate::Open)).count();
        self.counters.bad_checksums += abandoned as u64;
        self.counters.skipped_bytes += start as u64;
        self.counters.packets += 1;
        self.buffer.clear();
        Frame { start: self.buffer_start + start as u64, data }
    }

    /// Keeps the bytes from the first header that may still become a packet.
    fn drop_hopeless(&mut self) {
        let keep = (0..self.buffer.len()).find(|&s| matches!(examine(&self.buffer[s..]), Candidate::Open)).unwrap_or(self.buffer.len());
        self.buffer.drain(..keep);
        self.buffer_start += keep as u64;
        self.counters.skipped_bytes += keep as u64;
    }
}

/// What the bytes from some place on may be.
enum Candidate {
    NoHeader,
    /// A header whose packet is not complete yet.
    Open,
    /// A complete packet that ends with the last byte buffer.
    Good(Vec<u8>),
    /// Complete with the last byte buffer, and its checksum is wrong.
    Bad,
    /// It ended before the last byte buffer, and was found bad then.
    Over,
}

fn examine(bytes: &[u8]) -> Candidate {
    if !bytes.iter().zip(HEADER).all(|(a, b)| *a == b) {
        return Candidate::NoHeader;
    }
    let Some(&count) = bytes.get(2) else { return Candidate::Open };
    // A packet without data says nothing: such a header is noise.
    if count < 3 {
        return Candidate::NoHeader;
    }
    let length = usize::from(count) + 3;
    match bytes.len().cmp(&length) {
        std::cmp::Ordering::Less => Candidate::Open,
        std::cmp::Ordering::Greater => Candidate::Over,
        std::cmp::Ordering::Equal => {
            let (data, sum) = bytes[3..].split_at(length - OVERHEAD);
            if checksum(data).to_be_bytes() == *sum { Candidate::Good(data.to_vec()) } else { Candidate::Bad }
        }
    }
}

/// The checksum of a packet's data: the sum of its big-endian byte pairs modulo 2^16, an odd last byte exclusive-ored in.
#[must_use]
pub fn checksum(data: &[u8]) -> u16 {
    let pairs = data.chunks_exact(2);
    let odd = pairs.remainder().first().copied().unwrap_or(0);
    let sum = pairs.fold(0_u16, |sum, pair| sum.wrapping_add(u16::from_be_bytes([pair[0], pair[1]])));
    sum ^ u16::from(odd)
}

/// Data that makes no packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum FrameError {
    /// A packet carries at least one byte.
    #[error("a packet needs data: found 0 bytes, expected 1 to {MAX_DATA}")]
    Empty,
    /// Longer than the robots take.
    #[error("packet data too long: found {found} bytes, expected 1 to {MAX_DATA}")]
    TooLong {
        /// Length of the data.
        found: usize,
    },
}

/// A whole packet, ready to be sent: header, count, data, checksum.
///
/// # Errors
/// No data, or more than [`MAX_DATA`] bytes of it.
pub fn encode_frame(data: &[u8]) -> Result<Vec<u8>, FrameError> {
    if data.is_empty() {
        return Err(FrameError::Empty);
    }
    if data.len() > MAX_DATA {
        return Err(FrameError::TooLong { found: data.len() });
    }
    let mut packet = Vec::with_capacity(data.len() + OVERHEAD);
    packet.extend_from_slice(&HEADER);
    packet.push((data.len() + 2) as u8);
    packet.extend_from_slice(data);
    packet.extend_from_slice(&checksum(data).to_be_bytes());
    Ok(packet)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_of_the_manual() {
        assert_eq!(encode_frame(&[1]), Ok(vec![0xFA, 0xFB, 3, 1, 0, 1]), "OPEN");
        assert_eq!(encode_frame(&[4, 0x3B, 1, 0]), Ok(vec![0xFA, 0xFB, 6, 4, 0x3B, 1, 0, 5, 0x3B]), "ENABLE 1");
    }

    #[test]
    fn an_odd_last_byte_is_exclusive_ored_into_the_low_byte() {
        assert_eq!(checksum(&[0x01, 0xFF, 0x03]), 0x01FC);
        assert_eq!(checksum(&[0xFF, 0xFF, 0x00, 0x02]), 0x0001, "the sum drops its carry");
    }

    #[test]
    fn data_that_makes_no_packet_is_refused() {
        assert_eq!(encode_frame(&[]), Err(FrameError::Empty));
        assert_eq!(encode_frame(&[7; 199]), Err(FrameError::TooLong { found: 199 }));
        assert!(encode_frame(&[7; 198]).is_ok());
    }

    #[test]
    fn a_packet_is_out_with_its_last_byte() {
        let packet = encode_frame(&[2, 3, 4]).unwrap();
        let mut deframer = Deframer::new();
        let (last, head) = packet.split_last().unwrap();
        assert!(deframer.push(head).is_empty());
        assert_eq!(deframer.push(&[*last]), vec![Frame { start: 0, data: vec![2, 3, 4] }]);
        assert_eq!(deframer.counters(), LinkCounters { packets: 1, bad_checksums: 0, skipped_bytes: 0 });
    }

    #[test]
    fn a_wrong_count_does_not_delay_the_packets_it_swallows() {
        let good = encode_frame(&[9, 8]).unwrap();
        let mut bytes = vec![0xFA, 0xFB, 249, 1, 2];
        bytes.extend(&good);
        let mut deframer = Deframer::new();
        assert_eq!(deframer.push(&bytes), vec![Frame { start: 5, data: vec![9, 8] }]);
        assert_eq!(deframer.counters(), LinkCounters { packets: 1, bad_checksums: 1, skipped_bytes: 5 });
    }

    #[test]
    fn a_repeated_header_byte_costs_that_byte() {
        let mut bytes = vec![0xFA, 0xFA];
        bytes.extend(&encode_frame(&[5]).unwrap()[1..]);
        let mut deframer = Deframer::new();
        assert_eq!(deframer.push(&bytes).len(), 1);
        assert_eq!(deframer.counters(), LinkCounters { packets: 1, bad_checksums: 0, skipped_bytes: 1 });
    }

    #[test]
    fn positions_and_flush() {
        let mut deframer = Deframer::new();
        deframer.push(&[1, 2, 0xFA, 0xFB, 9]);
        assert_eq!((deframer.position(), deframer.open_from()), (5, 2));
        deframer.flush();
        assert_eq!((deframer.position(), deframer.open_from(), deframer.counters().skipped_bytes), (5, 5, 5));
        assert_eq!(deframer.push(&encode_frame(&[1]).unwrap()), vec![Frame { start: 5, data: vec![1] }]);
    }
}
