//! The unbounded tiled lattice that maps are made of.
