//! A stack that is large enough, whatever limit the command was started under.

use rustix::process::{Resource, getrlimit};
use std::process::ExitCode;

/// The stack of the command where `ulimit -s` allows its main thread less: what systems give by default.
const STACK: usize = 8 << 20;

/// Runs `body` on the main thread, or on one with a larger stack where the limit allows the main thread less.
///
/// Children of a supervisor die when the thread that started them ends. This one ends with the command.
pub(crate) fn with_enough(body: fn() -> ExitCode) -> ExitCode {
    if getrlimit(Resource::Stack).current.is_none_or(|limit| limit >= STACK as u64) {
        return body();
    }
    match std::thread::Builder::new().stack_size(STACK).spawn(body) {
        // A panic has been told by then; 101 is the code of one.
        Ok(thread) => thread.join().unwrap_or_else(|_| ExitCode::from(101)),
        // Better a small stack than none.
        Err(_) => body(),
    }
}
