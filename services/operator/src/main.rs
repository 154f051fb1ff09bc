//! The `stillmap` command.
fn main() {}
