//! The times of a trial: when a new program is confirmed, and when its trial ends.
//!
//! A program is confirmed after [`Times::confirm_us`] without a fault that blocks it. Without a confirmation its trial ends
//! [`Times::end_us`] after its start. Why these values and not half or twice as much: `firmware/tests/all/update/trial.rs`.

/// Times of a trial, us.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Times {
    /// Time without a blocking fault until the confirmation. The slowest periodic work takes 1 s (heartbeat, sensors of
    /// housing and magnet), so all of it has run twice.
    pub confirm_us: u64,
    /// Time from the start to the end. It leaves 8 s to a disturbance that is not of the program, such as a bus without
    /// another node.
    pub end_us: u64,
}

impl Times {
    /// The times in use.
    pub const DEFAULT: Self = Self { confirm_us: 2_000_000, end_us: 10_000_000 };
}

/// What a trial has come to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It goes on.
    Runs,
    /// The program is to be confirmed.
    Confirm,
    /// It has failed: the driver restarts.
    End,
}

/// A running trial.
#[derive(Clone, Copy, Debug, Default)]
pub struct Trial {
    begun_us: u64,
    /// Time since which no blocking fault is present, us.
    sound_since_us: u64,
}

impl Trial {
    /// Returns a trial that begins now.
    pub const fn begin(now_us: u64) -> Self {
        Self { begun_us: now_us, sound_since_us: now_us }
    }

    /// Evaluates the trial. Call it about once a millisecond.
    pub const fn step(&mut self, times: &Times, is_blocked: bool, now_us: u64) -> Verdict {
        if is_blocked {
            self.sound_since_us = now_us;
        }
        if now_us.saturating_sub(self.sound_since_us) >= times.confirm_us {
            Verdict::Confirm
        } else if now_us.saturating_sub(self.begun_us) >= times.end_us {
            Verdict::End
        } else {
            Verdict::Runs
        }
    }
}
