//! Ctrl-C and SIGTERM as a flag that a command asks for: it then ends what it does in order.

use super::error::{Refusal, Result};
use std::sync::atomic::{AtomicBool, Ordering};

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Returns a function that is true once the user has interrupted.
///
/// # Errors
/// Returns one line if the signals cannot be caught.
pub fn flag() -> Result<Box<dyn Fn() -> bool>> {
    ctrlc::set_handler(|| INTERRUPTED.store(true, Ordering::Relaxed)).map_err(Refusal::Signals)?;
    Ok(Box::new(|| INTERRUPTED.load(Ordering::Relaxed)))
}
