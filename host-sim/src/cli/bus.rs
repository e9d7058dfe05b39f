//! Arguments of the commands that are on a bus.

use clap::Args;
use compensator_core::can::Node;
use compensator_core::can::slcan::BitRate;
use joint_bus::bus::slcan::{Options, Slcan};
use joint_bus::bus::{Bus, BusName, Hub, Recorder};
use joint_trace::Fraction;
use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;

/// Which bus, and which node on it.
#[derive(Args, Clone, Debug)]
pub struct BusArguments {
    /// The bus: loop (in this process), an interface as vcan0 or can0, slcan:PATH or slcan:HOST:PORT
    #[arg(long, value_name = "BUS", default_value = "loop")]
    pub bus: BusName,
    /// Number of the joint driver on the bus
    #[arg(long, value_name = "N", default_value = "1", value_parser = node)]
    pub node_id: Node,
    /// Bit rate of the bus, bit/s: what an slcan adapter is opened with, and what loads are shares of. That of a
    /// kernel's interface is set by `ip link`
    #[arg(long, value_name = "BIT/S", default_value = "1000000", value_parser = bit_rate)]
    pub bit_rate: BitRate,
    /// Write every frame, sent and received, to this file, as candump -L does
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
}

fn node(text: &str) -> Result<Node, String> {
    text.parse().ok().and_then(Node::new).ok_or_else(|| "expected 1 to 127".to_owned())
}

pub(super) fn bit_rate(text: &str) -> Result<BitRate, String> {
    let number = text.parse().ok().and_then(BitRate::from_bits_per_second);
    number.ok_or_else(|| {
        "expected 10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000 or 1000000".to_owned()
    })
}

impl BusArguments {
    /// Opens the bus, with its recorder where one was asked for.
    ///
    /// # Errors
    /// One line that says what is wrong and what to do.
    pub fn open(&self, hub: &Hub) -> Result<Box<dyn Bus>, String> {
        self.open_with(hub, false)
    }

    /// The same; an slcan adapter acknowledges nothing where it is only to listen.
    ///
    /// # Errors
    /// As [`BusArguments::open`].
    pub fn open_with(&self, hub: &Hub, listen: bool) -> Result<Box<dyn Bus>, String> {
        let opened: Result<Box<dyn Bus>, _> = match &self.bus {
            BusName::Slcan(address) => {
                let options = Options { bit_rate: self.bit_rate, listen, ..Options::default() };
                Slcan::open(address, options).map(|bus| Box::new(bus) as Box<dyn Bus>)
            }
            other => other.open(hub),
        };
        let bus = opened.map_err(|error| error.to_string())?;
        self.recorded(bus)
    }

    /// The bus, written down where that was asked for.
    ///
    /// # Errors
    /// A file that cannot be made, in one line.
    pub fn recorded(&self, bus: Box<dyn Bus>) -> Result<Box<dyn Bus>, String> {
        let Some(path) = &self.record else { return Ok(bus) };
        let file = File::create(path).map_err(|error| format!("{}: {error}", path.display()))?;
        let out = BufWriter::new(file);
        let interface = self.bus.interface();
        Ok(Box::new(Recorder::new(bus, out, interface, Fraction::Microseconds)))
    }

    /// What times on the bus are measured with.
    pub fn clock(&self) -> &'static str {
        if self.bus == BusName::Loop {
            "virtual"
        } else {
            "monotonic, kernel stamps where there are"
        }
    }
}
