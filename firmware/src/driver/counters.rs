//! Counters of frames that could not be used or were lost. They never stop the driver.

pub use crate::node::dictionary::records::Counters;
use crate::supervisor::CanState;
use compensator_core::can::FrameError;

/// Adds to a counter; saturates.
#[inline(never)]
pub(crate) fn count(counter: &mut u32, by: u32) {
    *counter = counter.saturating_add(by);
}

impl Counters {
    pub(crate) fn count_foreign(&mut self) {
        count(&mut self.foreign, 1);
    }
    pub(crate) fn count_wrong_length(&mut self) {
        count(&mut self.wrong_length, 1);
    }

    /// Counts a frame that is not a legal message.
    pub(crate) fn count_error(&mut self, error: &FrameError) {
        match error {
            FrameError::Foreign(_) => self.count_foreign(),
            FrameError::Length { .. } => self.count_wrong_length(),
            FrameError::Counter(_) | FrameError::JointKind(_) => count(&mut self.wrong_content, 1),
        }
    }

    /// Counts an overrun of the receiver, and a controller that has gone off its bus since `before`.
    pub(crate) fn count_bus(&mut self, receiver_overrun: bool, before: CanState, now: CanState) {
        if receiver_overrun {
            count(&mut self.receiver_overrun, 1);
        }
        if now == CanState::Off && before != CanState::Off {
            count(&mut self.bus_off, 1);
        }
    }

    /// Counts a frame for this node that the present network state does not permit.
    pub(crate) fn count_passed_over(&mut self) {
        count(&mut self.passed_over, 1);
    }
}
