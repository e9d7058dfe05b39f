//! Magnetic encoders AS5047P and AS5048A: a 14-bit angle over SPI.
//!
//! A frame has 16 bits in both directions, mode 1 (clock low when idle, sampled on its falling edge), at
//! most 10 MHz. The command holds even parity, a read bit and a register. The answer belongs to the
//! *previous* command and holds even parity, an error flag and 14 bits. One frame per period is therefore
//! enough. Its angle was latched at the end of the previous frame, so it is one period old;
//! `encoder_delay_s` includes that and the sensor's own delay.
//!
//! A word of zeros has correct parity and no error flag, so a data line held low or a chip that hangs looks
//! like a shaft at rest. However, these encoders have a noise of three counts (0.068 degrees). An angle
//! that stays exactly the same for [`STUCK_AFTER_FRAMES`] frames is therefore reported as stuck. While the joint
//! turns, the observer finds it within a millisecond ([`crate::control::observer`]).
//!
//! Once a second one frame asks for the diagnostics instead of the angle, and the observer coasts for one period. They
//! report a magnet that is too weak, too strong or misplaced, before the angle becomes wrong.
//!
//! The error flag stays set until the error register is read. That takes two frames without an angle,
//! during which the observer coasts. A broken wire reads as ones (the input must be pulled up), so the
//! error flag is set.
//!
//! [`As504x`] exchanges one frame in each period on an SPI bus. [`FramePairs`] evaluates two frames in each
//! period that hardware has exchanged: the second one answers the first, so its angle was latched between
//! the two, microseconds before the period's sample.

mod frames;
mod pairs;

pub use frames::{EncoderError, EncoderType, STUCK_AFTER_FRAMES};
pub use pairs::FramePairs;

use embedded_hal::spi::{Operation, SpiDevice};
use frames::{AnswerCheck, Awaited, READ_ANGLE, READ_ERRORS};

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

/// Frames from one reading of the diagnostics to the next: a second at 20 kHz.
const DIAGNOSE_EVERY_FRAMES: u16 = 20_000;
/// Frames from the start to the first reading: 50 ms.
const DIAGNOSE_AFTER_FRAMES: u16 = 1000;

/// Delays from chip select to the first clock, and from the last clock to its release, ns (data sheet: t_L,
/// t_H).
pub const SELECT_NS: u32 = 350;
/// See [`SELECT_NS`].
pub const RELEASE_NS: u32 = 100;
/// Minimum time between two frames in which the chip is not selected, ns (data sheet: t_CSn).
pub const DESELECTED_NS: u32 = 350;

/// One encoder.
#[derive(Debug)]
pub struct As504x<S> {
    spi: S,
    awaited: Awaited,
    check: AnswerCheck,
    encoder_type: EncoderType,
    /// Number of frames until the next diagnostics.
    frames_left: u16,
}

impl<S: SpiDevice<u16>> As504x<S> {
    /// Creates the driver; no command was sent yet.
    pub fn new(spi: S) -> Self {
        Self {
            spi,
            awaited: Awaited::Unknown,
            check: AnswerCheck::new(),
            encoder_type: EncoderType::default(),
            frames_left: DIAGNOSE_AFTER_FRAMES,
        }
    }

    /// Returns the driver for this type; [`As504x::new`] creates it for an AS5047P.
    #[must_use]
    pub fn of_type(self, encoder_type: EncoderType) -> Self {
        Self { encoder_type, ..self }
    }

    /// Returns true if the last diagnostics report a magnet that is too weak, too strong or misplaced.
    #[inline]
    pub const fn has_magnet_fault(&self) -> bool {
        self.check.has_magnet_fault()
    }

    /// Returns the gain that the encoder needs for its magnet, 0 (strong) to 255 (weak), of the last diagnostics.
    pub const fn gain(&self) -> u8 {
        self.check.diagnostics as u8
    }

    /// Exchanges one frame. Returns the 14-bit angle that was latched at the end of the previous frame.
    ///
    /// # Errors
    /// Returns why there is no angle. Keep calling: the driver recovers if possible.
    #[inline]
    pub fn angle(&mut self) -> Result<u16, EncoderError<S::Error>> {
        self.frames_left = self.frames_left.wrapping_sub(1);
        if self.frames_left == 0 {
            self.frames_left = DIAGNOSE_EVERY_FRAMES;
            return self.exchange(self.encoder_type.read_diagnostics(), Awaited::Diagnostics);
        }
        self.exchange(READ_ANGLE, Awaited::Angle)
    }

