//! Sonar temporal difference (STD): what moves, as the sonars see it.
