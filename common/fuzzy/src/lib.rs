#![cfg_attr(
    test,
    allow(
        clippy::unwrap_used,
        clippy::panic,
        clippy::float_cmp,
        reason = "tests fail by panicking, on exact values where these are exact"
    )
)]

//! Fuzzy inference (paper eq. 1): singleton fuzzifier, product inference, centre-average defuzzifier.
//!
//! A [`Partition`] holds the fuzzy sets of one input: triangles given by their centres, with shoulders at both ends. Its
//! memberships sum to 1, so the denominator of eq. 1 is 1 and every input is covered. A [`RuleTable`] holds one output
//! centre for each combination of sets and infers the output.
//!
//! Both are refused when they are made from numbers that are not valid: centres out of order, a table with gaps.

mod partition;
mod table;

pub use partition::{Between, Partition, PartitionError};
pub use table::{RuleTable, TableError};