    fn exchange(&mut self, ask: u16, next: Awaited) -> Result<u16, EncoderError<S::Error>> {
        let awaited = self.awaited;
        let (ask, next) =
            if awaited == Awaited::Errors { (READ_ANGLE, Awaited::Angle) } else { (ask, next) };
        let answer = match self.frame(ask) {
            Ok(answer) => answer,
            Err(error) => {
                self.awaited = Awaited::Unknown;
                return Err(EncoderError::Spi(error));
            }
        };
        self.awaited = next;
        let angle = self.check.angle(awaited, answer);
        if matches!(angle, Err(EncoderError::Flagged)) {
            // Read the error register in a separate frame. The answer to the command just sent is lost.
            self.clear();
        }
        angle
    }

    fn frame(&mut self, ask: u16) -> Result<u16, S::Error> {
        let mut word = [ask];
        self.spi.transaction(&mut [
            Operation::DelayNs(SELECT_NS),
            Operation::TransferInPlace(&mut word),
            Operation::DelayNs(RELEASE_NS),
        ])?;
        let [answer] = word;
        Ok(answer)
    }

    fn clear(&mut self) {
        let sent = self.frame(READ_ERRORS).is_ok();
        self.awaited = if sent { Awaited::Errors } else { Awaited::Unknown };
    }

    /// Returns all bits of the error register since the last call: 0 framing, 1 command, 2 parity.
    pub fn take_errors(&mut self) -> u16 {
        core::mem::take(&mut self.check.errors)
    }
}

#[cfg(test)]
mod tests {
    use super::frames::{DATA, ERROR};
    use super::*;
    use core::convert::Infallible;
    use embedded_hal::spi::ErrorType;

    /// A simulated encoder: it answers one frame late and holds its error flag.
    struct Chip {
        angle: u16,
        answer: u16,
        errors: u16,
        flips: u16,
        diagnostics: u16,
        asked: Vec<u16>,
    }

    impl ErrorType for Chip {
        type Error = Infallible;
    }

    impl SpiDevice<u16> for Chip {
        fn transaction(&mut self, steps: &mut [Operation<'_, u16>]) -> Result<(), Infallible> {
            for step in steps {
                let words = match step {
                    Operation::TransferInPlace(words) => words,
                    Operation::DelayNs(_) => continue,
                    other => panic!("{other:?}"),
                };
                let asked = words[0];
                self.asked.push(asked);
                words[0] = self.answer ^ core::mem::take(&mut self.flips);
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
            }
            Ok(())
        }
    }

    fn encoder() -> As504x<Chip> {
        As504x::new(Chip {
            angle: 0x1234,
            answer: 0,
            errors: 0,
            flips: 0,
            diagnostics: 0x0140,
            asked: Vec::new(),
        })
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
        let mut encoder = encoder();
        let good = (0..20_000).filter(|_| encoder.angle().is_ok()).count();
        let expected = usize::from(STUCK_AFTER_FRAMES);
        assert_eq!(good, expected, "the first angle differs from the initial value");
        assert_eq!(encoder.angle(), Err(EncoderError::Stuck));
        encoder.spi.angle += 1;
        let _ = encoder.angle();
        assert_eq!(encoder.angle(), Ok(0x1235));
        // Occasional noise of one count is enough.
        for k in 0..20_000u16 {
            encoder.spi.angle = 0x1234 + u16::from(k.is_multiple_of(3000));
            assert_ne!(encoder.angle(), Err(EncoderError::Stuck));
        }
    }

    #[test]
    fn diagnostics_are_read_once_a_second_and_cost_one_angle() {
        let mut encoder = encoder();
        let mut lost = Vec::new();
        for frame in 0..50_000u32 {
            // The angle changes, so that it is not stuck.
            encoder.spi.angle = 0x1000 + (frame % 7) as u16;
            if encoder.angle().is_err() {
                lost.push(frame);
            }
            if frame == 1500 {
                assert!(!encoder.has_magnet_fault(), "a sound magnet");
                assert_eq!(encoder.gain(), 0x40);
                encoder.spi.diagnostics = 0x09FF;
            }
        }
        assert_eq!(lost, [0, 1000, 21_000, 41_000]);
        assert!(encoder.has_magnet_fault() && encoder.gain() == 255, "a weak magnet");
        for (word, faulty) in [(0x0100, false), (0x0200, true), (0x0400, true), (0x0800, true)] {
            encoder.spi.diagnostics = word;
            for _ in 0..20_001 {
                let _ = encoder.angle();
            }
            assert_eq!(encoder.has_magnet_fault(), faulty, "{word:#x}");
        }
    }

