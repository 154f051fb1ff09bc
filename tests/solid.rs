//! What real terminals, machines and logs do to a deployment.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod harness;

#[path = "solid/diagnosis.rs"]
mod diagnosis;
#[path = "solid/machine.rs"]
mod machine;
#[path = "solid/terminal.rs"]
mod terminal;
