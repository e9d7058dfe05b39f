//! Magnetic encoders AS5047P and AS5048A: a 14-bit angle over SPI.
//!
//! A frame has 16 bits in both directions, mode 1 (clock low when idle, sampled on its falling edge), at
//! most 10 MHz. The command holds even parity, a read bit and a register. The answer belongs to the
//! *previous* command and holds even parity, an error flag and 14 bits.
//!
//! Hardware exchanges two frames in each period ([`FramePairs`]). The second one answers the first, so its angle was latched
//! between the two, microseconds before the period's sample.
//!
//! A word of zeros has correct parity and no error flag, so a data line held low or a chip that hangs looks
//! like a shaft at rest. However, these encoders have a noise of three counts (0.068 degrees). An angle
//! that stays exactly the same for [`STUCK_AFTER_PAIRS`] pairs is therefore reported as stuck. While the joint
//! turns, the observer finds it within a millisecond ([`crate::control::observer`]).
//!
//! Once a second a frame asks for the diagnostics. They report a magnet that is too weak, too strong or misplaced, before the
//! angle becomes wrong.
//!
//! The error flag stays set until the error register is read. That takes a period without an angle, during which the observer
//! coasts. A broken wire reads as ones (the input must be pulled up), so the error flag is set.

mod frames;
mod pairs;

pub use frames::{EncoderError, EncoderType, STUCK_AFTER_PAIRS};
pub use pairs::FramePairs;

/// Bits of an angle.
pub const ANGLE_BITS: u32 = 14;

/// Maximum SPI clock, Hz (data sheet: t_clk at least 100 ns).
pub const MAX_CLOCK_HZ: u32 = 10_000_000;

/// Returns the smallest divider of an SPI clock source (2 to 256, powers of two) that keeps to
/// [`MAX_CLOCK_HZ`].
///
/// Do not request a frequency from a driver instead: drivers round, and 170 MHz / 16 is 10.6 MHz.
///
/// # Panics
/// Panics if 256 is not enough; in a constant, that does not compile.
pub const fn clock_divider(source_hz: u32) -> u32 {
    let mut divider = 2;
    while source_hz > divider * MAX_CLOCK_HZ {
        divider *= 2;
    }
    assert!(divider <= 256, "no divider is large enough");
    divider
}

/// Delays from chip select to the first clock, and from the last clock to its release, ns (data sheet: t_L,
/// t_H).
pub const SELECT_NS: u32 = 350;
/// See [`SELECT_NS`].
pub const RELEASE_NS: u32 = 100;
/// Minimum time between two frames in which the chip is not selected, ns (data sheet: t_CSn).
pub const DESELECTED_NS: u32 = 350;

#[cfg(test)]
mod tests {
    use super::frames::{DATA, ERROR, READ_ANGLE, READ_ERRORS};
    use super::*;

    /// A simulated encoder: it answers one frame late and holds its error flag.
    struct Chip {
        angle: u16,
        answer: u16,
        errors: u16,
        /// Bits that a disturbance flips in the next answer with an angle.
        flips: u16,
        diagnostics: u16,
    }

    impl Chip {
        fn new() -> Self {
            Self { angle: 0x1234, answer: 0, errors: 0, flips: 0, diagnostics: 0x0140 }
        }

        /// Exchanges a frame: returns the answer to the command before.
        fn frame(&mut self, asked: u16) -> u16 {
            let answer = self.answer;
            assert_eq!(asked.count_ones() % 2, 0, "even parity");
            assert_ne!(asked & ERROR, 0, "reads only");
            let flag = if self.errors != 0 { ERROR } else { 0 };
            let data = match asked & DATA {
                0x3FFF => self.angle,
                0x0001 => core::mem::take(&mut self.errors),
                0x3FFC => self.diagnostics,
                other => panic!("register {other:#x}"),
            };
            let word = flag | data;
            self.answer = word | ((word.count_ones() as u16 & 1) << 15);
            answer
        }

        /// Exchanges a pair of frames.
        fn pair(&mut self, pairs: &mut FramePairs) -> Result<u16, EncoderError> {
            let [first, second] = pairs.commands();
            let first = self.frame(first);
            let second = self.frame(second) ^ core::mem::take(&mut self.flips);
            pairs.angle(Some([first, second]))
        }
    }

    fn encoder() -> (Chip, FramePairs) {
        (Chip::new(), FramePairs::new(EncoderType::As5047p))
    }

    #[test]
    fn clock_divider_is_the_smallest_within_the_limit() {
        let clock = |source_hz: u32| source_hz / clock_divider(source_hz);
        // On the STM32G474 a divider of 16 would give 10.6 MHz.
        assert_eq!((clock_divider(170_000_000), clock(170_000_000)), (32, 5_312_500));
        assert_eq!(clock_divider(160_000_000), 16);
        for source_hz in (1_000_000..=600_000_000).step_by(777_777) {
            let (divider, clock) = (clock_divider(source_hz), clock(source_hz));
            assert!(divider.is_power_of_two() && clock <= MAX_CLOCK_HZ, "{source_hz}");
            assert!(divider == 2 || 2 * clock + 2 > MAX_CLOCK_HZ, "{source_hz}");
        }
    }

