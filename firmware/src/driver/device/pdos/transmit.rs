//! When a transmit PDO is sent (CiA 301, 7.5.2.37).
//!
//! | transmission type | sent |
//! |---|---|
//! | 0 | at a SYNC, if its data have changed |
//! | 1 to 240 | at every n-th SYNC |
//! | 254, 255 | if its data have changed, and at the event timer; checked once per tick of 1 ms |

use super::mapping::Mapping;

/// Transmission types above do not follow the SYNC.
pub const LAST_SYNCHRONOUS: u8 = 240;

/// Transmission types from here on follow events.
const FIRST_EVENT_DRIVEN: u8 = 254;

/// Transmission type of an event-driven PDO of the device profile.
pub const EVENT_DRIVEN: u8 = 255;

/// Transmission type of a PDO that is sent at every SYNC.
pub const EVERY_SYNC: u8 = 1;

/// Occasion at which a transmit PDO may be sent.
#[derive(Clone, Copy, Debug)]
pub enum SendOccasion {
    /// A SYNC, with its counter if it has one.
    Sync { counter: Option<u8> },
    /// A tick between two SYNCs.
    Tick,
}

/// Returns true if a joint has this transmission type; it answers no remote requests (252, 253).
pub const fn is_legal_type(kind: u32) -> bool {
    kind <= LAST_SYNCHRONOUS as u32
        || kind == FIRST_EVENT_DRIVEN as u32
        || kind == EVENT_DRIVEN as u32
}

/// A transmit PDO: its parameters, and when it was sent.
#[derive(Clone, Copy, Debug)]
pub struct TransmitPdo {
    /// Identifier that a master has set, with bit 31 for unused.
    pub identifier: Option<u32>,
    /// Transmission type that a master has set.
    pub kind: Option<u8>,
    /// Minimum time between two frames, 100 us; for the event-driven types.
    pub inhibit_time: u16,
    /// Maximum time between two frames, ms; 0 for none; for the event-driven types.
    pub event_timer_ms: u16,
    /// Counter of the SYNC from which on it is sent; 0: the next one.
    pub sync_start: u8,
    pub mapping: Mapping,
    /// The SYNC `sync_start` has been received.
    is_started: bool,
    /// SYNCs since the last frame.
    syncs: u8,
    sent_us: Option<u64>,
    sent: [u8; 8],
}

impl TransmitPdo {
    pub fn new(slot: usize) -> Self {
        Self {
            identifier: None,
            kind: None,
            inhibit_time: 0,
            event_timer_ms: 0,
            sync_start: 0,
            mapping: Mapping::of_transmit(slot),
            is_started: false,
            syncs: 0,
            sent_us: None,
            sent: [0; 8],
        }
    }

    /// Forgets what was sent: the network has left the operational state, or a parameter has changed.
    pub fn restart(&mut self) {
        self.is_started = false;
        self.syncs = 0;
        self.sent_us = None;
    }

    /// Returns true if the PDO has these data to send at a SYNC; `default` is its type without that of a master, and
    /// `counter` that of the SYNC, if it has one.
    pub fn is_due_at_sync(
        &mut self,
        default: u8,
        counter: Option<u8>,
        data: [u8; 8],
        now_us: u64,
    ) -> bool {
        let kind = self.kind.unwrap_or(default);
        if kind > LAST_SYNCHRONOUS {
            return false;
        }
        let is_start = self.sync_start == 0 || counter.is_none_or(|at| at == self.sync_start);
        // The SYNC at which it starts is the first that is answered.
        let is_first = !self.is_started && is_start;
        self.is_started |= is_start;
        if !self.is_started {
            return false;
        }
        self.syncs = self.syncs.saturating_add(1);
        let is_due = match kind {
            0 => self.sent_us.is_none() || self.sent != data,
            every => is_first && self.sync_start != 0 || self.syncs >= every,
        };
        if is_due {
            self.record_sent(data, now_us);
        }
        is_due
    }

