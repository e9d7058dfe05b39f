//! Scales and levels of this board: the values to change with its parts.

pub use super::clocks::CORE_HZ;
use super::pins::{AMPLIFIER_GAIN, BUS_DIVIDER, SHIFT_KOHM, SHUNT_OHM};
pub use super::pins::{BREAK_CEILING_A, DEAD_TIME};
use super::rates::REFERENCE_V;
pub use super::rates::{CAN_HZ, LIMITS, PWM_TOP, WATCHDOG_US};
use embassy_stm32::pac;
pub use embassy_stm32::peripherals::TIM2 as TimePeripheral;
use firmware::control::PERIOD_S;
use firmware::loop_parts::StageTraits;
use firmware::sensors::shunt::{CONVERTER_RANGE_COUNTS, OffsetRange};

/// Timer of 32 bits that counts the time.
pub const TIME_COUNTER: pac::timer::TimGp32 = pac::TIM2;

/// Conductances of the resistors at the input of an amplifier, to the shunt and to the supply, and of all three, 1/kohm.
const TO_SHUNT: f32 = 1.0 / SHIFT_KOHM[0];
const TO_SUPPLY: f32 = 1.0 / SHIFT_KOHM[2];
const CONDUCTANCE: f32 = TO_SHUNT + 1.0 / SHIFT_KOHM[1] + TO_SUPPLY;
/// Voltage of an ampere at the input of an amplifier, V.
const INPUT_V_PER_A: f32 = SHUNT_OHM * (TO_SHUNT / CONDUCTANCE);
/// Voltage there without current, V.
const SHIFT_V: f32 = REFERENCE_V * TO_SUPPLY / CONDUCTANCE;
/// Scale of the shunts: -64/7 of their voltage. A current into the motor lowers it, unless the parameter `shunt_sign` states
/// otherwise.
pub const AMPERES_PER_COUNT: f32 =
    -REFERENCE_V / (CONVERTER_RANGE_COUNTS as f32 * INPUT_V_PER_A * AMPLIFIER_GAIN);
/// Offsets of the amplifiers that are accepted: 1.5 to 2.3 V. By the resistors, it is 2.06 V.
pub const OFFSETS: OffsetRange = OffsetRange { above: counts_of(1.5), below: counts_of(2.3) };
const _: () = {
    let counts = counts_of(SHIFT_V * AMPLIFIER_GAIN);
    assert!(OFFSETS.above < counts && counts < OFFSETS.below, "the offset would be refused");
};

/// Scale of the bus voltage.
pub const VOLTS_PER_COUNT: f32 = REFERENCE_V / CONVERTER_RANGE_COUNTS as f32
    * (BUS_DIVIDER[0] + BUS_DIVIDER[1])
    / BUS_DIVIDER[1];

const fn counts_of(volts: f32) -> u16 {
    (volts / REFERENCE_V * CONVERTER_RANGE_COUNTS as f32) as u16
}

/// Returns the level of a comparator at the input of an amplifier for a current out of the motor, A, in converter counts.
pub const fn comparator_level(current_a: f32) -> u16 {
    counts_of(SHIFT_V + INPUT_V_PER_A * current_a)
}

/// Settling time of an amplifier once its low side conducts, s: 1.3 us were measured on this board.
const AMPLIFIER_SETTLING_S: f32 = 1.5e-6;
/// Properties of the stage that the loop uses.
pub const STAGE: StageTraits = StageTraits {
    // Counter and levels are read in the interrupt.
    encoder_age_s: 0.0,
    biss_age_s: 0.0,
    current_max_a: OFFSETS.measurable_a(AMPERES_PER_COUNT),
    modulation_max: StageTraits::max_modulation(
        PERIOD_S,
        DEAD_TIME as f32 / CORE_HZ as f32,
        AMPLIFIER_SETTLING_S,
    ),
};
