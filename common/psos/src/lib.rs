//! The Pioneer serial protocol (PSOS and P2OS): framing, packets, robot models.
