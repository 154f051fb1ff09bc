//! What real terminals, machines and logs do to a deployment.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod diagnosis;
mod harness;
mod machine;
mod terminal;