    #[test]
    fn angle_arrives_one_frame_late() {
        let mut encoder = encoder();
        assert_eq!(encoder.angle(), Err(EncoderError::NoAngle));
        encoder.spi.angle = 0x3FFF;
        assert_eq!(encoder.angle(), Ok(0x1234));
        assert_eq!(encoder.angle(), Ok(0x3FFF));
    }

    #[test]
    fn flipped_bit_loses_one_angle() {
        let mut encoder = encoder();
        let _ = encoder.angle();
        for bit in 0..14 {
            encoder.spi.flips = 1 << bit;
            assert_eq!(encoder.angle(), Err(EncoderError::Parity));
            assert_eq!(encoder.angle(), Ok(0x1234));
        }
    }

    #[test]
    fn error_flag_is_reported_read_and_cleared() {
        let mut encoder = encoder();
        let _ = encoder.angle();
        encoder.spi.errors = 0b10;
        assert_eq!(encoder.angle(), Ok(0x1234));
        assert_eq!(encoder.angle(), Err(EncoderError::Flagged));
        assert_eq!(encoder.angle(), Err(EncoderError::NoAngle));
        assert_eq!(encoder.angle(), Ok(0x1234));
        assert_eq!(encoder.take_errors(), 0b10);
        assert_eq!(encoder.take_errors(), 0);
    }

    /// Exchanges a pair of frames.
    fn pair(chip: &mut Chip, pairs: &mut FramePairs) -> Result<u16, EncoderError<Infallible>> {
        let mut answers = pairs.commands();
        for word in &mut answers {
            let mut words = [*word];
            let _ = chip.transaction(&mut [Operation::TransferInPlace(&mut words)]);
            [*word] = words;
        }
        pairs.angle(Some(answers))
    }

    #[test]
    fn pair_of_frames_returns_the_angle_latched_between_them() {
        let (mut chip, mut pairs) = (encoder().spi, FramePairs::new(EncoderType::As5047p));
        for angle in [0x1234, 0x0001, 0x3FFF] {
            chip.angle = angle;
            assert_eq!(pair(&mut chip, &mut pairs), Ok(angle));
        }
    }

    #[test]
    fn pair_with_an_error_flag_reads_and_clears_it_in_the_next_pair() {
        let (mut chip, mut pairs) = (encoder().spi, FramePairs::new(EncoderType::As5047p));
        assert_eq!(pair(&mut chip, &mut pairs), Ok(0x1234));
        chip.errors = 0b10;
        assert_eq!(pair(&mut chip, &mut pairs), Err(EncoderError::Flagged));
        assert_eq!(pair(&mut chip, &mut pairs), Err(EncoderError::NoAngle));
        assert_eq!(pair(&mut chip, &mut pairs), Ok(0x1234));
        assert_eq!((pairs.take_errors(), pairs.take_errors()), (0b10, 0));
    }

    #[test]
    fn pair_reads_diagnostics_once_a_second_without_losing_an_angle() {
        let (mut chip, mut pairs) = (encoder().spi, FramePairs::new(EncoderType::As5047p));
        chip.diagnostics = 0x0900;
        let mut faults = Vec::new();
        for period in 0..25_000u16 {
            // The angle changes, so that it is not stuck.
            chip.angle = 0x1000 + period % 7;
            assert_eq!(pair(&mut chip, &mut pairs), Ok(chip.angle), "{period}");
            faults.push(pairs.has_magnet_fault());
            if period == 10_000 {
                chip.diagnostics = 0x0100;
            }
        }
        let changes = faults.windows(2).filter(|pair| pair[0] != pair[1]).count();
        assert_eq!((faults[900], faults[1100], faults[24_999], changes), (false, true, false, 2));
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
        struct Wire(u16);
        impl ErrorType for Wire {
            type Error = Infallible;
        }
        impl SpiDevice<u16> for Wire {
            fn transaction(&mut self, steps: &mut [Operation<'_, u16>]) -> Result<(), Infallible> {
                for step in steps {
                    if let Operation::TransferInPlace(words) = step {
                        words.fill(self.0);
                    }
                }
                Ok(())
            }
        }
        let mut encoder = As504x::new(Wire(0xFFFF));
        assert!((0..20).all(|_| encoder.angle().is_err()));
    }
}
