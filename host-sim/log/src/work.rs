//! Long work that its caller can watch and stop.
//!
//! [`run`] executes a computation on a pool of threads of its own. The caller's thread asks `progress` at least every
//! [`ASK_INTERVAL`], whatever the computation does, and stops it with [`ControlFlow::Break`].
//!
//! A computation stops at its next [`checkpoint`], by unwinding without a message. Explicit results would pass through
//! every numeric function, of which many are called by libraries that know no errors. Loops whose passes take
//! milliseconds call [`checkpoint`] in each pass; outside of [`run`] it does nothing.
//!
//! The pool belongs to the call. Rayon's global pool would not survive a `fork`, and its size can be set only once.

use rayon::{ThreadBuilder, ThreadPoolBuilder};
use std::cell::RefCell;
use std::ops::ControlFlow;
use std::panic::resume_unwind;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

/// Longest time between two questions to `progress`. Half of the 100 ms after which a key press feels ignored.
pub const ASK_INTERVAL: Duration = Duration::from_millis(50);

/// Stack of each thread, bytes: that of a main thread on Linux, because a computation runs on one of them.
const STACK_BYTES: usize = 8 << 20;

/// State of a computation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Progress {
    /// The log is read.
    Reading {
        /// Bytes read.
        done: u64,
        /// Bytes in total; 0 if unknown.
        total: u64,
    },
    /// Another stage, in words.
    Stage(String),
}

/// The caller stopped the computation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

/// The connection of a computation to its caller.
struct Control {
    is_stopped: AtomicBool,
    /// `None` is the end of the computation.
    reports: Sender<Option<Progress>>,
}

thread_local! {
    /// The computation that this thread belongs to.
    static CONTROL: RefCell<Option<Arc<Control>>> = const { RefCell::new(None) };
}

/// Ends the computation if its caller stopped it. Does nothing outside of [`run`].
pub fn checkpoint() {
    let is_stopped = CONTROL.with_borrow(|control| {
        control.as_ref().is_some_and(|control| control.is_stopped.load(Ordering::Relaxed))
    });
    if is_stopped {
        // Without the panic hook, which would print a message.
        resume_unwind(Box::new(Cancelled));
    }
}

/// Rows between two checkpoints of a loop over rows: a few milliseconds of the slowest model in dual numbers.
const CHECKPOINT_ROWS: usize = 1024;

/// [`checkpoint`] for loops over rows, in one of many rows.
#[inline(always)]
pub fn checkpoint_at(row: usize) {
    if row.is_multiple_of(CHECKPOINT_ROWS) {
        checkpoint();
    }
}

/// Reports the state of the computation, and ends it if its caller stopped it. Does nothing outside of [`run`].
pub fn report(progress: Progress) {
    checkpoint();
    CONTROL.with_borrow(|control| {
        if let Some(control) = control {
            // The caller listens until the computation ends.
            let _ = control.reports.send(Some(progress));
        }
    });
}

/// Reports a stage in words. See [`report`].
pub fn report_stage(stage: &str) {
    report(Progress::Stage(stage.to_owned()));
}

