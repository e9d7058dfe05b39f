//! The lines of an ABZ encoder or of three Hall sensors, on the same pins. An encoder on SPI has no pins.

use super::pins::LINES;
use super::{counter, pins};
use embassy_stm32::gpio::{Input, Pull};
use embassy_stm32::peripherals::TIM4;
use embassy_stm32::rcc;
use embassy_stm32::timer::input_capture::CapturePin;
use firmware::sensors::biss;
use firmware::sensors::encoder::{EncoderInputs, EncoderKind};
use firmware::sensors::quadrature::Quadrature;

/// The lines.
pub struct Encoder;

impl Encoder {
    /// Connects the lines as this kind of encoder needs them. A kind without lines on this board has no angle.
    pub fn connect(kind: EncoderKind, wired: pins::Lines) -> Self {
        match kind {
            EncoderKind::Abz => {
                // They stay connected.
                core::mem::forget((
                    CapturePin::<TIM4, _>::new(wired.a, Pull::Up),
                    CapturePin::<TIM4, _>::new(wired.b, Pull::Up),
                    CapturePin::<TIM4, _>::new(wired.index, Pull::Up),
                ));
                rcc::enable_and_reset::<TIM4>();
                counter::start();
            }
            EncoderKind::Hall => core::mem::forget((
                Input::new(wired.a, Pull::Up),
                Input::new(wired.b, Pull::Up),
                Input::new(wired.index, Pull::Up),
            )),
            EncoderKind::As5047p
            | EncoderKind::As5048a
            | EncoderKind::AbzHall
            | EncoderKind::Biss => {}
        }
        Self
    }
}

impl EncoderInputs for Encoder {
    #[inline(always)]
    fn frames(&mut self) -> Option<[u16; 2]> {
        None
    }

    #[inline(always)]
    fn set_commands(&mut self, _commands: [u16; 2]) {}

    #[inline(always)]
    fn biss(&mut self) -> Option<[u16; biss::WORDS]> {
        None
    }

    #[inline(always)]
    fn quadrature(&mut self) -> Quadrature {
        counter::read()
    }

    /// The levels; with an ABZ encoder and Hall sensors they are those of the lines, which contradict the sensors.
    #[inline(always)]
    fn hall(&mut self) -> u8 {
        let (port, first) = LINES;
        (port.idr().read().0 >> first) as u8 & 7
    }
}
