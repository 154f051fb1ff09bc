//! Playback of a recorded log in place of the drivers.
