//! A second wiring, which shows what another board has to change: shunts of 0.5 mohm at the other inputs, 100 V switches,
//! the encoder beside the debug port, and other pins for break, enable, brake and sensors. It has no inputs of an ABZ encoder,
//! of Hall sensors or of a touch probe, which its feature in Cargo.toml says as well.

use super::Connection;

/// Shunt of a phase, ohm.
pub const SHUNT_OHM: f32 = 0.0005;
/// Gain of its amplifier.
pub const AMPLIFIER_GAIN: f32 = 20.0;
/// Divider of the bus voltage, kohm: above and below its tap.
pub const BUS_DIVIDER: [f32; 2] = [100.0, 4.7];
/// Dead time of a half bridge, in timer counts (400 ns). At most 127.
pub const DEAD_TIME: u8 = 68;
/// Highest phase current at which the comparators open the bridge, A: the rating of its switches.
///
/// The levels of a joint follow its parameter `overcurrent_a`. Levels, amplifiers and comparators are off by
/// 4 A at most.
pub const BREAK_CEILING_A: f32 = 88.0;
/// Settling time of a shunt's amplifier once its low side conducts, s: 1.5 us to 0.5 % at a gain of 20.
pub const AMPLIFIER_SETTLING_S: f32 = 1.5e-6;

wiring! {
required {
    /// Three half bridges and their driver.
    bridge: Bridge {
        timer  = TIM1, "makes the PWM";
        a_high = PA8 [6],  "phase a, high side: TIM1_CH1";
        a_low  = PC13 [4], "phase a, low side: TIM1_CH1N";
        b_high = PA9 [6],  "phase b, high side: TIM1_CH2";
        b_low  = PA12 [6], "phase b, low side: TIM1_CH2N";
        c_high = PA10 [6], "phase c, high side: TIM1_CH3";
        c_low  = PB15 [4], "phase c, low side: TIM1_CH3N";
        fault  = PA6 [6], "fault of the gate driver, low when there is one: TIM1_BKIN";
        enable = PC9,  "wakes the gate driver";
    }
    /// Inputs sampled synchronously with the PWM.
    currents: Currents {
        adc_a   = ADC1, "converts phase a and the bus";
        adc_b   = ADC2, "converts phase b at the same moment";
        phase_a = PA1,  "amplified shunt, phase a: ADC1_IN2, COMP1_INP";
        phase_b = PA0,  "amplified shunt, phase b: ADC2_IN1, COMP3_INP";
        bus     = PC1,  "divided bus voltage: ADC1_IN7";
        leak    = PC0,  "leak probe, 1 M to the reference, 100 nF at the pin: ADC2_IN6";
    }
    /// The shunt signals at the inputs of further comparators.
    overcurrent: Overcurrent {
        phase_a   = PA3,  "tied to PA1: COMP2_INP";
        phase_b   = PB11, "tied to PA0: COMP6_INP";
        mean_high = PB13, "10 k each from PA0 and PA1, their mean: COMP5_INP";
        mean_low  = PB14, "tied to PB13: COMP7_INP";
    }
    /// The holding brake.
    brake: Brake {
        output = PA7, "switches the coil; a resistor keeps the brake closed while the pin is not driven";
    }
    /// Inputs sampled slowly.
    slow: Slow {
        adc                = ADC3, "converts temperatures";
        bridge_temperature = PB1,  "thermistor at the bridge: ADC3_IN1";
        motor_temperature  = PB0,  "thermistor in the motor: ADC3_IN12";
        force_adc          = ADC4, "converts the side load";
        force              = PB12, "amplified strain gauge bridge: ADC4_IN3";
    }
    /// The motor's encoder.
    encoder: Encoder {
        spi     = SPI1,     "exchanges its frames";
        timer   = TIM3,     "selects it and requests its frames; starts the slow conversions";
        command = DMA1_CH1, "writes a command when the timer requests it";
        answer  = DMA1_CH2, "stores an answer";
        clock   = PB3 [5],      "SPI1_SCK";
        out     = PB5 [5],      "SPI1_MOSI";
        back    = PB4 [5],      "SPI1_MISO, pulled up: a broken wire reads as an error";
        select  = PC7 [2],      "chip select, low when selected: TIM3_CH2";
    }
    /// The pressure sensor's bus.
    pressure: Pressure {
        i2c   = I2C1, "reads it";
        clock = PA15 [4], "I2C1_SCL";
        data  = PB7 [4],  "I2C1_SDA";
    }
    /// The two channels of safe torque off, high while they allow torque. A broken wire reads as low.
    torque_off: TorqueOff {
        first  = PC6,  "first channel";
        second = PD2,  "second channel";
    }
    /// The CAN transceiver.
    can: Can {
        controller = FDCAN1, "classic frames";
        receive    = PA11,   "FDCAN1_RX";
        transmit   = PB9,    "FDCAN1_TX";
    }
    /// Peripherals without pins.
    inside: Inside {
        watchdog = IWDG,  "resets a firmware that hangs";
        flash    = FLASH, "holds the parameters, in its second bank";
    }
}
optional {}
}
