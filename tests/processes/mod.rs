//! Single processes on a bus of their own: what they publish is what their fold gives.

mod mapping;
mod pioneer;
mod playback;
mod sbs;
mod simulator;
#[path = "../../services/sbs/tests/common/wall.rs"]
mod wall;
