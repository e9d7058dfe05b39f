//! How a board connects the chip: its pins, the channels of its converters, and the parts at its shunts.
//!
//! The values are those of the board's schematic, not of its pins.rs: an image for another wiring must not work here.

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

/// The connections of a board.
#[derive(Debug)]
pub struct Wiring {
    /// Gate driver's enable, and its fault (low when there is one).
    pub enable: Pin,
    /// See `enable`.
    pub fault: Pin,
    /// The encoder's chip select (low).
    pub select: Pin,
    /// Output of the holding brake.
    pub brake: Pin,
    /// Channels of safe torque off, high while they allow torque.
    pub torque_allowed: [Pin; 2],
    /// TIM1_CH1 to 3 and TIM1_CH1N to 3N.
    pub bridge: Connections,
    /// TIM1_BKIN.
    pub break_input: Connections,
    /// TIM3_CH2.
    pub encoder_select: Connections,
    /// SPI1_SCK, MISO and MOSI.
    pub encoder_bus: Connections,
    /// I2C1_SCL and SDA.
    pub sensor_bus: Connections,
    /// Channels of the converters: number, channel, and what they show.
    pub channels: [((usize, u32), Quantity); 7],
    /// Phases whose shunts are at the comparators of PA0 and of PA1, 0 for a.
    pub comparators: [usize; 2],
    /// Scale of the shunts.
    pub amperes_per_count: f64,
    /// Scale of the bus voltage.
    pub volts_per_count: f64,
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
    enable: (2, 6),
    fault: (1, 10),
    select: (0, 4),
    brake: (2, 7),
    torque_allowed: [(2, 10), (2, 11)],
    bridge: &[((0, 8), 6), ((0, 9), 6), ((0, 10), 6), ((0, 7), 6), ((0, 12), 6), ((1, 15), 4)],
    break_input: &[((1, 10), 12)],
    encoder_select: &[((0, 4), 2)],
    encoder_bus: &[((0, 5), 5), ((0, 6), 5), ((1, 5), 5)],
    sensor_bus: &[((0, 15), 4), ((1, 7), 4)],
    channels: [
        ((1, 1), Quantity::Phase(0)),
        ((2, 2), Quantity::Phase(1)),
        ((1, 6), Quantity::Bus),
        ((2, 7), Quantity::Leak),
        ((3, 12), Quantity::Thermistor(0)),
        ((3, 1), Quantity::Thermistor(1)),
        ((4, 3), Quantity::Force),
    ],
    comparators: [0, 1],
    amperes_per_count: 3.3 / (4096.0 * 0.001 * 20.0),
    volts_per_count: 3.3 / 4096.0 * (68.0 + 3.3) / 3.3,
};

/// A second board: 0.5 mohm at the other inputs; 100 k over 4.7 k.
pub const SECOND: Wiring = Wiring {
    enable: (2, 9),
    fault: (0, 6),
    select: (2, 7),
    brake: (0, 7),
    torque_allowed: [(2, 6), (3, 2)],
    bridge: &[((0, 8), 6), ((0, 9), 6), ((0, 10), 6), ((2, 13), 4), ((0, 12), 6), ((1, 15), 4)],
    break_input: &[((0, 6), 6)],
    encoder_select: &[((2, 7), 2)],
    encoder_bus: &[((1, 3), 5), ((1, 4), 5), ((1, 5), 5)],
    sensor_bus: &[((1, 8), 4), ((1, 7), 4)],
    channels: [
        ((1, 2), Quantity::Phase(0)),
        ((2, 1), Quantity::Phase(1)),
        ((1, 7), Quantity::Bus),
        ((2, 6), Quantity::Leak),
        ((3, 1), Quantity::Thermistor(0)),
        ((3, 12), Quantity::Thermistor(1)),
        ((4, 3), Quantity::Force),
    ],
    comparators: [1, 0],
    amperes_per_count: 3.3 / (4096.0 * 0.0005 * 20.0),
    volts_per_count: 3.3 / 4096.0 * (100.0 + 4.7) / 4.7,
};
