//! Time window in which a slow conversion does not disturb those of the current loop.
//!
//! Two errata of the STM32G4 (ES0430) apply. A converter idle for more than 1 ms gives a wrong first result
//! (2.7.7), and simultaneous conversions of two converters disturb each other (2.7.11). A timer therefore
//! starts the slow conversions in every period, and each lies completely between two tops of the PWM, at
//! which the currents are sampled. No program waits for the window: a wait would never end if the interrupt
//! of the current loop always ended behind it. All times are in cycles since the last top.

/// The part of a PWM period in which slow conversions may start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QuietWindow {
    /// First cycle at which a conversion may start: the currents are converted.
    pub from: u32,
    /// Last cycle at which a conversion may start: it ends before the next top.
    pub until: u32,
}

impl QuietWindow {
    /// Computes the window for a period of `period` cycles.
    ///
    /// The conversions of the currents take `fast` cycles from the top of the period on, a slow one takes
    /// `slow` cycles, and `margin` is kept on both sides. Returns `None` if no such window exists.
    pub const fn for_period(period: u32, fast: u32, slow: u32, margin: u32) -> Option<Self> {
        let from = fast + margin;
        match period.checked_sub(slow + margin) {
            Some(until) if from < until => Some(Self { from, until }),
            _ => None,
        }
    }

    /// Returns true if a conversion may start this many cycles after the top.
    pub const fn contains(&self, since_top: u32) -> bool {
        self.from <= since_top && since_top <= self.until
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn window_excludes_overlap_with_current_samples() {
        // The values of the STM32G474: 50 us, 1.5 us of fast and 6.1 us of slow conversions, in cycles of
        // 170 MHz.
        let (period, fast, slow) = (8500, 248, 1040);
        let window = QuietWindow::for_period(period, fast, slow, 150).unwrap();
        for since_top in 0..period {
            let overlaps = since_top < fast || since_top + slow >= period;
            assert!(!(window.contains(since_top) && overlaps), "{since_top}");
        }
        // The window covers most of the period, so conversions rarely wait.
        let share = f64::from(window.until - window.from) / f64::from(period);
        assert!((0.7..0.9).contains(&share), "{share}");
        assert_eq!(QuietWindow::for_period(1000, 248, 1040, 150), None);
        assert_eq!(QuietWindow::for_period(1400, 248, 1040, 150), None);
    }
}
