//! A simulated world with walkers: a Pioneer behind a pseudo-terminal, with ground truth.
