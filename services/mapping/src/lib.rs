//! Fuzzy-tuned grid-based mapping (FTGBM), the owner of the map.
