//! The terminal, taken and given back whatever happens.
//!
//! While it is taken, keys come one by one, nothing is echoed and another page is shown. It is given back
//! at the end, when an error is passed up, and before a panic speaks, so that what it says can be read.
//! Signals are the command line's: they end the loop, and the loop ends here.

use ratatui::DefaultTerminal;
use std::io;

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

/// A terminal that does not do what it was asked to, in one line.
pub fn failed(error: &io::Error) -> String {
    format!("terminal: {error}")
}
