//! The terminal, taken and given back whatever happens.
//!
//! While it is taken, keys come one by one, nothing is echoed and another page is shown. It is given back
//! at the end, when an error is passed up, and before a panic speaks, so that what it says can be read.
//! Signals are the command line's: they end the loop, and the loop ends here.

use ratatui::DefaultTerminal;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::fs::File;
use std::io::{self, IsTerminal};
use std::os::fd::AsFd;
use std::time::Duration;

/// Gives the terminal back when it goes.
struct Taken;

impl Drop for Taken {
    fn drop(&mut self) {
        ratatui::restore();
    }
}

/// Takes the terminal for as long as `run` runs.
///
/// # Errors
/// No terminal that can be taken; and what `run` says.
pub fn with_terminal<T>(
    run: impl FnOnce(&mut DefaultTerminal) -> Result<T, String>,
) -> Result<T, String> {
    // Puts a hook before the panic handler there is: it gives the terminal back first.
    let taken = ratatui::try_init();
    let guard = Taken;
    let mut terminal = taken.map_err(|error| failed(&error))?;
    let outcome = run(&mut terminal);
    drop(guard);
    outcome
}

/// Where keys come from.
pub struct Keyboard(Option<File>);

impl Keyboard {
    /// The terminal on standard input; where that is something else, the one the process was started from.
    pub fn open() -> Self {
        let elsewhere = !io::stdin().is_terminal();
        Self(elsewhere.then(|| File::open("/dev/tty").ok()).flatten())
    }

    /// Waits so long, or until a key is pressed; says whether the terminal has gone (its window was closed, its
    /// connection lost).
    pub fn has_gone_within(&self, wait: Duration) -> bool {
        let stdin = io::stdin();
        let source = self.0.as_ref().map_or(stdin.as_fd(), |file| file.as_fd());
        let mut sources = [PollFd::from_borrowed_fd(source, PollFlags::IN)];
        let wait =
            Timespec { tv_sec: wait.as_secs() as i64, tv_nsec: i64::from(wait.subsec_nanos()) };
        // Interrupted by a signal, as by a change of its size: asked again soon.
        let heard = poll(&mut sources, Some(&wait)).is_ok();
        heard && sources[0].revents().intersects(PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL)
    }
}

/// A terminal that does not do what it was asked to, in one line.
pub fn failed(error: &io::Error) -> String {
    format!("terminal: {error}")
}
