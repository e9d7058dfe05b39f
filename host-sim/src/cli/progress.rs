//! Progress of long computations: a line or a bar on standard error.

use super::output::print_message;
use indicatif::{HumanBytes, ProgressBar, ProgressStyle};
use joint_log::work::{self, Cancelled, Progress};
use std::io::IsTerminal;
use std::ops::ControlFlow;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

/// Time between two lines of [`with_lines`] in a pipe.
pub const LINE_EVERY: Duration = Duration::from_secs(30);

/// Runs a long computation on `threads` threads, 0 for all cores. Its state is shown on standard error if that is a
/// terminal. Ctrl-C ends the process.
///
/// # Errors
/// Returns the error of the computation.
pub fn in_stages<R: Send, E: Send + From<Cancelled>>(
    threads: usize,
    work: impl FnOnce() -> Result<R, E> + Send,
) -> Result<R, E> {
    let bar = spinner(String::new());
    let shown = |progress: &Progress| {
        match progress {
            Progress::Reading { done, total } => {
                bar.set_message(format!("reading {} of {}", HumanBytes(*done), HumanBytes(*total)));
            }
            Progress::Stage(stage) => bar.set_message(stage.clone()),
        }
        ControlFlow::Continue(())
    };
    let outcome = work::run(threads, &shown, work);
    bar.finish_and_clear();
    outcome
}

/// Runs a computation of hours, and calls `print_line` every `every` until it ends: for a log file, which shows no spinner.
pub fn with_lines<R>(every: Duration, print_line: impl Fn() + Send, work: impl FnOnce() -> R) -> R {
    let (end, ended) = mpsc::channel::<()>();
    thread::scope(|scope| {
        // Dropped after the work, also if it panics: then the other thread ends.
        let _end = end;
        scope.spawn(move || {
            while ended.recv_timeout(every) == Err(RecvTimeoutError::Timeout) {
                print_line();
            }
        });
        work()
    })
}

/// Returns a bar of counted items with the remaining time; it is hidden if standard error is not a terminal.
pub fn counted_progress(what: &str, items: &str, total: u64) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let template = format!("{what} {{wide_bar}} {{pos}}/{{len}} {items}, {{eta}} left");
    let style = ProgressStyle::with_template(&template);
    let bar = ProgressBar::new(total);
    let bar = bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.tick();
    bar
}

/// Prints a message on standard error, if that is a terminal: what a command is about to do, and how long it takes.
pub fn announce(message: &str) {
    if std::io::stderr().is_terminal() {
        print_message(message);
    }
}

/// Formats a duration: `45 s`, `8 min 20 s`, `2 h 5 min`.
pub fn duration_in_words(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match whole {
        0 => "less than 1 s".to_owned(),
        1..=119 => format!("{whole} s"),
        120..=7199 => format!("{} min {} s", whole / 60, whole % 60),
        _ => format!("{} h {} min", whole / 3600, whole / 60 % 60),
    }
}

/// Returns a spinner with the elapsed time; it is hidden if standard error is not a terminal.
pub fn spinner(what: String) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{spinner} {wide_msg} [{elapsed}]");
    let style = style.unwrap_or_else(|_| ProgressStyle::default_spinner());
    let bar = ProgressBar::new_spinner().with_style(style).with_message(what);
    bar.enable_steady_tick(std::time::Duration::from_millis(120));
    bar
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn with_lines_prints_until_the_work_ends() {
        let lines = AtomicUsize::new(0);
        let count = || lines.load(Ordering::Relaxed);
        let print = || {
            lines.fetch_add(1, Ordering::Relaxed);
        };
        let result = with_lines(Duration::from_millis(1), print, || {
            while count() < 3 {
                thread::yield_now();
            }
            7
        });
        let printed = count();
        assert!(result == 7 && printed >= 3);
        thread::sleep(Duration::from_millis(10));
        assert_eq!(count(), printed, "a line after the end");
        with_lines(LINE_EVERY, || panic!("a line before its time"), || ());
    }

    #[test]
    fn duration_in_words_uses_two_units_at_most() {
        for (seconds, words) in
            [(0.2, "less than 1 s"), (45.3, "45 s"), (500.0, "8 min 20 s"), (7500.0, "2 h 5 min")]
        {
            assert_eq!(duration_in_words(seconds), words);
        }
    }
}
