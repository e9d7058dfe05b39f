//! Command-line arguments of the commands that use a CAN bus.

use super::error::{Result, in_file, unfit};
use super::values::{Expected, expected};
use clap::Args;
use compensator_core::can::NodeId;
use compensator_core::can::slcan::BitRate;
use joint_bus::bus::slcan::Options;
use joint_bus::bus::{Bus, BusError, BusName, Hub, Recorder};
use joint_bus::canopen::{Client, key_of};
use joint_bus::joint::JointNode;
use joint_trace::Fraction;
use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;

/// The bus and the node on it.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Bus")]
pub struct BusArguments {
    /// Bus: loop (in this process), a SocketCAN interface such as vcan0 or can0, slcan:PATH or slcan:HOST:PORT
    #[arg(long, global = true, value_name = "BUS", default_value = "loop")]
    pub bus: BusName,
    /// Node number of the joint driver
    #[arg(long, global = true, value_name = "N", default_value = "1", value_parser = node)]
    pub node_id: NodeId,
    /// Bit rate of the bus, bit/s
    ///
    /// It opens an slcan adapter and is the reference of the bus load. For a SocketCAN interface, set the bit rate with
    /// `ip link`.
    #[arg(long, global = true, value_name = "BIT/S", default_value = "1000000", value_parser = bit_rate, hide_short_help = true)]
    pub bit_rate: BitRate,
    /// Write every sent and received frame to this file in the format of candump -L
    #[arg(long, global = true, value_name = "FILE", hide_short_help = true)]
    pub record: Option<PathBuf>,
    /// Key that unlocks the joint: a file with 32 hexadecimal digits
    ///
    /// By default the file that FRICTION_JOINT_KEY names, or the public default key.
    #[arg(long, global = true, value_name = "FILE")]
    pub key: Option<PathBuf>,
}

pub(super) fn node(text: &str) -> Result<NodeId, Expected> {
    text.parse().ok().and_then(NodeId::new).ok_or_else(|| expected("1 to 127"))
}

pub(super) fn bit_rate(text: &str) -> Result<BitRate, Expected> {
    let number = text.parse().ok().and_then(BitRate::from_bits_per_second);
    number.ok_or_else(|| {
        expected("10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000 or 1000000")
    })
}

impl BusArguments {
    /// Opens the bus. If `--record` is given, every frame is also written to that file.
    ///
    /// # Errors
    /// Returns one line with the cause and the remedy if the bus or the file cannot be opened.
    pub fn open(&self, hub: &Hub) -> Result<Box<dyn Bus>> {
        self.with_recorder(self.open_with(hub, false)?)
    }

    /// Opens the bus without a recorder. With `listen`, an slcan adapter is opened in listen-only mode and acknowledges no
    /// frame.
    ///
    /// # Errors
    /// Returns one line with the cause and the remedy if the bus cannot be opened.
    pub fn open_with(&self, hub: &Hub, listen: bool) -> Result<Box<dyn Bus>, BusError> {
        let options = Options { bit_rate: self.bit_rate, listen };
        self.bus.open(hub, options)
    }

    /// Returns true for the bus in this process.
    pub fn is_loop(&self) -> bool {
        self.bus == BusName::Loop
    }

    /// Returns the name of the joint in messages.
    pub fn joint_name(&self) -> String {
        format!("node {} on {}", self.node_id.number(), self.bus)
    }

    /// Returns a hub. On the bus `loop`, a driver without a motor is attached to it.
    ///
    /// # Errors
    /// Returns one line if the driver does not start.
    pub fn hub_with_driver(&self) -> Result<Hub> {
        let hub = Hub::new();
        if self.is_loop() {
            hub.attach(JointNode::start(self.node_id, None)?);
        }
        Ok(hub)
    }

    /// Checks that this option of a simulated motor fits the bus.
    ///
    /// # Errors
    /// Returns one line if the bus is another one than `loop`, or the node another one than the first.
    pub fn check_motor(&self, option: &str) -> Result {
        if !self.is_loop() {
            return Err(unfit(option, "requires --bus loop"));
        }
        self.check_first_node(option)
    }

    /// Checks that the node is the simulated joint.
    ///
    /// # Errors
    /// Returns one line if it is another one.
    pub fn check_first_node(&self, option: &str) -> Result {
        match self.node_id {
            NodeId::FIRST => Ok(()),
            _ => Err(unfit(option, "the simulated joint is node 1")),
        }
    }

    /// Returns a client of the node, which unlocks it with the key of the arguments.
    ///
    /// # Errors
    /// Returns one line if the key cannot be read.
    pub fn client<B: Bus>(&self, bus: B) -> Result<Client<B>> {
        let key = key_of(self.key.as_deref())?;
        Ok(Client::new(bus, self.node_id).with_key(key))
    }

    /// Wraps the bus in a recorder if `--record` is given.
    ///
    /// # Errors
    /// Returns one line if the record file cannot be created.
    pub fn with_recorder(&self, bus: Box<dyn Bus>) -> Result<Box<dyn Bus>> {
        let Some(path) = &self.record else { return Ok(bus) };
        let file = File::create(path).map_err(in_file(path))?;
        let out = BufWriter::new(file);
        let interface = self.bus.interface();
        Ok(Box::new(Recorder::new(bus, out, interface, Fraction::Microseconds)))
    }

    /// Returns the name of the clock that provides the bus times.
    pub fn clock(&self) -> &'static str {
        if self.is_loop() { "virtual" } else { "monotonic, kernel time stamps where available" }
    }
}
