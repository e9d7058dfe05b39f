//! What came in and could not be used, and what was lost: counted, never a reason to stop.

use crate::node::dictionary::FRAME_COUNTERS;

macro_rules! counters {
    ($($(#[$doc:meta])* $name:ident),* $(,)?) => {
        /// What came in and could not be used, and what was lost.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub struct Counters { $($(#[$doc])* pub $name: u32),* }
    };
}

counters! {
    /// Frames taken in.
    received,
    /// Frames of others.
    foreign,
    /// Process frames that came while the node was not operational.
    passed_over,
    /// Frames of ours with too few or too many bytes.
    wrong_length,
    /// Frames of ours whose content is not legal.
    wrong_content,
    /// SYNCs that never came.
    sync_lost,
    /// SYNCs that came twice.
    sync_duplicate,
    /// SYNCs that came after a later one.
    sync_late,
    /// Commands that came twice.
    command_duplicate,
    /// Commands that never came.
    command_lost,
    /// Commands that came after a later one.
    command_late,
    /// Object requests refused.
    sdo_refused,
    /// Times the controller lost what came in.
    receiver_overrun,
    /// Times the controller left the bus.
    bus_off,
}

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

    /// In the order of [`FRAME_COUNTERS`].
    pub(super) fn words(&self, (sent, not_sent): (u32, u32)) -> [u32; FRAME_COUNTERS.len()] {
        [
            self.received,
            sent,
            not_sent,
            self.foreign,
            self.passed_over,
            self.wrong_length,
            self.wrong_content,
            self.sync_lost,
            self.sync_duplicate,
            self.sync_late,
            self.command_duplicate,
            self.command_lost,
            self.command_late,
            self.sdo_refused,
            self.receiver_overrun,
            self.bus_off,
        ]
    }
}
