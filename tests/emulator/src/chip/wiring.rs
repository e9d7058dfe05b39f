//! How a board connects the chip: its pins, the channels of its converters, and the parts at its shunts.
//!
//! The values are those of the board's schematic, not of its pins.rs: an image for another wiring must not work here.

use super::comparators::{self, Comparator};
use joint_rig::CurrentChain;

/// A pin: its port, from 0 for A, and its number.
pub type Pin = (usize, u32);

/// Signals of a peripheral, each with its pin and the alternate function that connects it (data sheet DS12288, table 13).
pub type Connections = &'static [(Pin, u32)];

/// What a channel of a converter shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Amplified shunt of phase a (0) or b (1).
    Phase(usize),
    /// Divided bus voltage.
    Bus,
    /// Leak probe.
    Leak,
    /// Thermistor at the bridge (0) or in the motor (1).
    Thermistor(usize),
    /// Strain gauge.
    Force,
}

/// What differs between the chips of the family.
#[derive(Debug)]
pub struct ChipTraits {
    /// Length of the flash, of the RAM, and of CCM behind it on the instruction bus, bytes.
    pub flash_bytes: u32,
    /// See `flash_bytes`.
    pub ram_bytes: u32,
    /// See `flash_bytes`.
    pub ccm_bytes: u32,
    /// Length of the parameter store at the end of the flash, bytes.
    pub store_bytes: u32,
    /// Base address and interrupt of the timer that is the software's clock.
    pub clock: (u32, usize),
    /// Base address of the counter of a quadrature encoder.
    pub counter: u32,
}

/// STM32G474RE: two banks of flash; TIM5 is the clock, and TIM20 counts.
pub const STM32G474: ChipTraits = ChipTraits {
    flash_bytes: 512 << 10,
    ram_bytes: 96 << 10,
    ccm_bytes: 32 << 10,
    store_bytes: 8 << 10,
    clock: (0x4000_0C00, 50),
    counter: 0x4001_5000,
};

/// STM32G431CB: one bank of flash; TIM2 is the clock, and TIM4 counts. CCM is used as RAM.
pub const STM32G431: ChipTraits = ChipTraits {
    flash_bytes: 128 << 10,
    ram_bytes: 32 << 10,
    ccm_bytes: 0,
    store_bytes: 4 << 10,
    clock: (0x4000_0000, 28),
    counter: 0x4000_0800,
};

/// What the overcurrent comparators compare.
#[derive(Debug)]
pub struct ComparatorInputs {
    /// The comparators.
    pub comparators: &'static [Comparator],
    /// Phases whose shunts are at the first and the second signal, 0 for a.
    pub phases: [usize; 2],
    /// The third signal is the mean of the others, which shows half of their sum; otherwise it is the third phase.
    pub has_mean: bool,
    /// From a current to the signal, in counts of 12 bits; `None` if it is the signal of the converters.
    pub chain: Option<CurrentChain>,
}

/// The connections of a board.
#[derive(Debug)]
pub struct Wiring {
    /// Its chip.
    pub chip: &'static ChipTraits,
    /// Gate driver's enable, and its fault (low when there is one); `None` if it has neither.
    pub enable: Option<Pin>,
    /// See `enable`.
    pub fault: Option<Pin>,
    /// The encoder's chip select (low).
    pub select: Option<Pin>,
    /// Output of the holding brake.
    pub brake: Option<Pin>,
    /// Channels of safe torque off, high while they allow torque.
    pub torque_allowed: Option<[Pin; 2]>,
    /// Input of the touch probe.
    pub touch: Option<Pin>,
    /// FDCAN1_RX and TX.
    pub can: Connections,
    /// Lines and index of a quadrature encoder at its counter.
    pub quadrature: Connections,
    /// Hall sensors of the motor, all at one port.
    pub hall: Option<[Pin; 3]>,
    /// TIM1_CH1 to 3 and TIM1_CH1N to 3N.
    pub bridge: Connections,
    /// TIM1_BKIN.
    pub break_input: Connections,
    /// TIM3_CH2.
    pub encoder_select: Connections,
    /// SPI1_SCK, MISO and MOSI.
    pub encoder_bus: Connections,
    /// SPI3_SCK and MISO.
    pub joint_encoder: Connections,
    /// I2C1_SCL and SDA.
    pub sensor_bus: Connections,
    /// Channels of the converters: number, channel, and what they show.
    pub channels: &'static [((usize, u32), Quantity)],
    /// Inputs of the comparators.
    pub overcurrent: ComparatorInputs,
    /// Shunts and amplifiers.
    pub currents: CurrentChain,
    /// Scale of the bus voltage.
    pub volts_per_count: f64,
    /// Resistance of the bridge's thermistor at 25 deg C per resistance of its divider, and whether it is above it.
    pub thermistor: (f32, bool),
}

impl Wiring {
    /// Returns what a channel shows; `None` if it is not connected.
    pub fn quantity(&self, converter: usize, channel: u32) -> Option<Quantity> {
        let found = self.channels.iter().find(|(at, _)| *at == (converter, channel));
        found.map(|(_, quantity)| *quantity)
    }
}

