//! The log of a drive: MCAP files of what was on the bus, written, read, recovered and imported.
