//! When a cell counts as occupied.

/// Occupancy above which a cell is occupied: map_server's own default of `occupied_thresh`, so that a robot that plans on the files
/// Occupancy above which a cell is occupied: the `occupied_thresh` that map_saver writes, so that a robot that plans on the files
/// sees the walls that the evaluation counts.
pub const OCCUPIED: f64 = 0.65;

/// [`OCCUPIED`] as log-odds, ln (0.65 / 0.35).
const OCCUPIED_LOG_ODDS: f32 = 0.619_039_24;

/// Whether a cell of these log-odds is occupied.
#[must_use]
pub fn is_occupied(log_odds: f32) -> bool {
    log_odds > OCCUPIED_LOG_ODDS
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrate::probability;

    #[test]
    fn log_odds_and_occupancy_have_one_threshold() {
        assert_eq!(OCCUPIED_LOG_ODDS, (OCCUPIED / (1.0 - OCCUPIED)).ln() as f32);
        for log_odds in [-2.0, 0.0, OCCUPIED_LOG_ODDS.next_down(), OCCUPIED_LOG_ODDS.next_up(), 0.7, 2.0] {
            assert_eq!(is_occupied(log_odds), probability(log_odds) > OCCUPIED, "{log_odds}");
        }
    }
}