/// The joint driver's board: 1 mohm, amplified by 20; 68 k over 3.3 k.
pub const STANDARD: Wiring = Wiring {
    chip: &STM32G474,
    enable: Some((2, 6)),
    fault: Some((1, 10)),
    select: Some((0, 4)),
    brake: Some((2, 7)),
    torque_allowed: Some([(2, 10), (2, 11)]),
    touch: Some((2, 12)),
    can: &[((0, 11), 9), ((1, 9), 9)],
    quadrature: &[((1, 2), 3), ((2, 2), 6), ((2, 8), 6)],
    hall: Some([(2, 3), (2, 4), (2, 5)]),
    bridge: &[((0, 8), 6), ((0, 9), 6), ((0, 10), 6), ((0, 7), 6), ((0, 12), 6), ((1, 15), 4)],
    break_input: &[((1, 10), 12)],
    encoder_select: &[((0, 4), 2)],
    encoder_bus: &[((0, 5), 5), ((0, 6), 5), ((1, 5), 5)],
    joint_encoder: &[((1, 3), 6), ((1, 4), 6)],
    sensor_bus: &[((0, 15), 4), ((1, 7), 4)],
    channels: &[
        ((1, 1), Quantity::Phase(0)),
        ((2, 2), Quantity::Phase(1)),
        ((1, 6), Quantity::Bus),
        ((2, 7), Quantity::Leak),
        ((3, 12), Quantity::Thermistor(0)),
        ((3, 1), Quantity::Thermistor(1)),
        ((4, 3), Quantity::Force),
    ],
    overcurrent: ComparatorInputs {
        comparators: &comparators::G474,
        phases: [0, 1],
        has_mean: true,
        chain: None,
    },
    currents: CurrentChain {
        amperes_per_count: 3.3 / (4096.0 * 0.001 * 20.0),
        zero_counts: 2048.0,
    },
    volts_per_count: 3.3 / 4096.0 * (68.0 + 3.3) / 3.3,
    thermistor: (1.0, false),
};

/// A second board: 0.5 mohm at the other inputs; 100 k over 4.7 k.
pub const SECOND: Wiring = Wiring {
    chip: &STM32G474,
    enable: Some((2, 9)),
    fault: Some((0, 6)),
    select: Some((2, 7)),
    brake: Some((0, 7)),
    torque_allowed: Some([(2, 6), (3, 2)]),
    touch: None,
    can: &[((0, 11), 9), ((1, 9), 9)],
    quadrature: &[],
    hall: None,
    bridge: &[((0, 8), 6), ((0, 9), 6), ((0, 10), 6), ((2, 13), 4), ((0, 12), 6), ((1, 15), 4)],
    break_input: &[((0, 6), 6)],
    encoder_select: &[((2, 7), 2)],
    encoder_bus: &[((1, 3), 5), ((1, 4), 5), ((1, 5), 5)],
    joint_encoder: &[((2, 10), 6), ((2, 11), 6)],
    sensor_bus: &[((0, 15), 4), ((1, 7), 4)],
    channels: &[
        ((1, 2), Quantity::Phase(0)),
        ((2, 1), Quantity::Phase(1)),
        ((1, 7), Quantity::Bus),
        ((2, 6), Quantity::Leak),
        ((3, 1), Quantity::Thermistor(0)),
        ((3, 12), Quantity::Thermistor(1)),
        ((4, 3), Quantity::Force),
    ],
    overcurrent: ComparatorInputs {
        comparators: &comparators::G474,
        phases: [1, 0],
        has_mean: true,
        chain: None,
    },
    currents: CurrentChain {
        amperes_per_count: 3.3 / (4096.0 * 0.0005 * 20.0),
        zero_counts: 2048.0,
    },
    volts_per_count: 3.3 / 4096.0 * (100.0 + 4.7) / 4.7,
    thermistor: (1.0, false),
};

/// Shunts of the B-G431B-ESC1: 3 mohm behind 1.5 k, with 2.2 k to ground and 22 k to 3.3 V, which the comparators see.
const ESC1_SHUNTS: CurrentChain = CurrentChain {
    amperes_per_count: 3.3 / 4096.0 * (1.0 + 1.5 / 2.2 + 1.5 / 22.0) / 0.003,
    zero_counts: 4096.0 / (1.0 + 22.0 / 2.2 + 22.0 / 1.5),
};

/// The B-G431B-ESC1 (UM2516 and its schematic): amplifiers of 16; 169 k over 18 k; a thermistor of 10 k above 4.7 k.
pub const ESC1: Wiring = Wiring {
    chip: &STM32G431,
    enable: None,
    fault: None,
    select: None,
    brake: None,
    torque_allowed: None,
    touch: None,
    can: &[((0, 11), 9), ((1, 9), 9)],
    quadrature: &[((1, 6), 2), ((1, 7), 2), ((1, 8), 2)],
    hall: Some([(1, 6), (1, 7), (1, 8)]),
    bridge: &[((0, 8), 6), ((0, 9), 6), ((0, 10), 6), ((2, 13), 4), ((0, 12), 6), ((1, 15), 4)],
    break_input: &[],
    encoder_select: &[],
    encoder_bus: &[],
    joint_encoder: STANDARD.joint_encoder,
    sensor_bus: &[],
    channels: &[
        ((1, 3), Quantity::Phase(0)),
        ((2, 3), Quantity::Phase(1)),
        ((2, 1), Quantity::Bus),
        ((1, 5), Quantity::Thermistor(0)),
    ],
    overcurrent: ComparatorInputs {
        comparators: &comparators::ESC1,
        phases: [0, 1],
        has_mean: false,
        // A current into the motor lowers the voltage, as behind the amplifiers.
        chain: Some(ESC1_SHUNTS),
    },
    currents: CurrentChain {
        amperes_per_count: ESC1_SHUNTS.amperes_per_count / 16.0,
        zero_counts: ESC1_SHUNTS.zero_counts * 16.0,
    },
    volts_per_count: 3.3 / 4096.0 * (169.0 + 18.0) / 18.0,
    thermistor: (10.0 / 4.7, true),
};
