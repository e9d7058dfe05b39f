//! How a board connects the chip: its pins, the channels of its converters, and the parts at its shunts.
//!
//! The values are those of the board's schematic, not of its pins.rs: an image for another wiring must not work here.

use super::comparators::{self, Comparator};
use joint_rig::CurrentChain;

/// A pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pin {
    /// Its port, from 0 for A.
    pub port: usize,
    /// Its number, from 0 to 15.
    pub number: u32,
}

impl Pin {
    /// Returns the connection of this pin by an alternate function.
    const fn af(self, function: u32) -> Connection {
        Connection { pin: self, function }
    }
}

const fn pa(number: u32) -> Pin {
    Pin { port: 0, number }
}

const fn pb(number: u32) -> Pin {
    Pin { port: 1, number }
}

const fn pc(number: u32) -> Pin {
    Pin { port: 2, number }
}

const fn pd(number: u32) -> Pin {
    Pin { port: 3, number }
}

/// A signal of a peripheral: its pin, and the alternate function that connects it (data sheet DS12288, table 13).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Connection {
    /// The pin.
    pub pin: Pin,
    /// Number of the function, from 0 to 15.
    pub function: u32,
}

/// Signals of a peripheral.
pub type Connections = &'static [Connection];

/// A channel of a converter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channel {
    /// Number of the converter, from 1 to 5.
    pub converter: usize,
    /// Number of its channel.
    pub number: u32,
    /// What it shows.
    pub quantity: Quantity,
}

const fn channel(converter: usize, number: u32, quantity: Quantity) -> Channel {
    Channel { converter, number, quantity }
}

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
    /// Base address of the timer that is the software's clock.
    pub clock: u32,
    /// Interrupt of this timer.
    pub clock_interrupt: usize,
    /// Base address of the counter of a quadrature encoder.
    pub counter: u32,
}

/// STM32G474RE: two banks of flash; TIM5 is the clock, and TIM20 counts.
pub const STM32G474: ChipTraits = ChipTraits {
    flash_bytes: 512 << 10,
    ram_bytes: 96 << 10,
    ccm_bytes: 32 << 10,
    store_bytes: 8 << 10,
    clock: 0x4000_0C00,
    clock_interrupt: 50,
    counter: 0x4001_5000,
};

/// STM32G431CB: one bank of flash; TIM2 is the clock, and TIM4 counts. CCM is used as RAM.
pub const STM32G431: ChipTraits = ChipTraits {
    flash_bytes: 128 << 10,
    ram_bytes: 32 << 10,
    ccm_bytes: 0,
    store_bytes: 4 << 10,
    clock: 0x4000_0000,
    clock_interrupt: 28,
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
    /// Channels of the converters.
    pub channels: &'static [Channel],
    /// Inputs of the comparators.
    pub overcurrent: ComparatorInputs,
    /// Shunts and amplifiers.
    pub currents: CurrentChain,
    /// Scale of the bus voltage.
    pub volts_per_count: f64,
    /// Resistance of the bridge's thermistor at 25 deg C per resistance of its divider.
    pub thermistor_ratio_at_25: f32,
    /// The thermistor is above the resistor of its divider.
    pub is_thermistor_above: bool,
}

impl Wiring {
    /// Returns what a channel shows; `None` if it is not connected.
    pub fn quantity(&self, converter: usize, channel: u32) -> Option<Quantity> {
        let mut channels = self.channels.iter();
        let found = channels.find(|at| (at.converter, at.number) == (converter, channel));
        found.map(|at| at.quantity)
    }
}

/// The joint driver's board: 1 mohm, amplified by 20; 68 k over 3.3 k.
pub const STANDARD: Wiring = Wiring {
    chip: &STM32G474,
    enable: Some(pc(6)),
    fault: Some(pb(10)),
    select: Some(pa(4)),
    brake: Some(pc(7)),
    torque_allowed: Some([pc(10), pc(11)]),
    touch: Some(pc(12)),
    can: &[pa(11).af(9), pb(9).af(9)],
    quadrature: &[pb(2).af(3), pc(2).af(6), pc(8).af(6)],
    hall: Some([pc(3), pc(4), pc(5)]),
    bridge: &[pa(8).af(6), pa(9).af(6), pa(10).af(6), pa(7).af(6), pa(12).af(6), pb(15).af(4)],
    break_input: &[pb(10).af(12)],
    encoder_select: &[pa(4).af(2)],
    encoder_bus: &[pa(5).af(5), pa(6).af(5), pb(5).af(5)],
    joint_encoder: &[pb(3).af(6), pb(4).af(6)],
    sensor_bus: &[pa(15).af(4), pb(7).af(4)],
    channels: &[
        channel(1, 1, Quantity::Phase(0)),
        channel(2, 2, Quantity::Phase(1)),
        channel(1, 6, Quantity::Bus),
        channel(2, 7, Quantity::Leak),
        channel(3, 12, Quantity::Thermistor(0)),
        channel(3, 1, Quantity::Thermistor(1)),
        channel(4, 3, Quantity::Force),
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
    thermistor_ratio_at_25: 1.0,
    is_thermistor_above: false,
};

/// A second board: 0.5 mohm at the other inputs; 100 k over 4.7 k.
pub const SECOND: Wiring = Wiring {
    chip: &STM32G474,
    enable: Some(pc(9)),
    fault: Some(pa(6)),
    select: Some(pc(7)),
    brake: Some(pa(7)),
    torque_allowed: Some([pc(6), pd(2)]),
    touch: None,
    can: &[pa(11).af(9), pb(9).af(9)],
    quadrature: &[],
    hall: None,
    bridge: &[pa(8).af(6), pa(9).af(6), pa(10).af(6), pc(13).af(4), pa(12).af(6), pb(15).af(4)],
    break_input: &[pa(6).af(6)],
    encoder_select: &[pc(7).af(2)],
    encoder_bus: &[pb(3).af(5), pb(4).af(5), pb(5).af(5)],
    joint_encoder: &[pc(10).af(6), pc(11).af(6)],
    sensor_bus: &[pa(15).af(4), pb(7).af(4)],
    channels: &[
        channel(1, 2, Quantity::Phase(0)),
        channel(2, 1, Quantity::Phase(1)),
        channel(1, 7, Quantity::Bus),
        channel(2, 6, Quantity::Leak),
        channel(3, 1, Quantity::Thermistor(0)),
        channel(3, 12, Quantity::Thermistor(1)),
        channel(4, 3, Quantity::Force),
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
    thermistor_ratio_at_25: 1.0,
    is_thermistor_above: false,
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
    can: &[pa(11).af(9), pb(9).af(9)],
    quadrature: &[pb(6).af(2), pb(7).af(2), pb(8).af(2)],
    hall: Some([pb(6), pb(7), pb(8)]),
    bridge: &[pa(8).af(6), pa(9).af(6), pa(10).af(6), pc(13).af(4), pa(12).af(6), pb(15).af(4)],
    break_input: &[],
    encoder_select: &[],
    encoder_bus: &[],
    joint_encoder: STANDARD.joint_encoder,
    sensor_bus: &[],
    channels: &[
        channel(1, 3, Quantity::Phase(0)),
        channel(2, 3, Quantity::Phase(1)),
        channel(2, 1, Quantity::Bus),
        channel(1, 5, Quantity::Thermistor(0)),
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
    thermistor_ratio_at_25: 10.0 / 4.7,
    is_thermistor_above: true,
};
