//! Whole deployments: the `stillmap` command and its processes, observed from outside.
//!
//! One binary, so that the product is linked once. Its tests run as threads of one process, so none of them changes the environment, the
//! working directory or the limits of that process: each has a [`harness::Sandbox`] and sets them for the commands that it starts.
//!
//! They take minutes, and longer with an unoptimised product: `cargo test` without arguments leaves them out. In a development build they
//! are run by name:
//!
//!     cargo build --example text_driver
//!     cargo test --features deployments --test stillmap [PART OF A NAME]
//!
//! Three tests are run by name in any build: [`soak`] with a thousand kills, [`memory`] over an hour of driving, and [`conditions`] with
//! a hundred deployments; each says how.
#![cfg(any(clippy, feature = "deployments", not(debug_assertions)))]
#![expect(
    clippy::unwrap_used,
    clippy::panic,
    clippy::float_cmp,
    clippy::print_stderr,
    reason = "tests fail by panicking, on exact values where these are exact, and say what they skip"
)]

mod bad_input;
mod bags;
mod browser;
mod conditions;
mod diagnosis;
mod drive;
mod driver_kills;
mod environment;
mod evaluate_camera;
mod faults;
mod filtering;
mod harness;
mod kills;
mod line_noise;
mod live_page;
mod localisation;
mod log_loss;
mod machine;
mod map_export;
mod memory;
mod no_space;
mod observers;
mod output_lock;
mod own_driver;
mod processes;
mod real_robot;
mod removed_files;
mod replay_kills;
mod resources;
mod resume;
mod robot_ports;
mod security;
mod slow_consumer;
mod soak;
mod terminal;
mod topic;
mod verbs;
