//! Random numbers without a state.

/// A uniform number that depends on a seed, a position and a turn alone (SplitMix64).
pub(crate) fn draw(seed: u64, position: u64, turn: u64) -> u64 {
    let mut z =
        seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ position.wrapping_mul(0xd134_2543_de82_ef95) ^ turn.wrapping_mul(0xa076_1d64_78bd_642f);
    for _ in 0..2 {
        z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
    }
    z
}

/// Whether an event of this probability, 0 to 1, occurs at this position.
pub(crate) fn occurs(seed: u64, position: u64, probability: f64) -> bool {
    ((draw(seed, position, 0) >> 11) as f64) < probability * (1_u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_occur_at_their_probability() {
        for (probability, low, high) in [(0.0, 0, 0), (0.1, 900, 1_100), (0.5, 4_850, 5_150), (1.0, 10_000, 10_000)] {
            let count = (1..=10_000).filter(|position| occurs(7, *position, probability)).count();
            assert!((low..=high).contains(&count), "{count} of 10000 at {probability}");
        }
        let hit = |seed| (1..=64).map(|position| occurs(seed, position, 0.5)).collect::<Vec<_>>();
        assert_eq!(hit(1), hit(1));
        assert_ne!(hit(1), hit(2));
    }
}
