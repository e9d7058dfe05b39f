//! The converters: each converts a short sequence of channels at every trigger of a timer (RM0440, 21.4).
//!
//! All are set up by one function. That of the HAL is generic over the converter, and four copies of it take 2.5 kB.

use embassy_stm32::adc::AnyAdcChannel;
use embassy_stm32::pac::adc::regs::Jsqr;
use embassy_stm32::pac::adc::vals::{Adcaldif, Difsel, Exten, SampleTime};
use embassy_stm32::pac::adc::{Adc, regs::Difsel as Differential};
use embassy_stm32::pac::adccommon::{AdcCommon, vals::Presc};
use embassy_stm32::peripherals::{ADC1, ADC2};
use embassy_stm32::{Peri, PeripheralType, pac, rcc};

/// Divider of the processor's clock: 42.5 MHz, at most 60 MHz is allowed.
const PRESCALER: Presc = Presc::DIV4;

/// Time that regulator and calibration need, processor cycles: 20 us.
const SETTLING_CYCLES: u32 = super::clocks::CORE_HZ / 50_000;

/// Number of the second trigger of the PWM timer among those of converters 1 and 2: TIM1_TRGO2, at the top of the PWM.
const TOP_TRIGGER: u8 = 8;

/// Start of a sequence.
pub struct Trigger {
    /// Number of the signal (RM0440, tables 166 and 168).
    pub signal: u8,
    /// Its edge.
    pub edge: Exten,
    /// The end of a sequence is an interrupt.
    pub interrupt: bool,
}

/// Starts the converter `T`, which has the registers `adc` and whose clock is enabled, with a sequence of `N` channels.
pub fn start<T: PeripheralType, const N: usize>(
    _converter: Peri<'static, T>,
    adc: Adc,
    common: AdcCommon,
    sequence: [(AnyAdcChannel<'static, T>, SampleTime); N],
    trigger: Trigger,
) {
    set_up(adc, common, &sequence.map(|(channel, time)| (channel.get_hw_channel(), time)), trigger);
}

/// Channels of a converter at the top of the PWM: a phase current, and a slower divider.
type TopChannels<T> = [AnyAdcChannel<'static, T>; 2];

/// Starts converters 1 and 2 at the top of the PWM. At 42.5 MHz a current is sampled for 0.3 us. The slower dividers follow it.
/// The interrupt is that of converter 1.
#[inline(always)]
pub fn start_at_top(
    (adc_a, channels_a): (Peri<'static, ADC1>, TopChannels<ADC1>),
    (adc_b, channels_b): (Peri<'static, ADC2>, TopChannels<ADC2>),
) {
    rcc::enable_and_reset::<ADC1>();
    rcc::enable_and_reset::<ADC2>();
    let trigger =
        |interrupt: bool| Trigger { signal: TOP_TRIGGER, edge: Exten::RISING_EDGE, interrupt };
    start(adc_a, pac::ADC1, pac::ADC12_COMMON, timed(channels_a), trigger(true));
    start(adc_b, pac::ADC2, pac::ADC12_COMMON, timed(channels_b), trigger(false));
}

fn timed<T>([phase, divider]: TopChannels<T>) -> [(AnyAdcChannel<'static, T>, SampleTime); 2] {
    [(phase, SampleTime::CYCLES12_5), (divider, SampleTime::CYCLES24_5)]
}

/// Returns the last results of a sequence of `N` channels.
pub fn read_results<const N: usize>(adc: Adc) -> [u16; N] {
    core::array::from_fn(|rank| adc.jdr(rank).read().jdata())
}

#[inline(never)]
fn set_up(adc: Adc, common: AdcCommon, sequence: &[(u8, SampleTime)], trigger: Trigger) {
    common.ccr().modify(|w| w.set_presc(PRESCALER));
    adc.cr().modify(|w| {
        w.set_deeppwd(false);
        w.set_advregen(true);
    });
    cortex_m::asm::delay(SETTLING_CYCLES);
    let mut single_ended = Differential::default();
    (0..18).for_each(|channel| single_ended.set_difsel(channel, Difsel::SINGLE_ENDED));
    adc.difsel().write_value(single_ended);
    adc.cr().modify(|w| w.set_adcaldif(Adcaldif::SINGLE_ENDED));
    adc.cr().modify(|w| w.set_adcal(true));
    while adc.cr().read().adcal() {}
    cortex_m::asm::delay(SETTLING_CYCLES);
    adc.isr().write(|w| w.set_adrdy(true));
    adc.cr().modify(|w| w.set_aden(true));
    while !adc.isr().read().adrdy() {}

    let mut ranks = Jsqr::default();
    ranks.set_jl(sequence.len() as u8 - 1);
    ranks.set_jextsel(trigger.signal);
    ranks.set_jexten(trigger.edge);
    for (rank, (channel, time)) in sequence.iter().enumerate() {
        ranks.set_jsq(rank, *channel);
        match channel {
            0..=9 => adc.smpr().modify(|w| w.set_smp(usize::from(*channel), *time)),
            _ => adc.smpr2().modify(|w| w.set_smp(usize::from(*channel) - 10, *time)),
        }
    }
    adc.jsqr().write_value(ranks);
    adc.ier().modify(|w| w.set_jeosie(trigger.interrupt));
    adc.cr().modify(|w| w.set_jadstart(true));
}