    /// Returns true if the PDO is sent between two SYNCs.
    pub fn is_event_driven(&self) -> bool {
        self.kind.is_some_and(|kind| kind >= FIRST_EVENT_DRIVEN)
    }

    /// Returns true if the PDO has these data to send between two SYNCs.
    pub fn is_due_by_event(&mut self, data: [u8; 8], now_us: u64) -> bool {
        if !self.is_event_driven() {
            return false;
        }
        let is_due = match self.sent_us {
            None => true,
            Some(sent_us) => {
                let pause_us = now_us.saturating_sub(sent_us);
                let timer_us = u64::from(self.event_timer_ms) * 1000;
                let is_expired = timer_us > 0 && pause_us >= timer_us;
                (is_expired || self.sent != data) && pause_us >= u64::from(self.inhibit_time) * 100
            }
        };
        if is_due {
            self.record_sent(data, now_us);
        }
        is_due
    }

    fn record_sent(&mut self, data: [u8; 8], now_us: u64) {
        self.syncs = 0;
        self.sent = data;
        self.sent_us = Some(now_us);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sent_at_syncs(pdo: &mut TransmitPdo, counters: &[Option<u8>], data: &[u8]) -> Vec<usize> {
        let is_due = |(place, counter): (usize, &Option<u8>)| {
            let changed = [data.get(place).copied().unwrap_or_default(); 8];
            pdo.is_due_at_sync(1, *counter, changed, 0).then_some(place)
        };
        counters.iter().enumerate().filter_map(is_due).collect()
    }

    #[test]
    fn synchronous_pdo_is_sent_at_every_nth_sync_from_its_start_value() {
        let plain = [None; 7];
        let counted: Vec<Option<u8>> = (1..=7).map(Some).collect();
        let mut pdo = TransmitPdo::new(0);
        assert_eq!(sent_at_syncs(&mut pdo, &plain, &[]), [0, 1, 2, 3, 4, 5, 6]);
        pdo = TransmitPdo { kind: Some(3), ..TransmitPdo::new(0) };
        assert_eq!(sent_at_syncs(&mut pdo, &plain, &[]), [2, 5]);
        pdo = TransmitPdo { kind: Some(2), sync_start: 4, ..TransmitPdo::new(0) };
        assert_eq!(sent_at_syncs(&mut pdo, &counted, &[]), [3, 5]);
        // A SYNC without a counter starts it at once.
        pdo.restart();
        assert_eq!(sent_at_syncs(&mut pdo, &plain, &[])[0], 0);
        pdo = TransmitPdo { kind: Some(0), ..TransmitPdo::new(0) };
        assert_eq!(sent_at_syncs(&mut pdo, &plain, &[5, 5, 6, 6, 6, 7, 7]), [0, 2, 5]);
    }

    #[test]
    fn event_driven_pdo_follows_changes_timer_and_inhibit_time() {
        let mut pdo = TransmitPdo { kind: Some(255), event_timer_ms: 10, ..TransmitPdo::new(0) };
        let sent = |pdo: &mut TransmitPdo, data: &dyn Fn(u64) -> u8| -> Vec<u64> {
            pdo.restart();
            let is_due = |ms: &u64| pdo.is_due_by_event([data(*ms); 8], 1000 * ms);
            (0..25).filter(is_due).collect()
        };
        assert_eq!(sent(&mut pdo, &|_| 0), [0, 10, 20]);
        assert_eq!(sent(&mut pdo, &|ms| (ms >= 3).into()), [0, 3, 13, 23]);
        pdo.event_timer_ms = 0;
        pdo.inhibit_time = 70;
        assert_eq!(sent(&mut pdo, &|ms| ms as u8), [0, 7, 14, 21]);
        assert!(!pdo.is_due_at_sync(1, None, [9; 8], 0));
        pdo.kind = Some(1);
        assert!(!pdo.is_due_by_event([1; 8], 0));
    }
}
