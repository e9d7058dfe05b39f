//! The motor as the current loop sees it: bridge, shunts and encoder together.
//!
//! The library's `LoopTask` is the interrupt; this is the [`PowerStage`] it works on. Counts become SI units
//! here, with the offsets the shunts' amplifiers had at the start. The encoder is read in the interrupt, so
//! its angle is that of the frame before; `encoder_delay_s` says so to the loop.

use super::power_stage::{Counts, Stage};
use super::{pins, scales};
use cortex_m::peripheral::DWT;
use embassy_stm32::gpio::{Level, Output, Pull, Speed};
use embassy_stm32::mode::Blocking;
use embassy_stm32::peripherals::SPI1;
use embassy_stm32::spi::mode::Master;
use embassy_stm32::spi::{self, Spi};
use embassy_stm32::{pac, rcc};
use embedded_hal::delay::DelayNs;
use embedded_hal_bus::spi::ExclusiveDevice;
use firmware::control::{Broke, PowerStage, StageSample, Valid, encoder_angle};
use firmware::sensors::as504x::{ANGLE_BITS, As504x};
use firmware::sensors::shunt::{OFFSET_SAMPLES, OffsetFinder, Shunt};

/// Periods the gate driver's amplifiers have to wake up, 5 ms.
const WAKING: u32 = 100;

/// The encoder on its bus.
pub type Encoder = As504x<ExclusiveDevice<Spi<'static, Blocking, Master>, Output<'static>, Cycles>>;

/// Waits by counting cycles.
pub struct Cycles;

impl DelayNs for Cycles {
    fn delay_ns(&mut self, ns: u32) {
        cortex_m::asm::delay(ns.saturating_mul(scales::CORE_HZ / 10_000_000) / 100);
    }
}

/// Bridge, shunts and encoder.
pub struct MotorStage {
    pub stage: Stage,
    pub encoder: Encoder,
    /// Of phases a and b; `None` where no offset was found.
    pub shunts: [Option<Shunt>; 2],
}

impl PowerStage for MotorStage {
    #[inline(always)]
    fn sample(&mut self) -> StageSample {
        let counts = self.stage.counts();
        let angle = self.encoder.angle().ok();
        sample(counts, &self.shunts, angle.map(|angle| encoder_angle(u32::from(angle), ANGLE_BITS)))
    }

    #[inline(always)]
    fn broke(&mut self) -> Option<Broke> {
        self.stage.broke()
    }

    #[inline(always)]
    fn wake(&mut self, awake: bool) {
        self.stage.wake(awake);
    }

    #[inline(always)]
    fn drive(&mut self, duty: [f32; 3]) {
        self.stage.drive(duty);
    }

    #[inline(always)]
    fn off(&mut self) {
        self.stage.off();
    }

    #[inline(always)]
    fn cycles(&self) -> u32 {
        DWT::cycle_count()
    }
}

/// What the loop is given for these counts.
#[inline(always)]
fn sample(counts: Counts, shunts: &[Option<Shunt>; 2], encoder: Option<u32>) -> StageSample {
    let [a, b] = shunts;
    let a = a.as_ref().and_then(|shunt| shunt.current_a(counts.phase_a));
    let b = b.as_ref().and_then(|shunt| shunt.current_a(counts.phase_b));
    let mut valid = Valid::BUS;
    valid.set(Valid::CURRENT_A, a.is_some());
    valid.set(Valid::CURRENT_B, b.is_some());
    valid.set(Valid::ENCODER, encoder.is_some());
    StageSample {
        currents_a: [a.unwrap_or(0.0), b.unwrap_or(0.0), 0.0],
        // Half a count more, so that no power is a low voltage and not a missing one.
        bus_v: (f32::from(counts.bus) + 0.5) * scales::VOLTS_PER_COUNT,
        encoder: encoder.unwrap_or(0),
        valid,
    }
}

/// Amplifiers' offsets: the bridge is off, so what is measured is no current.
pub fn find_offsets(stage: &mut Stage) -> [Option<Shunt>; 2] {
    let mut finders = [OffsetFinder::default(); 2];
    for _ in 0..WAKING {
        stage.wait();
    }
    for _ in 0..OFFSET_SAMPLES {
        let counts = stage.wait();
        for (finder, counts) in finders.iter_mut().zip([counts.phase_a, counts.phase_b]) {
            finder.take(counts);
        }
    }
    // The fault a gate driver shows while it wakes is forgotten.
    stage.off();
    finders.map(|finder| finder.shunt(scales::AMPERES_PER_COUNT))
}

/// Whether the encoder's clock is what was meant: the divider in the register, of the clock there is.
pub fn encoder_clock_is_right() -> bool {
    let divider = 2 << pac::SPI1.cr1().read().br().to_bits();
    divider == scales::ENCODER_DIVIDER && rcc::frequency::<SPI1>().0 == scales::CORE_HZ
}

/// Sets the encoder's bus up.
pub fn encoder(wired: pins::Encoder) -> Encoder {
    let mut config = spi::Config::default();
    config.mode = spi::MODE_1;
    config.frequency = scales::ENCODER_CLOCK;
    config.miso_pull = Pull::Up;
    let bus = Spi::new_blocking(wired.spi, wired.clock, wired.out, wired.back, config);
    let select = Output::new(wired.select, Level::High, Speed::VeryHigh);
    match ExclusiveDevice::new(bus, select, Cycles) {
        Ok(device) => As504x::new(device),
        Err(never) => match never {},
    }
}
