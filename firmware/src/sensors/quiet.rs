//! When a slow converter may convert without disturbing the current loop's.
//!
//! Two errata of the STM32G4 (ES0430): a converter whose last conversion is more than 1 ms old gives a wrong result
//! (2.7.7), and a conversion disturbs one that another converter makes at the same moment (2.7.11). So a slow sensor is
//! converted twice and the second result taken, and each conversion lies wholly between two tops of the PWM, where the
//! currents are sampled. All times are cycles since the last top.

/// The part of a PWM period that is free.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QuietWindow {
    /// First cycle a conversion may begin at: the currents are converted.
    pub from: u32,
    /// Last one: what begins there ends before the next top.
    pub until: u32,
}

impl QuietWindow {
    /// Of a period of so many cycles, where the currents' conversions take `fast` cycles from its top on and a slow one
    /// `slow`, with `margin` on either side; `None` where there is no such time.
    pub const fn of(period: u32, fast: u32, slow: u32, margin: u32) -> Option<Self> {
        let from = fast + margin;
        match period.checked_sub(slow + margin) {
            Some(until) if from < until => Some(Self { from, until }),
            _ => None,
        }
    }

    /// Whether a conversion may begin so many cycles after the top.
    pub const fn contains(&self, since_top: u32) -> bool {
        self.from <= since_top && since_top <= self.until
    }
}

/// The second of two conversions, each begun in the window: `wait` returns when it is there.
pub fn convert_twice(mut wait: impl FnMut(), mut convert: impl FnMut() -> u16) -> u16 {
    wait();
    let _wrong = convert();
    wait();
    convert()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_conversion_overlaps_a_sample_of_the_currents() {
        // The STM32G474's: 50 us, 1.5 us of fast and 6.1 us of slow conversions, in cycles of 170 MHz.
        let (period, fast, slow) = (8500, 248, 1040);
        let window = QuietWindow::of(period, fast, slow, 150).unwrap();
        for since_top in 0..period {
            let overlaps = since_top < fast || since_top + slow >= period;
            assert!(!(window.contains(since_top) && overlaps), "{since_top}");
        }
        // And it is most of the period, or nobody would ever convert.
        let share = f64::from(window.until - window.from) / f64::from(period);
        assert!((0.7..0.9).contains(&share), "{share}");
        assert_eq!(QuietWindow::of(1000, 248, 1040, 150), None);
        assert_eq!(QuietWindow::of(1400, 248, 1040, 150), None);
    }

    #[test]
    fn the_first_conversion_after_a_rest_is_not_believed() {
        let (mut waits, mut conversions) = (0, 0);
        let convert = || {
            conversions += 1;
            if conversions == 1 { 4095 } else { 2048 }
        };
        assert_eq!(convert_twice(|| waits += 1, convert), 2048);
        assert_eq!((waits, conversions), (2, 2));
    }
}
