//! What came in and could not be used, and what was lost: counted, never a reason to stop.

pub use crate::node::dictionary::records::Counters;

/// Counts, up to the largest number there is.
pub(super) fn count(counter: &mut u32, by: u32) {
    *counter = counter.saturating_add(by);
}

impl Counters {
    pub(super) fn count_foreign(&mut self) {
        count(&mut self.foreign, 1);
    }
    pub(super) fn count_wrong_length(&mut self) {
        count(&mut self.wrong_length, 1);
    }
    pub(super) fn count_wrong_content(&mut self) {
        count(&mut self.wrong_content, 1);
    }

    /// A frame of ours, in a state of the network in which it is not heard.
    pub(super) fn count_passed_over(&mut self) {
        count(&mut self.passed_over, 1);
    }
}
