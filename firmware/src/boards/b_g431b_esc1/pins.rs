//! The wiring of the B-G431B-ESC1 (UM2516 and its schematic) and the parts of its bridge.

#[macro_use]
#[path = "../stm32g4/wiring.rs"]
pub mod wiring;

use super::clocks::Crystal;
use embassy_stm32::pac;
use embassy_stm32::rcc::PllPreDiv;

use wiring::{Connection, identity, is_pin, pin_of};

/// Crystal.
pub const CRYSTAL: Crystal = Crystal { hz: 8_000_000, divider: PllPreDiv::DIV2 };
/// Counter of an ABZ encoder.
pub const COUNTER: pac::timer::TimGp16 = pac::TIM4;
/// Port of the three lines of an encoder, and the first of their pins.
pub const LINES: (pac::gpio::Gpio, usize) = pin_of(OPTIONAL, "lines.a");

/// Shunt of a phase, ohm.
pub const SHUNT_OHM: f32 = 0.003;
/// Resistors from the input of an amplifier to its shunt, to ground and to 3.3 V, kohm. They shift the shunt's voltage.
pub const SHIFT_KOHM: [f32; 3] = [1.5, 2.2, 22.0];
/// Gain of the internal amplifiers from their inputs.
pub const AMPLIFIER_GAIN: f32 = 16.0;
/// Divider of the bus voltage, kohm: above and below its tap.
pub const BUS_DIVIDER: [f32; 2] = [169.0, 18.0];
/// Dead time of a half bridge, in timer counts (500 ns). At most 127.
pub const DEAD_TIME: u8 = 85;
/// Highest phase current at which the comparators open the bridge, A: the rating of the board.
pub const BREAK_CEILING_A: f32 = 40.0;
/// The board's resistor of 120 ohm terminates the bus.
pub const TERMINATES_BUS: bool = false;

/// Identity of the wiring: the table as text, and the parts of the bridge.
pub const WIRING: u32 = identity(
    TABLE,
    &[
        SHUNT_OHM,
        SHIFT_KOHM[0],
        SHIFT_KOHM[1],
        SHIFT_KOHM[2],
        AMPLIFIER_GAIN,
        BUS_DIVIDER[0],
        BUS_DIVIDER[1],
        DEAD_TIME as f32,
        BREAK_CEILING_A,
    ],
);

/// Inputs of the comparators (RM0440, table 194).
const _: () = assert!(
    is_pin(TABLE, "currents.shunt_a", "PA1")
        && is_pin(TABLE, "currents.shunt_b", "PA7")
        && is_pin(TABLE, "overcurrent.shunt_c", "PB0"),
    "the shunts must be at the inputs of COMP1, COMP2 and COMP4"
);

wiring! {
required {
    /// Three half bridges. Their drivers (L6387) have neither an enable nor a fault output.
    bridge: Bridge {
        timer  = TIM1, "makes the PWM";
        a_high = PA8 [6],  "phase a, high side: TIM1_CH1";
        a_low  = PC13 [4], "phase a, low side: TIM1_CH1N";
        b_high = PA9 [6],  "phase b, high side: TIM1_CH2";
        b_low  = PA12 [6], "phase b, low side: TIM1_CH2N";
        c_high = PA10 [6], "phase c, high side: TIM1_CH3";
        c_low  = PB15 [4], "phase c, low side: TIM1_CH3N";
    }
    /// Inputs sampled synchronously with the PWM: two shunts, bus and temperature.
    currents: Currents {
        adc_a       = ADC1, "converts phase a and the temperature";
        adc_b       = ADC2, "converts phase b and the bus at the same moments";
        shunt_a     = PA1,  "shunt of phase a: OPAMP1_VINP0, COMP1_INP";
        return_a    = PA3,  "return of that shunt: OPAMP1_VINM0";
        phase_a     = PA2,  "amplified: OPAMP1_VOUT, ADC1_IN3";
        shunt_b     = PA7,  "shunt of phase b: OPAMP2_VINP0, COMP2_INP";
        return_b    = PA5,  "return of that shunt: OPAMP2_VINM0";
        phase_b     = PA6,  "amplified: OPAMP2_VOUT, ADC2_IN3";
        temperature = PB14, "thermistor at the bridge, 10 k to 3.3 V with 4.7 k to ground: ADC1_IN5";
        bus         = PA0,  "divided bus voltage: ADC2_IN1";
    }
    /// The third shunt, which only a comparator uses.
    overcurrent: Overcurrent {
        shunt_c = PB0, "shunt of phase c: COMP4_INP";
    }
    /// The CAN transceiver.
    can: Can {
        controller = FDCAN1, "classic frames";
        receive    = PA11,   "FDCAN1_RX";
        transmit   = PB9,    "FDCAN1_TX";
    }
    /// Outputs to the transceiver.
    transceiver: Transceiver {
        shutdown    = PC11, "high shuts it down";
        termination = PC14, "high connects 120 ohm";
    }
    /// Peripherals without pins.
    inside: Inside {
        watchdog = IWDG,  "resets a firmware that hangs";
        flash    = FLASH, "holds the parameters, in its last pages";
    }
}
optional {
    /// The lines of the motor's encoder, with pull-ups on the board: ABZ, or three Hall sensors.
    lines: Lines {
        a     = PB6, "line A: TIM4_CH1; or the first Hall sensor";
        b     = PB7, "line B: TIM4_CH2; or the second";
        index = PB8, "index, captures the count: TIM4_CH3; or the third";
    }
}
}
