//! The last errors, and the text of a panic before the start.

use crate::log::log;
use crate::node::dictionary::ERROR_HISTORY_LENGTH;
use crate::supervisor::Event;
use heapless::{Deque, String};

/// Maximum length of a stored panic text, bytes.
pub const MAX_PANIC_BYTES: usize = 160;

/// What happened, for a tool that asks later.
#[derive(Debug, Default)]
pub(crate) struct History {
    /// The newest last.
    errors: Deque<u32, ERROR_HISTORY_LENGTH>,
    panic: String<MAX_PANIC_BYTES>,
}

impl History {
    /// Keeps an error; the oldest one is dropped if there is no room.
    fn record_error(&mut self, code: u16, detail: u16) {
        if self.errors.is_full() {
            self.errors.pop_front();
        }
        // There is room, because one was just removed.
        let _ = self.errors.push_back(u32::from(code) | u32::from(detail) << 16);
    }

    /// Keeps a code that was raised. Returns the code of its emergency, 0 if it was cleared.
    pub(crate) fn record_event(&mut self, event: Event) -> u16 {
        let info = event.code.info();
        log!(warn, "code {=u8}, raised: {=bool}", info.number, event.raised);
        if event.raised {
            self.record_error(info.emergency, u16::from(info.number));
        }
        if event.raised { info.emergency } else { 0 }
    }

    /// Forgets all errors.
    pub(crate) fn clear_errors(&mut self) {
        self.errors.clear();
    }

    /// Returns the number of errors (1003h:0).
    pub(crate) fn error_count(&self) -> u32 {
        self.errors.len() as u32
    }

    /// Returns an error by its sub-index in 1003h: 1 is the newest.
    pub(crate) fn error(&self, sub_index: u8) -> Option<u32> {
        let newest = usize::from(sub_index).wrapping_sub(1);
        self.errors.iter().rev().nth(newest).copied()
    }

    /// Keeps the text of a panic, truncated to its maximum length.
    pub(crate) fn set_panic(&mut self, text: &str) {
        self.panic.clear();
        for letter in text.chars() {
            if self.panic.push(letter).is_err() {
                break;
            }
        }
    }

    /// Returns the text of the panic before this start; empty if there was none.
    pub(crate) fn panic(&self) -> &str {
        &self.panic
    }
}
