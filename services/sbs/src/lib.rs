//! Statistical background subtraction on a moving camera (SBS).
