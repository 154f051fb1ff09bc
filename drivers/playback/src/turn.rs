//! Which of several streams has its turn.

/// The message of a stream that comes next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Head {
    /// Its stamp, ns.
    pub stamp_ns: u64,
    /// Whether the stream's consumers leave room for it.
    pub has_room: bool,
    /// Stamp of the message of the stream that was sent last, ns.
    pub last_ns: u64,
}

/// Which stream sends next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Turn {
    /// The next message is that of this stream.
    Of(usize),
    /// Nothing may be sent before a consumer has answered.
    Hold,
    /// All streams have ended.
    Over,
}

/// The stream whose message goes next: the earliest in sensor time.
///
/// If that stream has to wait for its consumers, another may send one message beyond it: a consumer that joins two streams answers a
/// message of one only when it knows that the other has no earlier message.
#[must_use]
pub fn turn(heads: &[Option<Head>]) -> Turn {
    let heads = || heads.iter().enumerate().filter_map(|(stream, head)| Some((stream, (*head)?)));
    let Some((first, earliest)) = heads().min_by_key(|(_, head)| head.stamp_ns) else { return Turn::Over };
    if earliest.has_room {
        return Turn::Of(first);
    }
    let others = heads().filter(|(_, head)| head.has_room && head.last_ns <= earliest.stamp_ns);
    others.min_by_key(|(_, head)| head.stamp_ns).map_or(Turn::Hold, |(stream, _)| Turn::Of(stream))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn head(stamp_ns: u64, has_room: bool, last_ns: u64) -> Option<Head> {
        Some(Head { stamp_ns, has_room, last_ns })
    }

    #[test]
    fn sensor_time_decides() {
        assert_eq!(turn(&[head(5, true, 1), head(4, true, 2)]), Turn::Of(1));
        assert_eq!(turn(&[head(5, true, 1), None]), Turn::Of(0));
        assert_eq!(turn(&[head(5, true, 1), head(5, true, 1)]), Turn::Of(0));
        assert_eq!(turn(&[None, None]), Turn::Over);
    }

    #[test]
    fn one_message_may_pass_one_that_waits() {
        assert_eq!(turn(&[head(5, false, 1), head(6, true, 4)]), Turn::Of(1));
        assert_eq!(turn(&[head(5, false, 1), head(8, true, 6)]), Turn::Hold);
        assert_eq!(turn(&[head(5, false, 1), head(6, false, 4)]), Turn::Hold);
        assert_eq!(turn(&[head(5, false, 1), None]), Turn::Hold);
    }

    proptest! {
        /// One consumer answers a scan when it has a frame that is no older, another answers each frame at once: everything is sent at
        /// any rate and window, and no stream is ahead by more than one message.
        #[test]
        fn a_consumer_that_joins_two_streams_never_stops_them(
            gaps in [prop::collection::vec(0u64..50, 0..60), prop::collection::vec(0u64..50, 0..60)],
            window in 1usize..4,
        ) {
            let stamps = gaps.map(|gaps| gaps.iter().scan(1, |at, gap| { *at += gap; Some(*at) }).collect::<Vec<u64>>());
            let (mut sent, mut joined) = ([0; 2], 0);
            loop {
                let has_room = [sent[0] - joined < window, true];
                let last = |stream: usize| sent[stream].checked_sub(1).map_or(0, |at: usize| stamps[stream][at]);
                let heads = [0, 1].map(|stream| {
                    let stamp_ns = *stamps[stream].get(sent[stream])?;
                    head(stamp_ns, has_room[stream], last(stream))
                });
                match turn(&heads) {
                    Turn::Of(stream) => sent[stream] += 1,
                    Turn::Hold => prop_assert!(false, "stuck at {sent:?} of {stamps:?}, joined {joined}"),
                    Turn::Over => break,
                }
                let frames_ended = sent[1] == stamps[1].len();
                let frame_ns = sent[1].checked_sub(1).map_or(0, |at| stamps[1][at]);
                while joined < sent[0] && (frames_ended || frame_ns >= stamps[0][joined]) {
                    joined += 1;
                }
                if let Some(waiting) = stamps[0].get(sent[0]) {
                    prop_assert!(stamps[1][..sent[1]].iter().filter(|stamp| *stamp > waiting).count() <= 1);
                }
            }
            prop_assert_eq!(joined, stamps[0].len());
        }
    }
}
