//! Chance without a state.

/// A number that follows from a seed and a place alone, evenly spread (SplitMix64 over both).
pub(crate) fn draw(seed: u64, place: u64, turn: u64) -> u64 {
    let mut z =
        seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ place.wrapping_mul(0xd134_2543_de82_ef95) ^ turn.wrapping_mul(0xa076_1d64_78bd_642f);
    for _ in 0..2 {
        z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
    }
    z
}

/// Whether something of this probability, 0 to 1, happens.
pub(crate) fn happens(seed: u64, place: u64, probability: f64) -> bool {
    ((draw(seed, place, 0) >> 11) as f64) < probability * (1_u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_probability_is_the_share_of_places() {
        for (probability, low, high) in [(0.0, 0, 0), (0.1, 900, 1_100), (0.5, 4_850, 5_150), (1.0, 10_000, 10_000)] {
            let count = (1..=10_000).filter(|place| happens(7, *place, probability)).count();
            assert!((low..=high).contains(&count), "{count} of 10000 at {probability}");
        }
        let hit = |seed| (1..=64).map(|place| happens(seed, place, 0.5)).collect::<Vec<_>>();
        assert_eq!(hit(1), hit(1));
        assert_ne!(hit(1), hit(2));
    }
}
