//! The variables of Tables 3 to 5 with their sets, for people (Fig. 6).

use fuzzy::Partition;

use crate::parameters::{Parameters, ParametersError};
use crate::tables::evenly;

/// Words of a variable that counts from 0.
const MAGNITUDES: [&str; 5] = ["VS", "S", "M", "L", "VL"];
/// Words of a variable that counts to either side of 0.
const SIDES: [&str; 5] = ["NB", "NS", "Z", "PS", "PB"];

/// A variable of the fuzzy system.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Which, as the paper writes it.
    pub name: &'static str,
    /// What it is counted in.
    pub unit: &'static str,
    /// The words of its sets.
    pub words: [&'static str; 5],
    /// Its sets.
    pub sets: Partition,
}

/// The variables of the fuzzy system with these parameters.
///
/// # Errors
/// Parameters out of range.
pub fn variables(parameters: &Parameters) -> Result<Vec<Variable>, ParametersError> {
    parameters.check()?;
    let ranges = parameters.ranges();
    let half_m = ranges.width_m / 2.0;
    let all = [
        ("C and O centroid x, B centroid row", "ahead of the robot, m", MAGNITUDES, [0.0, ranges.forward_m]),
        ("C and O centroid y, B centroid column", "to the left of the robot, m", SIDES, [-half_m, half_m]),
        ("C and O size", "cells", MAGNITUDES, [0.0, ranges.cells]),
        ("B size", "px of a picture of 160 × 120", MAGNITUDES, [0.0, ranges.pixels]),
    ];
    let variable = |(name, unit, words, limits)| {
        let no_range = ParametersError::OutOfRange { name, found: ranges.width_m, expected: "a positive range" };
        Ok(Variable { name, unit, words, sets: Partition::new(evenly(limits)).map_err(|_| no_range)? })
    };
    all.into_iter().map(variable).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_variable_has_five_sets_over_its_range() {
        let all = variables(&Parameters::default()).unwrap();
        assert_eq!(all.len(), 4);
        assert_eq!((all[0].sets.centres()[4], all[2].sets.centres()[2]), (3.0, 50.0));
        assert_eq!(all[1].sets.centres()[2], 0.0);
        assert!(variables(&Parameters { range_limit_m: -1.0, ..Parameters::default() }).is_err());
    }
}
