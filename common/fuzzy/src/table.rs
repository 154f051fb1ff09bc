//! Full rule tables and what they infer.

use crate::Partition;

/// A full rule table over `N` inputs: one output centre for each combination of their sets.
#[derive(Debug, Clone, PartialEq)]
pub struct RuleTable<const N: usize> {
    inputs: [Partition; N],
    /// Output centres; the sets of the last input vary fastest.
    outputs: Vec<f64>,
}

/// Output centres that do not fill a table.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TableError {
    /// Not one rule for each combination of sets.
    #[error("{found} rules, expected {expected}: one for each combination of sets")]
    Incomplete {
        /// Rules given.
        found: usize,
        /// Combinations of sets.
        expected: usize,
    },
    /// An output centre that is not a number or infinite.
    #[error("rule {index} gives {found}, expected a finite number")]
    NotFinite {
        /// Place of the rule, from 0, the sets of the last input varying fastest.
        index: usize,
        /// Its output centre.
        found: f64,
    },
}

impl<const N: usize> RuleTable<N> {
    /// The table with these inputs and output centres; the sets of the last input vary fastest (row by row for two inputs).
    ///
    /// # Errors
    /// Not exactly one output for each combination of sets, or an output that is not finite.
    pub fn new(inputs: [Partition; N], outputs: Vec<f64>) -> Result<Self, TableError> {
        let expected = inputs.iter().map(|p| p.centres().len()).product();
        if outputs.len() != expected {
            return Err(TableError::Incomplete { found: outputs.len(), expected });
        }
        match outputs.iter().position(|o| !o.is_finite()) {
            Some(index) => Err(TableError::NotFinite { index, found: outputs[index] }),
            None => Ok(Self { inputs, outputs }),
        }
    }

    /// The output for these inputs (eq. 1). Inputs outside their variable's range are clamped.
    #[must_use]
    pub fn infer(&self, x: [f64; N]) -> f64 {
        self.infer_from(0, 0, &x)
    }

    /// Eq. 1 over the inputs from `input` on, within the rules that begin with the sets chosen so far. Only the two sets
    /// that `x` lies between have a membership; the sum of memberships, eq. 1's denominator, is 1.
    fn infer_from(&self, input: usize, chosen: usize, x: &[f64; N]) -> f64 {
        let Some(partition) = self.inputs.get(input) else { return self.outputs[chosen] };
        let between = partition.locate(x[input]);
        let of_set = |set| self.infer_from(input + 1, chosen * partition.centres().len() + set, x);
        let upper = between.upper_membership;
        (1.0 - upper) * of_set(between.lower) + upper * of_set(between.lower + 1)
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
    fn a_rule_is_met_exactly_where_its_sets_peak() {
        let rows = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let table = RuleTable::new([partition(&[0.0, 1.0]), partition(&[0.0, 1.0, 2.0])], rows.to_vec()).expect("complete");
        for (index, rule) in rows.iter().enumerate() {
            assert_eq!(table.infer([(index / 3) as f64, (index % 3) as f64]), *rule);
        }
        assert_eq!(table.infer([0.5, 0.5]), (1.0 + 2.0 + 4.0 + 5.0) / 4.0);
    }

    #[test]
    fn one_and_three_inputs_are_the_same_sum() {
        let one = RuleTable::new([partition(&[0.0, 2.0])], vec![10.0, 20.0]).expect("complete");
        assert_eq!(one.infer([0.5]), 12.5);
        let sets = || partition(&[0.0, 1.0]);
        let parity = vec![0.0, 1.0, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0];
        let three = RuleTable::new([sets(), sets(), sets()], parity).expect("complete");
        assert_eq!(three.infer([1.0, 0.0, 1.0]), 0.0);
        assert_eq!(three.infer([0.5, 1.0, 1.0]), 0.5);
    }

    #[test]
    fn tables_with_gaps_are_refused_with_their_numbers() {
        let inputs = || [partition(&[0.0, 1.0]), partition(&[0.0, 1.0, 2.0])];
        let error = |outputs: Vec<f64>| RuleTable::new(inputs(), outputs).expect_err("invalid table").to_string();
        assert_eq!(error(vec![0.0; 5]), "5 rules, expected 6: one for each combination of sets");
        assert_eq!(error(vec![0.0; 7]), "7 rules, expected 6: one for each combination of sets");
        assert_eq!(error(vec![0.0, 0.0, f64::INFINITY, 0.0, 0.0, 0.0]), "rule 2 gives inf, expected a finite number");
    }

    proptest! {
        #[test]
        fn the_output_stays_among_the_rules(outputs in proptest::collection::vec(-1e3..1e3f64, 9), x in proptest::array::uniform2(-2.0..4.0f64)) {
            let sets = || partition(&[0.0, 0.3, 2.0]);
            let low = outputs.iter().copied().fold(f64::INFINITY, f64::min);
            let high = outputs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let y = RuleTable::new([sets(), sets()], outputs).expect("complete").infer(x);
            prop_assert!(y >= low - 1e-9 && y <= high + 1e-9);
        }
    }
}