/// Runs `work` on a pool of `threads` threads; 0 uses all cores. `progress` is called on the caller's thread with each new
/// state, and with the last state at least every [`ASK_INTERVAL`]. Within another call of this function, `work` runs on
/// that call's pool and reports to its `progress`.
///
/// # Errors
/// [`Cancelled`] if `progress` returned [`ControlFlow::Break`]. No thread of the computation runs afterwards.
///
/// # Panics
/// If `work` panics, with its panic.
pub fn run<R: Send, E: Send + From<Cancelled>>(
    threads: usize,
    progress: &dyn Fn(&Progress) -> ControlFlow<()>,
    work: impl FnOnce() -> Result<R, E> + Send,
) -> Result<R, E> {
    if CONTROL.with_borrow(Option::is_some) {
        return work();
    }
    let (reports, received) = channel();
    let end = reports.clone();
    let control = Arc::new(Control { is_stopped: AtomicBool::new(false), reports });
    let thread = |thread: ThreadBuilder| {
        CONTROL.set(Some(Arc::clone(&control)));
        thread.run();
    };
    let outcome = std::thread::scope(|scope| {
        let computation = scope.spawn(move || {
            let builder = ThreadPoolBuilder::new().num_threads(threads).stack_size(STACK_BYTES);
            let outcome = catch_unwind(AssertUnwindSafe(|| {
                // Waits for the end of all threads of the pool.
                match builder.build_scoped(thread, |pool| pool.install(work)) {
                    Ok(outcome) => outcome,
                    Err(error) => panic!("no threads for the computation: {error}"),
                }
            }));
            // Fails only if the caller has stopped listening.
            let _ = end.send(None);
            outcome
        });
        ask(&received, progress, &control);
        computation.join()
    });
    match outcome {
        Ok(Ok(outcome)) => outcome,
        Ok(Err(panic)) | Err(panic) if panic.is::<Cancelled>() => Err(Cancelled.into()),
        Ok(Err(panic)) | Err(panic) => resume_unwind(panic),
    }
}

/// Asks `progress` until the computation ends or is stopped.
fn ask(
    received: &Receiver<Option<Progress>>,
    progress: &dyn Fn(&Progress) -> ControlFlow<()>,
    control: &Control,
) {
    let mut state = Progress::Stage(String::new());
    loop {
        match received.recv_timeout(ASK_INTERVAL) {
            Ok(Some(report)) => state = report,
            Err(RecvTimeoutError::Timeout) => {}
            Ok(None) | Err(RecvTimeoutError::Disconnected) => return,
        }
        if progress(&state).is_break() {
            control.is_stopped.store(true, Ordering::Relaxed);
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;
    use std::cell::Cell;

    fn continued(_: &Progress) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    /// Works in jobs of a millisecond.
    fn busy(jobs: u64) -> Result<u64, Cancelled> {
        let job = |index: u64| {
            checkpoint();
            std::thread::sleep(Duration::from_millis(1));
            index
        };
        Ok((0..jobs).into_par_iter().map(job).sum())
    }

    #[test]
    fn run_with_two_threads_returns_result_of_its_pool() {
        let threads = run(2, &continued, || Ok::<_, Cancelled>(rayon::current_num_threads()));
        assert_eq!(threads, Ok(2));
        assert_eq!(run(2, &continued, || run(1, &continued, || busy(200))), Ok(199 * 100));
    }

    #[test]
    fn run_repeats_the_last_state_while_work_goes_on() {
        let (stages, asked) = (Cell::new(0), AtomicBool::new(false));
        let progress = |state: &Progress| {
            stages.set(stages.get() + u32::from(*state == Progress::Stage("a".into())));
            asked.store(stages.get() >= 3, Ordering::Relaxed);
            ControlFlow::Continue(())
        };
        let work = || {
            report_stage("a");
            // Ends when the state was passed on three times, or after a time that no machine takes.
            for _ in 0..60_000 {
                if asked.load(Ordering::Relaxed) {
                    return Ok::<_, Cancelled>(());
                }
                std::thread::sleep(Duration::from_millis(1));
            }
            panic!("the last state is not repeated")
        };
        assert_eq!(run(1, &progress, work), Ok(()));
        const { assert!(ASK_INTERVAL.as_millis() <= 100) };
    }

    #[test]
    fn run_stopped_by_its_caller_ends_at_the_next_checkpoint() {
        // All jobs would take half a minute, and the first question comes after `ASK_INTERVAL`.
        assert_eq!(run(2, &|_| ControlFlow::Break(()), || busy(60_000)), Err(Cancelled));
    }

    #[test]
    #[should_panic(expected = "own panic")]
    fn run_with_panic_in_work_panics_with_it() {
        let _ = run(1, &continued, || -> Result<(), Cancelled> { panic!("own panic") });
    }

    #[test]
    fn checkpoint_outside_of_run_does_nothing() {
        checkpoint();
        report_stage("without a caller");
    }
}
