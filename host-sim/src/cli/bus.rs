//! Arguments of the commands that are on a bus.

use clap::Args;
use compensator_core::can::Node;
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
    /// Write every frame, sent and received, to this file, as candump -L does
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
}

fn node(text: &str) -> Result<Node, String> {
    text.parse().ok().and_then(Node::new).ok_or_else(|| "expected 1 to 127".to_owned())
}

impl BusArguments {
    /// Opens the bus, with its recorder where one was asked for.
    ///
    /// # Errors
    /// One line that says what is wrong and what to do.
    pub fn open(&self, hub: &Hub) -> Result<Box<dyn Bus>, String> {
        let bus = self.bus.open(hub).map_err(|error| error.to_string())?;
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
