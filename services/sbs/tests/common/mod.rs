//! Pictures of a wall, and a step with one of them.
#![allow(dead_code, unused_imports, reason = "each test uses its part")]

use messages::FrameLayout;
use stillmap_sbs::{Answer, Frame, State};

mod wall;
pub(crate) use wall::{Figure, PERIOD_NS, grey, picture};

/// Steps with picture number `n` of a grey sequence.
pub(crate) fn step(state: &mut State, n: u64, layout: FrameLayout, bytes: &[u8]) -> Answer {
    state.step(&Frame { stamp_ns: (n + 1) * PERIOD_NS, layout, bytes, odometry: None })
}
