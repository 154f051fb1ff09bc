//! Tasks on all processors.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Runs every task on as many threads as there are processors; the results in the order of the tasks, or the first error.
///
/// # Errors
/// Those of the work.
pub fn in_parallel<T: Sync, R: Send, E: Send>(tasks: &[T], work: impl Fn(&T) -> Result<R, E> + Sync) -> Result<Vec<R>, E> {
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(usize, Result<R, E>)>> = Mutex::new(Vec::new());
    let at_once = std::thread::available_parallelism().map_or(1, std::num::NonZero::get).min(tasks.len());
    std::thread::scope(|scope| {
        for _ in 0..at_once {
            scope.spawn(|| {
                while let Some((at, task)) = Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|at| Some((at, tasks.get(at)?))) {
                    let result = work(task);
                    done.lock().unwrap_or_else(PoisonError::into_inner).push((at, result));
                }
            });
        }
    });
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_by_key(|(at, _)| *at);
    done.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests fail by panicking")]
    use super::*;

    #[test]
    fn results_are_in_the_order_of_the_tasks() {
        let numbers: Vec<u64> = (0..100).collect();
        assert_eq!(
            in_parallel(&numbers, |number| Ok::<_, ()>(number * number)).unwrap(),
            numbers.iter().map(|n| n * n).collect::<Vec<_>>()
        );
        let error = in_parallel(&numbers, |number| if *number >= 50 { Err(*number) } else { Ok(()) }).unwrap_err();
        assert_eq!(error, 50);
    }
}
