//! What a robot said, decoded without a conversation: for recorded bytes.

use messages::SonarScan;
use psos::{Deframer, Identity, LinkCounters, Model, Sip, number};

use crate::odometry::{CYCLE_S, Track};
use crate::parameters::Parameters;
use crate::scanner::{Refusals, Scanner};

const CYCLE_NS: u64 = (CYCLE_S * 1e9) as u64;

/// Header, count and checksum.
const PACKET_OVERHEAD: u64 = 5;

/// The scans in a recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Recording {
    /// Who the robot says it is, if the recording has its handshake.
    pub identity: Option<Identity>,
    /// One scan for every status packet that is believed.
    pub scans: Vec<SonarScan>,
    /// What came over the link.
    pub link: LinkCounters,
    /// What was refused inside good packets.
    pub refusals: Refusals,
}

/// Decodes the bytes of a robot's side of a session. A recording has no times: packets count as a cycle apart, and where
/// bytes are damaged, as many cycles as packets would fit in between.
///
/// The factors are those of the model that the robot names, or of the parameters' if it names none that is known.
#[must_use]
pub fn decode(bytes: &[u8], parameters: &Parameters) -> Recording {
    let mut recording = Recording::default();
    let mut scanner = Scanner::new(parameters, parameters.model, Track::default());
    let (mut stamp_ns, mut last_start) = (0, None);
    let mut deframer = Deframer::new();
    for frame in deframer.push(bytes) {
        if frame.data.first() == Some(&number::SYNC2) {
            recording.identity = Identity::decode(&frame.data).ok();
            scanner.set_model(recording.identity.as_ref().and_then(Model::of).unwrap_or(parameters.model));
        } else if Sip::is_sip(&frame.data) {
            let between = last_start.replace(frame.start).map_or(0, |last| frame.start - last);
            let length = frame.data.len() as u64 + PACKET_OVERHEAD;
            stamp_ns += CYCLE_NS * ((between + length / 2) / length).max(1);
            match Sip::decode(&frame.data) {
                Ok(sip) => recording.scans.extend(scanner.scan(&sip, stamp_ns).ok()),
                Err(_) => scanner.refuse_packet(),
            }
        }
    }
    recording.link = deframer.counters();
    recording.refusals = scanner.refusals();
    recording
}
