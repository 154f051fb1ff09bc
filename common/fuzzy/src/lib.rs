//! Fuzzy inference (paper eq. 1): partitions, rule tables, centre-average defuzzifier.
