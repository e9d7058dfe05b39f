//! SYNC objects (CiA 301, 7.5.2.5 to 7.5.2.7 and 7.5.2.19): with a counter, or plain.

use compensator_core::can::SyncFrame;

/// Parameters and state of the SYNC.
#[derive(Clone, Copy, Debug)]
pub struct SyncState {
    /// Highest counter of a SYNC (1019h); 0 if it has none.
    pub overflow: u8,
    /// Time between two SYNCs (1006h), us; 0 if unknown.
    pub period_us: u32,
    /// Time after a SYNC in which synchronous PDOs are accepted (1007h), us; 0 for no limit.
    pub window_us: u32,
    /// Time of the last SYNC, us.
    last_us: Option<u64>,
    /// Counter of the last SYNC as received.
    received: Option<u8>,
    /// The same in the ring of 240 that counts samples.
    counter: u8,
}

impl SyncState {
    pub const fn new() -> Self {
        Self {
            overflow: SyncFrame::LAST,
            period_us: 0,
            window_us: 0,
            last_us: None,
            received: None,
            counter: SyncFrame::LAST,
        }
    }

    /// Returns true if a synchronous PDO comes too late after the last SYNC.
    pub fn is_outside_window(&self, now_us: u64) -> bool {
        let window_us = u64::from(self.window_us);
        let is_late = |last_us: u64| now_us.saturating_sub(last_us) > window_us;
        window_us > 0 && self.last_us.is_some_and(is_late)
    }

    /// Processes a SYNC with its counter, or without. Returns it in the ring of 240; a plain one is the next.
    pub fn take(&mut self, received: Option<u8>, now_us: u64) -> SyncFrame {
        self.last_us = Some(now_us);
        let ring = SyncFrame::LAST;
        let last = self.received;
        self.received = received;
        let ahead = match (received, last) {
            (None, _) => 1,
            // The usual ring: lost and repeated SYNCs are told from the counter itself.
            (Some(counter), _) if self.overflow == ring || self.overflow == 0 => {
                self.counter = counter;
                return SyncFrame { counter };
            }
            (Some(_), None) => 1,
            (Some(counter), Some(last)) => {
                let size = u16::from(self.overflow);
                ((u16::from(counter) + size - u16::from(last) % size) % size) as u8
            }
        };
        self.counter =
            ((u16::from(self.counter) + u16::from(ahead) - 1) % u16::from(ring) + 1) as u8;
        SyncFrame { counter: self.counter }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counters(sync: &mut SyncState, received: &[Option<u8>]) -> Vec<u8> {
        received.iter().map(|received| sync.take(*received, 0).counter).collect()
    }

    #[test]
    fn sync_is_counted_in_the_ring_of_samples_with_and_without_counter() {
        let mut sync = SyncState::new();
        assert_eq!(counters(&mut sync, &[Some(239), Some(240), Some(1)]), [239, 240, 1]);
        assert_eq!(counters(&mut sync, &[None, None, None]), [2, 3, 4]);
        sync.overflow = 10;
        // One lost at 4, one repeated at the end, over the end of its ring.
        let received = [Some(2), Some(3), Some(5), Some(10), Some(1), Some(1)];
        assert_eq!(counters(&mut sync, &received), [5, 6, 8, 13, 14, 14]);
    }

    #[test]
    fn window_is_counted_from_the_last_sync() {
        let mut sync = SyncState { window_us: 400, ..SyncState::new() };
        assert!(!sync.is_outside_window(10_000), "no SYNC yet");
        sync.take(None, 10_000);
        assert!(!sync.is_outside_window(10_400) && sync.is_outside_window(10_401));
        sync.window_us = 0;
        assert!(!sync.is_outside_window(99_999));
    }
}
