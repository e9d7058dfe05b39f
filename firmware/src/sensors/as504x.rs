//! Magnetic encoders of the kind AS5047P and AS5048A: 14 bits of a turn over SPI.
//!
//! A frame is 16 bits both ways, mode 1 (clock low at rest, sampled on its falling edge), at most 10 MHz. Out goes
//! a command: even parity, read bit, register. Back comes what the frame *before* asked for: even parity,
//! an error flag, 14 bits. So one frame a period is enough, and the angle it brings was latched at the end
//! of the frame before: a period of age, which belongs in `encoder_delay_s` together with the sensor's own.
//!
//! A word of zeros has its parity right and no error flag: a line that lies low, and a chip that hangs, look like a shaft at
//! rest. But these encoders are noisy by three counts (0.068 degrees); one whose angle stays the same bits for [`STUCK_AFTER`]
//! frames is stuck.
//!
//! The error flag stays until the error register was read. That takes two frames without an angle, over
//! which the observer coasts. A broken wire reads as ones (pull up the input): the error flag is then up.

use embedded_hal::spi::{Operation, SpiDevice};

/// Bits of an angle.
pub const ANGLE_BITS: u32 = 14;

/// Fastest clock it stands, Hz (data sheet: t_clk 100 ns at least).
pub const CLOCK_MAX_HZ: u32 = 10_000_000;

/// The least divider of an SPI's clock source, of 2 to 256 in powers of two, that keeps to [`CLOCK_MAX_HZ`]. Asking a
/// driver for a frequency will not do: they round, and 170 MHz by 16 is 10.6 MHz.
///
/// # Panics
/// Where even 256 is not enough; in a constant, that does not compile.
pub const fn clock_divider(source_hz: u32) -> u32 {
    let mut divider = 2;
    while source_hz > divider * CLOCK_MAX_HZ {
        divider *= 2;
    }
    assert!(divider <= 256, "no divider is large enough");
    divider
}

/// Command to read the angle; at this address both kinds have it.
const READ_ANGLE: u16 = command(0x3FFF);
/// Command to read the errors, which clears them.
const READ_ERRORS: u16 = command(0x0001);

const ERROR: u16 = 1 << 14;
const DATA: u16 = ERROR - 1;

/// Frames with the very same angle after which it is no measurement any more: 0.2 s at 20 kHz. Of noise of three counts every
/// eighth sample at most repeats the one before; at a tenth of it, and the angle in the middle of a count, it still moves.
pub const STUCK_AFTER: u16 = 4000;

/// From chip select to the first clock, and from the last clock back, ns (data sheet: t_L, t_H).
const SELECT_NS: u32 = 350;
const RELEASE_NS: u32 = 100;

/// A read command: even parity in the top bit.
const fn command(register: u16) -> u16 {
    let word = ERROR | (register & DATA);
    word | ((word.count_ones() as u16 & 1) << 15)
}

/// Why a frame brought no angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncoderError<E> {
    /// The bus.
    Spi(E),
    /// Parity does not fit.
    Parity,
    /// It has been the same to the bit for [`STUCK_AFTER`] frames.
    Stuck,
    /// The encoder reports an error; it is being asked which, and the flag cleared.
    Flagged,
    /// The frame carries no angle: it is the first, or the answer about errors.
    NoAngle,
}

/// What the next frame will bring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Awaited {
    Unknown,
    Angle,
    Errors,
}

/// An encoder.
#[derive(Debug)]
pub struct As504x<S> {
    spi: S,
    awaited: Awaited,
    errors: u16,
    /// The last angle, and frames since it was another.
    last: u16,
    same: u16,
}

impl<S: SpiDevice<u16>> As504x<S> {
    /// An encoder nothing was asked of yet.
    pub fn new(spi: S) -> Self {
        Self { spi, awaited: Awaited::Unknown, errors: 0, last: 0, same: 0 }
    }

