//! The independent watchdog, on its own oscillator of 32 kHz (RM0440, 42).

use super::CORE_HZ;

const KR: u32 = 0x00;
const PR: u32 = 0x04;
const RLR: u32 = 0x08;
const OSCILLATOR_HZ: u64 = 32_000;

/// The watchdog.
#[derive(Clone, Debug, Default)]
pub struct Watchdog {
    prescaler: u32,
    reload: u32,
    /// Time at which it expires; `None` before its start.
    expires: Option<u64>,
    /// Number of refreshes.
    pub refreshes: u64,
    refreshed_at: u64,
    /// Longest time from one refresh to the next, cycles.
    pub longest_pause: u64,
}

impl Watchdog {
    /// Time of the next event, cycles.
    pub fn next_event(&self) -> u64 {
        self.expires.unwrap_or(u64::MAX)
    }

    /// Returns true if it has expired.
    pub fn is_expired(&self, now: u64) -> bool {
        self.expires.is_some_and(|at| at <= now)
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, word: u32, now: u64) {
        match (offset, word & 0xFFFF) {
            (KR, 0xAAAA) if self.expires.is_some() => {
                self.refreshes += 1;
                self.longest_pause = self.longest_pause.max(now - self.refreshed_at);
                self.refreshed_at = now;
                self.restart(now);
            }
            (KR, 0xCCCC) => self.restart(now),
            (PR, value) => self.prescaler = value & 7,
            (RLR, value) => {
                self.reload = value & 0xFFF;
                if self.expires.is_some() {
                    self.restart(now);
                }
            }
            _ => {}
        }
    }

    fn restart(&mut self, now: u64) {
        let ticks = u64::from(self.reload + 1) * (4 << self.prescaler);
        self.expires = Some(now + ticks * CORE_HZ / OSCILLATOR_HZ);
    }
}
