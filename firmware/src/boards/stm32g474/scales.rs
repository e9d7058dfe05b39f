//! Frequencies, scales and levels of this board: the values to change with its parts.

pub use super::clocks::CORE_HZ;
use super::pins::{AMPLIFIER_GAIN, AMPLIFIER_SETTLING_S, BUS_DIVIDER, SHUNT_OHM};
pub use super::pins::{BREAK_CEILING_A, DEAD_TIME};
use super::rates::REFERENCE_V;
pub use super::rates::{CAN_HZ, LIMITS, LOOP_HZ, PWM_TOP, WATCHDOG_US};
use embassy_stm32::pac;
pub use embassy_stm32::peripherals::TIM5 as TimePeripheral;
use embassy_stm32::time::Hertz;
use firmware::control::PERIOD_S;
use firmware::loop_parts::StageTraits;
use firmware::sensors::as504x::{MAX_CLOCK_HZ, clock_divider};
use firmware::sensors::comparator::ComparatorLevels;
use firmware::sensors::quiet::QuietWindow;
use firmware::sensors::shunt::{CONVERTER_RANGE_COUNTS, OffsetRange};

/// Timer of 32 bits that counts the time.
pub const TIME_COUNTER: pac::timer::TimGp32 = pac::TIM5;

/// Scale of the shunts. A current into the motor lowers the voltage of a low-side shunt, unless the
/// parameter `shunt_sign` states otherwise.
pub const AMPERES_PER_COUNT: f32 =
    -REFERENCE_V / (CONVERTER_RANGE_COUNTS as f32 * SHUNT_OHM * AMPLIFIER_GAIN);
/// Offsets of the amplifiers that are accepted.
pub const OFFSETS: OffsetRange = OffsetRange::CENTRAL;
/// Levels of the ceiling, which hold until the parameters are read.
pub const CEILING_LEVELS: ComparatorLevels =
    ComparatorLevels::for_current(BREAK_CEILING_A, AMPERES_PER_COUNT);
const _: () = assert!(
    CEILING_LEVELS.phase[1] > CONVERTER_RANGE_COUNTS / 20,
    "the level is at the amplifier's rail"
);

/// Scale of the bus voltage.
pub const VOLTS_PER_COUNT: f32 = REFERENCE_V / CONVERTER_RANGE_COUNTS as f32
    * (BUS_DIVIDER[0] + BUS_DIVIDER[1])
    / BUS_DIVIDER[1];

/// Pressure inside the housing, Pa: it is closed at the surface.
pub const INSIDE_PA: f32 = 101_325.0;

/// Cycles from the top of the encoder's timer, TIM3, to that of TIM1.
pub const LEAD_CYCLES: u32 = 1020;
/// Cycles from the release of the encoder's chip select to the top of TIM3, and from there to the next selection.
pub const HALF_GAP_CYCLES: u32 = 40;

/// Cycles from the first word of a BiSS frame to the top of the encoder's timer, and from the second: words follow each other
/// without a gap, because each is written before the one before it ends (448 cycles).
pub const BISS_OUTER_CYCLES: u32 = 665;
/// See [`BISS_OUTER_CYCLES`].
pub const BISS_INNER_CYCLES: u32 = 221;
/// Cycles from the request of the first word to the latch: DMA, start of the bus, and half a clock.
const BISS_LATCH_CYCLES: u32 = 20 + ENCODER_DIVIDER / 2;

/// Properties of the stage that the loop uses.
pub const STAGE: StageTraits = StageTraits {
    // The angle is latched when the first frame is released.
    encoder_age_s: (LEAD_CYCLES + HALF_GAP_CYCLES) as f32 / CORE_HZ as f32,
    // The position is latched at the first rising edge of the clock: half a clock after its first edge.
    biss_age_s: (LEAD_CYCLES + BISS_OUTER_CYCLES - BISS_LATCH_CYCLES) as f32 / CORE_HZ as f32,
    current_max_a: OFFSETS.measurable_a(AMPERES_PER_COUNT),
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
/// Cycles from the top of the PWM until currents and bus are converted: 12.5 + 12.5 and 24.5 + 12.5 converter
/// cycles.
pub const FAST_CONVERSION_CYCLES: u32 = 62 * CORE_CYCLES_PER_CONVERTER_CYCLE;
/// Cycles of a slow conversion: 247.5 + 12.5 converter cycles.
const SLOW_CONVERSION_CYCLES: u32 = 260 * CORE_CYCLES_PER_CONVERTER_CYCLE;
/// Window in which a slow conversion may start. Its margin of 1 us covers jitter of the trigger.
const QUIET: QuietWindow = match QuietWindow::for_period(
    CORE_HZ / LOOP_HZ,
    FAST_CONVERSION_CYCLES,
    SLOW_CONVERSION_CYCLES,
    CORE_HZ / 1_000_000,
) {
    Some(window) => window,
    None => panic!("the period leaves no time for a slow conversion"),
};
/// Cycles from the top of the PWM to the start of the two conversions of the temperatures.
pub const SLOW_START_CYCLES: u32 = QUIET.from + 10;
/// Cycles from the top of the PWM to the start of the conversion of the side load, at the other edge of the
/// same signal, which is symmetric about the top of the encoder's timer.
const FORCE_START_CYCLES: u32 = CORE_HZ / LOOP_HZ - 2 * LEAD_CYCLES - SLOW_START_CYCLES;
const _: () = {
    let second = SLOW_START_CYCLES + SLOW_CONVERSION_CYCLES;
    assert!(QUIET.contains(SLOW_START_CYCLES) && QUIET.contains(second), "temperatures");
    assert!(QUIET.contains(FORCE_START_CYCLES), "the side load disturbs the currents");
    assert!(FORCE_START_CYCLES > second + SLOW_CONVERSION_CYCLES, "the side load is disturbed");
};
/// Clock of the pressure sensor; its maximum is 400 kHz.
pub const PRESSURE_CLOCK: Hertz = Hertz(400_000);
