//! Set-up and restoration of the terminal.
//!
//! During monitoring, keys arrive one by one without echo, on the alternate screen. The terminal is restored at the end,
//! after an error, and before a panic prints its message. The command line handles signals: they end the loop.

use joint_bus::monitor::MonitorError;
use ratatui::DefaultTerminal;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::fs::File;
use std::io::{self, IsTerminal};
use std::os::fd::AsFd;
use std::time::Duration;

/// Restores the terminal when dropped.
struct TerminalGuard;

impl Drop for TerminalGuard {
    fn drop(&mut self) {
        ratatui::restore();
    }
}

/// Runs `run` with the terminal set up.
///
/// # Errors
/// Returns an error if the terminal cannot be set up, and the error of `run`.
pub fn with_terminal<T>(
    run: impl FnOnce(&mut DefaultTerminal) -> Result<T, MonitorError>,
) -> Result<T, MonitorError> {
    // Installs a panic hook that restores the terminal first.
    let taken = ratatui::try_init();
    let guard = TerminalGuard;
    let mut terminal = taken.map_err(MonitorError::Terminal)?;
    let outcome = run(&mut terminal);
    drop(guard);
    outcome
}

/// Source of the keys.
pub struct Keyboard(Option<File>);

impl Keyboard {
    /// Opens the terminal of standard input, or else the controlling terminal.
    pub fn open() -> Self {
        let elsewhere = !io::stdin().is_terminal();
        Self(elsewhere.then(|| File::open("/dev/tty").ok()).flatten())
    }

    /// Waits for a key, at most for this time. Returns true if the terminal was closed or its connection was lost.
    pub fn has_gone_within(&self, wait: Duration) -> bool {
        let stdin = io::stdin();
        let source = self.0.as_ref().map_or(stdin.as_fd(), |file| file.as_fd());
        let mut sources = [PollFd::from_borrowed_fd(source, PollFlags::IN)];
        let wait =
            Timespec { tv_sec: wait.as_secs() as i64, tv_nsec: i64::from(wait.subsec_nanos()) };
        // A signal, for example a change of size, may interrupt the wait.
        let has_result = poll(&mut sources, Some(&wait)).is_ok();
        has_result
            && sources[0].revents().intersects(PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL)
    }
}
