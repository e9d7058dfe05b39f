//! Frequencies, scales and levels of this board: the values to change with its parts.

use embassy_stm32::time::Hertz;
use firmware::control::PERIOD_S;
use firmware::deadline::DeadlineLimits;
use firmware::loop_parts::StageTraits;
use firmware::node::bit_timing::{BIT_RATES_KBIT, BitTiming};
use firmware::sensors::as504x::{MAX_CLOCK_HZ, clock_divider};
use firmware::sensors::quiet::QuietWindow;
use firmware::sensors::shunt::{CONVERTER_RANGE_COUNTS, measurable_a};

/// Crystal, Hz. CAN at 1 Mbit/s requires one; the internal oscillator is not accurate enough.
pub const CRYSTAL_HZ: u32 = 24_000_000;
/// Processor, timers and converter clock source, Hz: 24 MHz / 6 x 85 / 2.
pub const CORE_HZ: u32 = 170_000_000;
/// Loop rate, Hz.
pub const LOOP_HZ: u32 = 20_000;
const _: () =
    assert!((LOOP_HZ as f32 * PERIOD_S - 1.0).abs() < 1e-6, "the loop rate must match PERIOD_S");
/// Counts of the PWM timer from bottom to top; it counts up and down in a period.
pub const PWM_TOP: u16 = (CORE_HZ / LOOP_HZ / 2) as u16;
/// Dead time of a half bridge, in timer counts (500 ns). At most 127.
pub const DEAD_TIME: u8 = 85;

/// Periods for which the compensation stays off after a late one: 0.1 s.
const HOLD_PERIODS: u32 = LOOP_HZ / 10;
/// Time limits of a period.
pub const LIMITS: DeadlineLimits = DeadlineLimits::for_period(CORE_HZ / LOOP_HZ, HOLD_PERIODS);

/// Reference of the converters, V.
const REFERENCE_V: f32 = 3.3;
/// Scale of the shunts: 1 mohm, gain 20. A current into the motor lowers the voltage of a low-side shunt, unless the
/// parameter `shunt_sign` states otherwise.
pub const AMPERES_PER_COUNT: f32 = -REFERENCE_V / (CONVERTER_RANGE_COUNTS as f32 * 0.001 * 20.0);
/// Phase current at which the comparators open the bridge, A.
///
/// It is 10 % above `overcurrent_a`, so that a working processor trips first and reports the value. Levels,
/// amplifiers and comparators are off by 2 A at most (9 mV, 10 counts, 0.3 A, 1 %). Half of it is below the
/// current limit, twice of it above the range of an amplifier (82 A).
const BREAK_A: f32 = 44.0;
const MIDDLE_COUNTS: u16 = CONVERTER_RANGE_COUNTS / 2;
const BREAK_COUNTS: u16 = (-BREAK_A / AMPERES_PER_COUNT) as u16;
const _: () = assert!(
    BREAK_COUNTS < MIDDLE_COUNTS - CONVERTER_RANGE_COUNTS / 20,
    "the level is at the amplifier's rail"
);
/// Upper level of the amplifier of a phase, counts.
pub const BREAK_ABOVE: u16 = MIDDLE_COUNTS + BREAK_COUNTS;
/// Lower level of the amplifier of a phase, counts.
pub const BREAK_BELOW: u16 = MIDDLE_COUNTS - BREAK_COUNTS;
/// Upper level of the mean of two amplifiers, which shows half of the current in the third phase, counts.
pub const BREAK_MEAN_ABOVE: u16 = MIDDLE_COUNTS + BREAK_COUNTS / 2;
/// Lower level of the mean of two amplifiers, counts.
pub const BREAK_MEAN_BELOW: u16 = MIDDLE_COUNTS - BREAK_COUNTS / 2;

/// Scale of the bus voltage: divider of 68 k over 3.3 k.
pub const VOLTS_PER_COUNT: f32 = REFERENCE_V / CONVERTER_RANGE_COUNTS as f32 * (68.0 + 3.3) / 3.3;

/// Pressure inside the housing, Pa: it is closed at the surface.
pub const INSIDE_PA: f32 = 101_325.0;

/// Clock of the CAN controller, Hz. It must be a multiple of every supported bit rate.
pub const CAN_HZ: u32 = CORE_HZ;
const _: () = {
    let mut index = 0;
    while index < BIT_RATES_KBIT.len() {
        assert!(
            BitTiming::for_rate(CAN_HZ, BIT_RATES_KBIT[index] as u32 * 1000).is_some(),
            "every bit rate must have a timing"
        );
        index += 1;
    }
};

/// Settling time of a shunt's amplifier once its low side conducts, s: 1.5 us to 0.5 % at a gain of 20.
const AMPLIFIER_SETTLING_S: f32 = 1.5e-6;
/// Properties of the stage that the loop uses.
pub const STAGE: StageTraits = StageTraits {
    // The angle belongs to the previous frame, which began 2 us after the previous top.
    encoder_age_s: PERIOD_S - 2e-6,
    current_max_a: measurable_a(AMPERES_PER_COUNT),
    modulation_max: StageTraits::max_modulation(
        PERIOD_S,
        DEAD_TIME as f32 / CORE_HZ as f32,
        AMPLIFIER_SETTLING_S,
    ),
};
/// Divider of the encoder's clock: 5.3 MHz from 170 MHz. The next smaller one gives 10.6 MHz, above the
/// limit of 10 MHz.
pub const ENCODER_DIVIDER: u32 = clock_divider(CORE_HZ);
/// Clock of the encoder, requested exactly, because embassy rounds to the nearest divider, up or down.
pub const ENCODER_CLOCK: Hertz = Hertz(CORE_HZ / ENCODER_DIVIDER);
const _: () = assert!(CORE_HZ <= ENCODER_DIVIDER * MAX_CLOCK_HZ, "the encoder's clock is too fast");
const _: () =
    assert!(CORE_HZ >= ENCODER_DIVIDER * 2_500_000, "a frame would take a tenth of the period");

/// Core cycles per converter cycle.
const CORE_CYCLES_PER_CONVERTER_CYCLE: u32 = 4;
/// Window in which a slow conversion may start.
///
/// In converter cycles, currents and bus take 12.5 + 12.5 and 24.5 + 12.5 from the top on, a slow
/// conversion 247.5 + 12.5. The margin of 1 us covers the time between the check and the start.
pub const QUIET: QuietWindow = match QuietWindow::for_period(
    CORE_HZ / LOOP_HZ,
    62 * CORE_CYCLES_PER_CONVERTER_CYCLE,
    260 * CORE_CYCLES_PER_CONVERTER_CYCLE,
    CORE_HZ / 1_000_000,
) {
    Some(window) => window,
    None => panic!("the period leaves no time for a slow conversion"),
};
/// Clock of the pressure sensor; its maximum is 400 kHz.
pub const PRESSURE_CLOCK: Hertz = Hertz(400_000);
/// Watchdog timeout, us. Erasing a page of flash takes 25 ms at most.
pub const WATCHDOG_US: u32 = 50_000;