    /// Exchanges one frame; gives the angle that was latched at the end of the one before, in 14 bits.
    ///
    /// # Errors
    /// Says why there is no angle; go on calling, it mends what can be mended.
    #[inline]
    pub fn angle(&mut self) -> Result<u16, EncoderError<S::Error>> {
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
        if !answer.count_ones().is_multiple_of(2) {
            return Err(EncoderError::Parity);
        }
        match awaited {
            Awaited::Unknown => Err(EncoderError::NoAngle),
            Awaited::Errors => {
                self.errors |= answer & DATA;
                Err(EncoderError::NoAngle)
            }
            Awaited::Angle if answer & ERROR != 0 => {
                // Ask which, in a frame of its own; the answer to the one just sent is lost with it.
                self.clear();
                Err(EncoderError::Flagged)
            }
            Awaited::Angle => {
                let angle = answer & DATA;
                self.same = if angle == self.last { self.same.saturating_add(1) } else { 0 };
                self.last = angle;
                if self.same < STUCK_AFTER { Ok(angle) } else { Err(EncoderError::Stuck) }
            }
        }
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

    /// Every bit of the error register seen since the last call: 0 framing, 1 command, 2 parity.
    pub fn take_errors(&mut self) -> u16 {
        core::mem::take(&mut self.errors)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::convert::Infallible;
    use embedded_hal::spi::ErrorType;

    /// An encoder as its data sheet has it: answers a frame late, holds its error flag.
    struct Chip {
        angle: u16,
        answer: u16,
        errors: u16,
        flips: u16,
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
                    other => panic!("register {other:#x}"),
                };
                let word = flag | data;
                self.answer = word | ((word.count_ones() as u16 & 1) << 15);
            }
            Ok(())
        }
    }

    fn encoder() -> As504x<Chip> {
        As504x::new(Chip { angle: 0x1234, answer: 0, errors: 0, flips: 0, asked: Vec::new() })
    }

    #[test]
    fn the_clock_is_the_fastest_that_it_stands() {
        let clock = |source_hz: u32| source_hz / clock_divider(source_hz);
        // The STM32G474's: by 16 it would be 10.6 MHz.
        assert_eq!((clock_divider(170_000_000), clock(170_000_000)), (32, 5_312_500));
        assert_eq!(clock_divider(160_000_000), 16);
        for source_hz in (1_000_000..=600_000_000).step_by(777_777) {
            let (divider, clock) = (clock_divider(source_hz), clock(source_hz));
            assert!(divider.is_power_of_two() && clock <= CLOCK_MAX_HZ, "{source_hz}");
            assert!(divider == 2 || 2 * clock + 2 > CLOCK_MAX_HZ, "{source_hz}");
        }
    }

    #[test]
    fn commands_are_the_data_sheets() {
        assert_eq!((READ_ANGLE, READ_ERRORS), (0xFFFF, 0x4001));
    }

    #[test]
    fn an_angle_that_never_changes_is_none_until_it_does() {
        let mut encoder = encoder();
        let good = (0..20_000).filter(|_| encoder.angle().is_ok()).count();
        assert_eq!(good, usize::from(STUCK_AFTER), "the first of them is another than before");
        assert_eq!(encoder.angle(), Err(EncoderError::Stuck));
        encoder.spi.angle += 1;
        let _ = encoder.angle();
        assert_eq!(encoder.angle(), Ok(0x1235));
        // Noise of a count now and then is enough.
        for k in 0..20_000u16 {
            encoder.spi.angle = 0x1234 + u16::from(k.is_multiple_of(3000));
            assert!(encoder.angle().is_ok());
        }
    }

    #[test]
    fn an_angle_comes_a_frame_late() {
        let mut encoder = encoder();
        assert_eq!(encoder.angle(), Err(EncoderError::NoAngle));
        encoder.spi.angle = 0x3FFF;
        assert_eq!(encoder.angle(), Ok(0x1234));
        assert_eq!(encoder.angle(), Ok(0x3FFF));
    }

    #[test]
    fn a_flipped_bit_costs_one_angle() {
        let mut encoder = encoder();
        let _ = encoder.angle();
        for bit in 0..14 {
            encoder.spi.flips = 1 << bit;
            assert_eq!(encoder.angle(), Err(EncoderError::Parity));
            assert_eq!(encoder.angle(), Ok(0x1234));
        }
    }

    #[test]
    fn an_error_flag_is_read_cleared_and_told() {
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

    #[test]
    fn a_broken_wire_is_no_angle() {
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