    #[test]
    fn commands_match_the_data_sheet() {
        assert_eq!((READ_ANGLE, READ_ERRORS), (0xFFFF, 0x4001));
        assert_eq!(EncoderType::As5047p.read_diagnostics(), 0xFFFC);
        assert_eq!(EncoderType::As5048a.read_diagnostics(), 0x7FFD);
    }

    #[test]
    fn constant_angle_is_reported_as_stuck_until_it_changes() {
        let (mut chip, mut pairs) = encoder();
        let good = (0..20_000).filter(|_| chip.pair(&mut pairs).is_ok()).count();
        let expected = usize::from(STUCK_AFTER_PAIRS);
        assert_eq!(good, expected, "the first angle differs from the initial value");
        assert_eq!(chip.pair(&mut pairs), Err(EncoderError::Stuck));
        chip.angle += 1;
        assert_eq!(chip.pair(&mut pairs), Ok(0x1235));
        // Occasional noise of one count is enough.
        for k in 0..20_000u16 {
            chip.angle = 0x1234 + u16::from(k.is_multiple_of(3000));
            assert_ne!(chip.pair(&mut pairs), Err(EncoderError::Stuck));
        }
    }

    #[test]
    fn pair_of_frames_returns_the_angle_latched_between_them() {
        let (mut chip, mut pairs) = encoder();
        for angle in [0x1234, 0x0001, 0x3FFF] {
            chip.angle = angle;
            assert_eq!(chip.pair(&mut pairs), Ok(angle));
        }
    }

    #[test]
    fn flipped_bit_loses_one_angle() {
        let (mut chip, mut pairs) = encoder();
        for bit in 0..14 {
            chip.flips = 1 << bit;
            assert_eq!(chip.pair(&mut pairs), Err(EncoderError::Parity));
            assert_eq!(chip.pair(&mut pairs), Ok(0x1234));
        }
    }

    #[test]
    fn pair_with_an_error_flag_reads_and_clears_it_in_the_next_pair() {
        let (mut chip, mut pairs) = encoder();
        assert_eq!(chip.pair(&mut pairs), Ok(0x1234));
        chip.errors = 0b10;
        assert_eq!(chip.pair(&mut pairs), Err(EncoderError::Flagged));
        assert_eq!(chip.pair(&mut pairs), Err(EncoderError::NoAngle));
        assert_eq!(chip.errors, 0);
        assert_eq!(chip.pair(&mut pairs), Ok(0x1234));
    }

    #[test]
    fn pair_reads_diagnostics_once_a_second_without_losing_an_angle() {
        let (mut chip, mut pairs) = encoder();
        chip.diagnostics = 0x0900;
        let mut faults = Vec::new();
        for period in 0..25_000u16 {
            // The angle changes, so that it is not stuck.
            chip.angle = 0x1000 + period % 7;
            assert_eq!(chip.pair(&mut pairs), Ok(chip.angle), "{period}");
            faults.push(pairs.has_magnet_fault());
            if period == 10_000 {
                chip.diagnostics = 0x0100;
            }
        }
        let changes = faults.windows(2).filter(|pair| pair[0] != pair[1]).count();
        assert_eq!((faults[900], faults[1100], faults[24_999], changes), (false, true, false, 2));
    }

    #[test]
    fn each_fault_of_the_magnet_is_found_in_the_diagnostics() {
        for (word, is_faulty) in [
            (0x0140, false),
            (0x0100, false),
            (0x09FF, true),
            (0x0200, true),
            (0x0400, true),
            (0x0800, true),
        ] {
            let (mut chip, mut pairs) = encoder();
            chip.diagnostics = word;
            for _ in 0..20_001 {
                let _ = chip.pair(&mut pairs);
            }
            assert_eq!(pairs.has_magnet_fault(), is_faulty, "{word:#x}");
        }
    }

    #[test]
    fn pair_that_is_missing_or_damaged_gives_no_angle() {
        let mut pairs = FramePairs::new(EncoderType::As5047p);
        assert_eq!(pairs.angle(None), Err(EncoderError::Missing));
        assert_eq!(pairs.angle(Some([0, 1])), Err(EncoderError::Parity));
        // A broken wire reads as ones.
        assert_eq!(pairs.angle(Some([u16::MAX; 2])), Err(EncoderError::Flagged));
        assert_eq!(pairs.angle(Some([u16::MAX; 2])), Err(EncoderError::NoAngle));
        assert_eq!(pairs.angle(Some([0, 3])), Ok(3));
    }

    #[test]
    fn broken_wire_gives_no_angle() {
        let mut pairs = FramePairs::new(EncoderType::As5047p);
        assert!((0..20).all(|_| pairs.angle(Some([u16::MAX; 2])).is_err()));
    }
}
