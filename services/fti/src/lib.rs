//! Fuzzy-tuned integration (FTI): which readings a moving thing caused.
