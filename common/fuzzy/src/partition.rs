//! The fuzzy sets of one input variable.

/// Triangular sets over one variable, by their centres; the first and last are shoulders.
///
/// Set k rises from centre k − 1 to 1 at centre k and falls to 0 at centre k + 1; the first and the last stay 1 outside.
#[derive(Debug, Clone, PartialEq)]
pub struct Partition {
    centres: Vec<f64>,
}

/// Where a value lies: between two neighbouring sets, or on one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Between {
    /// The set at or below the value; the set above is `lower + 1`.
    pub lower: usize,
    /// Membership of the set above, 0 to 1; the set at `lower` has the rest, all others have none.
    pub upper_membership: f64,
}

/// Centres that make no partition.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PartitionError {
    /// One set, or none, tells nothing apart.
    #[error("{found} centres, expected at least 2")]
    TooFew {
        /// Centres given.
        found: usize,
    },
    /// A centre that is not a number or infinite.
    #[error("centre {index} is {found}, expected a finite number")]
    NotFinite {
        /// Place of the centre, from 0.
        index: usize,
        /// Its value.
        found: f64,
    },
    /// A centre that is not above the one before it.
    #[error("centre {index} is {found}, expected more than {before}, the one before it")]
    OutOfOrder {
        /// Place of the centre, from 0.
        index: usize,
        /// Its value.
        found: f64,
        /// The centre before it.
        before: f64,
    },
}

impl Partition {
    /// The partition with these centres, in the unit of the variable.
    ///
    /// # Errors
    /// Fewer than two centres, one that is not finite, or one that is not above the one before it.
    pub fn new(centres: Vec<f64>) -> Result<Self, PartitionError> {
        if centres.len() < 2 {
            return Err(PartitionError::TooFew { found: centres.len() });
        }
        if let Some((index, &found)) = centres.iter().enumerate().find(|(_, c)| !c.is_finite()) {
            return Err(PartitionError::NotFinite { index, found });
        }
        for (index, pair) in centres.windows(2).enumerate() {
            if pair[1] <= pair[0] {
                return Err(PartitionError::OutOfOrder { index: index + 1, found: pair[1], before: pair[0] });
            }
        }
        Ok(Self { centres })
    }

    /// The centres, ascending.
    #[must_use]
    pub fn centres(&self) -> &[f64] {
        &self.centres
    }

    /// The two neighbouring sets that share the membership of `x`; values outside are clamped to the nearest centre, and
    /// what is not a number counts as the first.
    #[must_use]
    pub fn locate(&self, x: f64) -> Between {
        let last_pair = self.centres.len() - 2;
        let above = self.centres.iter().take_while(|c| **c <= x).count();
        let lower = above.saturating_sub(1).min(last_pair);
        let (low, high) = (self.centres[lower], self.centres[lower + 1]);
        // Halves first: the distance of two finite centres may overflow, half of it does not.
        let share = (x * 0.5 - low * 0.5) / (high * 0.5 - low * 0.5);
        let upper_membership = if share > 0.0 { share.min(1.0) } else { 0.0 };
        Between { lower, upper_membership }
    }

    /// Membership of `x` in set `k`, 0 to 1; 0 for a set that does not exist.
    #[must_use]
    pub fn membership(&self, k: usize, x: f64) -> f64 {
        let between = self.locate(x);
        match k {
            k if k == between.lower => 1.0 - between.upper_membership,
            k if k == between.lower + 1 => between.upper_membership,
            _ => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn partition(centres: &[f64]) -> Partition {
        Partition::new(centres.to_vec()).expect("the centres are valid")
    }

    #[test]
    fn a_set_peaks_at_its_centre_and_ends_at_its_neighbours() {
        let p = partition(&[0.5, 0.7, 0.9]);
        let at = |x| [p.membership(0, x), p.membership(1, x), p.membership(2, x)];
        assert_eq!(at(0.5), [1.0, 0.0, 0.0]);
        assert_eq!(at(0.7), [0.0, 1.0, 0.0]);
        assert_eq!(at(0.9), [0.0, 0.0, 1.0]);
        assert!((p.membership(0, 0.65) - 0.25).abs() < 1e-12);
        assert!((p.membership(1, 0.65) - 0.75).abs() < 1e-12);
    }

    #[test]
    fn the_outer_sets_are_shoulders() {
        let p = partition(&[0.5, 0.7, 0.9]);
        assert_eq!(p.membership(0, -1e300), 1.0);
        assert_eq!(p.membership(2, f64::INFINITY), 1.0);
        assert_eq!(p.membership(0, f64::NAN), 1.0);
        assert_eq!(p.membership(3, 0.9), 0.0);
    }

    #[test]
    fn centres_out_of_order_are_refused_with_their_numbers() {
        let error = |centres: &[f64]| Partition::new(centres.to_vec()).expect_err("invalid centres").to_string();
        assert_eq!(error(&[]), "0 centres, expected at least 2");
        assert_eq!(error(&[1.0]), "1 centres, expected at least 2");
        assert_eq!(error(&[0.0, f64::NAN]), "centre 1 is NaN, expected a finite number");
        assert_eq!(error(&[0.5, 0.7, 0.7]), "centre 2 is 0.7, expected more than 0.7, the one before it");
        assert_eq!(error(&[0.5, 0.4, 0.7]), "centre 1 is 0.4, expected more than 0.5, the one before it");
    }

    proptest! {
        #[test]
        fn memberships_sum_to_one(
            mut centres in proptest::collection::vec(-1e6..1e6f64, 2..9),
            x in prop_oneof![-2e6..2e6f64, proptest::num::f64::ANY],
        ) {
            centres.sort_by(f64::total_cmp);
            centres.dedup();
            prop_assume!(centres.len() >= 2);
            let p = partition(&centres);
            let memberships: Vec<f64> = (0..centres.len()).map(|k| p.membership(k, x)).collect();
            prop_assert!(memberships.iter().all(|m| (0.0..=1.0).contains(m)), "{memberships:?}");
            prop_assert!((memberships.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }

        #[test]
        fn a_partition_is_made_or_refused_but_never_breaks(centres in proptest::collection::vec(proptest::num::f64::ANY, 0..6), x in proptest::num::f64::ANY) {
            if let Ok(p) = Partition::new(centres) {
                prop_assert!((0.0..=1.0).contains(&p.locate(x).upper_membership));
            }
        }
    }
}
