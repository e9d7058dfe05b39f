//! What a count, a volt and a tick mean on this board: the numbers to change with its parts.

use embassy_stm32::time::Hertz;
use firmware::control::PERIOD_S;
use firmware::deadline::Limits;
use firmware::loop_parts::StageTraits;
use firmware::node::bit_timing::{BitTiming, RATES_KBIT};
use firmware::sensors::as504x::{CLOCK_MAX_HZ, clock_divider};
use firmware::sensors::quiet::QuietWindow;
use firmware::sensors::shunt::RANGE;
use firmware::sensors::strain_gauge::StrainGauge;
use firmware::sensors::thermistor::Thermistor;

/// Crystal, Hz. CAN at 1 Mbit/s needs one: the chip's own oscillator is not steady enough.
pub const CRYSTAL_HZ: u32 = 24_000_000;
/// Processor, timers and converters' source: 24 MHz / 6 x 85 / 2.
pub const CORE_HZ: u32 = 170_000_000;
/// Loop rate, Hz.
pub const LOOP_HZ: u32 = 20_000;
const _: () = assert!((LOOP_HZ as f32 * PERIOD_S - 1.0).abs() < 1e-6, "one period everywhere");
/// Counts of the PWM timer from the bottom to the top; it counts up and down in a period.
pub const PWM_TOP: u16 = (CORE_HZ / LOOP_HZ / 2) as u16;
/// Time both switches of a half bridge are open when they change, in timer counts (500 ns). At most 127.
pub const DEAD_TIME: u8 = 85;

/// Periods the compensation stays dropped after a late one: 0.1 s.
const HOLD: u32 = LOOP_HZ / 10;
/// What a period may take.
pub const LIMITS: Limits = Limits::of_period(CORE_HZ / LOOP_HZ, HOLD);

/// The converters' reference, V.
const REFERENCE_V: f32 = 3.3;
/// Shunts of 1 mohm, amplified by 20; a current into the motor pulls the low side's shunt down.
pub const AMPERES_PER_COUNT: f32 = -REFERENCE_V / (RANGE as f32 * 0.001 * 20.0);
/// Phase current at which comparators open the bridge, A: 10 % above `overcurrent_a`, so that a processor that lives
/// trips first and says by how much. Levels, amplifiers and comparators are off by 2 A at most (9 mV, 10 counts, 0.3 A, 1 %).
/// Half of it lies below the current limit, twice of it above what an amplifier can show (82 A).
const BREAK_A: f32 = 44.0;
const MIDDLE: u16 = RANGE / 2;
const BREAK_COUNTS: u16 = (-BREAK_A / AMPERES_PER_COUNT) as u16;
const _: () = assert!(BREAK_COUNTS < MIDDLE - RANGE / 20, "the level is at the amplifier's rail");
/// Levels of a phase's amplifier, counts.
pub const BREAK_ABOVE: u16 = MIDDLE + BREAK_COUNTS;
/// See [`BREAK_ABOVE`].
pub const BREAK_BELOW: u16 = MIDDLE - BREAK_COUNTS;
/// Levels of the mean of two amplifiers, which shows half of the third phase's current, counts.
pub const BREAK_MEAN_ABOVE: u16 = MIDDLE + BREAK_COUNTS / 2;
/// See [`BREAK_MEAN_ABOVE`].
pub const BREAK_MEAN_BELOW: u16 = MIDDLE - BREAK_COUNTS / 2;

/// Divider of the bus, 68 k over 3.3 k.
pub const VOLTS_PER_COUNT: f32 = REFERENCE_V / RANGE as f32 * (68.0 + 3.3) / 3.3;

/// 10 k thermistors (B 3435) under 10 k.
pub const BRIDGE_THERMISTOR: Thermistor = Thermistor { ratio_at_25: 1.0, beta_k: 3435.0 };
/// See [`BRIDGE_THERMISTOR`].
pub const MOTOR_THERMISTOR: Thermistor = BRIDGE_THERMISTOR;
/// Side load, to be set from two weights; see docs/porting.md.
pub const STRAIN_GAUGE: StrainGauge = StrainGauge { zero: 0.5, range_n: 2000.0 };
/// A board without strain gauges leaves the input open, and takes the side load from the bus.
pub const HAS_STRAIN_GAUGE: bool = true;
/// Pressure inside the housing, Pa: closed at the surface.
pub const INSIDE_PA: f32 = 101_325.0;

/// Clock of the CAN controller: the core's. Every bit rate a driver can be set to divides it.
pub const CAN_HZ: u32 = CORE_HZ;
const _: () = {
    let mut place = 0;
    while place < RATES_KBIT.len() {
        assert!(
            BitTiming::of(CAN_HZ, RATES_KBIT[place] as u32 * 1000).is_some(),
            "a rate without a timing"
        );
        place += 1;
    }
};

/// Time a shunt's amplifier has to settle once its low side conducts, s: 1.5 us for 0.5 % at a gain of 20.
const SETTLE_S: f32 = 1.5e-6;
/// What the loop has to know of the stage.
pub const STAGE: StageTraits = StageTraits {
    // The angle read is that of the frame before, which began 2 us after the top before.
    encoder_age_s: PERIOD_S - 2e-6,
    modulation_max: StageTraits::modulation_for(
        PERIOD_S,
        DEAD_TIME as f32 / CORE_HZ as f32,
        SETTLE_S,
    ),
};
/// Divider of the encoder's clock: 5.3 MHz of the core's 170 MHz. The next less would be 10.6 MHz, and it stands 10.
pub const ENCODER_DIVIDER: u32 = clock_divider(CORE_HZ);
/// The encoder's clock, to be asked for exactly: embassy rounds to the nearest divider, up as well as down.
pub const ENCODER_CLOCK: Hertz = Hertz(CORE_HZ / ENCODER_DIVIDER);
const _: () = assert!(CORE_HZ <= ENCODER_DIVIDER * CLOCK_MAX_HZ, "the encoder's clock is too fast");
const _: () =
    assert!(CORE_HZ >= ENCODER_DIVIDER * 2_500_000, "a frame would take a tenth of the period");

/// Cycles of the core in one of the converters'.
const CONVERTER: u32 = 4;
/// When a slow conversion may begin. The currents and the bus take 12.5 + 12.5 and 24.5 + 12.5 of the converters'
/// cycles from the top on, a slow one 247.5 + 12.5; the margin, 1 us, is for what is between asking and beginning.
pub const QUIET: QuietWindow = match QuietWindow::of(
    CORE_HZ / LOOP_HZ,
    62 * CONVERTER,
    260 * CONVERTER,
    CORE_HZ / 1_000_000,
) {
    Some(window) => window,
    None => panic!("the period leaves no time for a slow conversion"),
};
/// The pressure sensor's clock; it stands 400 kHz.
pub const PRESSURE_CLOCK: Hertz = Hertz(400_000);
/// How long the firmware may be silent before it is reset, us. A page of flash is erased in 25 ms at most.
pub const WATCHDOG_US: u32 = 50_000;
