//! `params status`: shows the identity and the state of a driver.
//!
//! Every value is read on its own, so they are of slightly different times. A term is live if its input is valid now.

use super::{Driver, Result, print_result};
use canopen_rs::Address;
use compensator_core::TermKind;
use compensator_core::term::MAX_TERMS;
use firmware::node::dictionary::records::NetworkObject;
use firmware::node::dictionary::{FRAME_COUNTERS, index};
use joint_bus::codes::{FIRST_FAULT, FIRST_LIMIT, code_names};
use serde::Serialize;
use serde_json::json;

/// State of the network (object 200Bh).
#[derive(Serialize)]
struct NetworkStatus {
    #[serde(rename = "outside")]
    is_outside: bool,
    outside_count: u32,
    /// Share of the network's factors that is applied, 0 to 1.
    share: f32,
    coulomb_factor: f32,
    static_factor: f32,
    stiffness_factor: f32,
}

impl NetworkStatus {
    fn in_words(&self) -> String {
        let Self { outside_count, coulomb_factor, static_factor, stiffness_factor, .. } = self;
        let place = if self.is_outside { "OUTSIDE" } else { "inside" };
        format!(
            "inputs {place} the trained range ({outside_count} evaluations outside), {:.0} % applied: Coulomb x \
             {coulomb_factor:.3}, static x {static_factor:.3}, stiffness x {stiffness_factor:.3}",
            100.0 * self.share
        )
    }
}

/// A term of the staged model.
#[derive(Serialize)]
struct LiveTerm {
    #[serde(skip)]
    kind: TermKind,
    name: &'static str,
    /// True if its input is valid.
    #[serde(rename = "live")]
    is_live: bool,
}

impl Driver {
    /// Reads the state of the network; `None` if the driver has no network.
    fn network(&mut self) -> Result<Option<NetworkStatus>> {
        if self.number(index::NETWORK, NetworkObject::PRESENT)? == 0 {
            return Ok(None);
        }
        let mut word = |place| self.number(index::NETWORK, place);
        Ok(Some(NetworkStatus {
            is_outside: word(NetworkObject::OUTSIDE)? != 0,
            outside_count: word(NetworkObject::OUTSIDE_COUNT)?,
            share: f32::from_bits(word(NetworkObject::SHARE)?),
            coulomb_factor: f32::from_bits(word(NetworkObject::COULOMB_FACTOR)?),
            static_factor: f32::from_bits(word(NetworkObject::STATIC_FACTOR)?),
            stiffness_factor: f32::from_bits(word(NetworkObject::STIFFNESS_FACTOR)?),
        }))
    }

    /// Reads the terms of the staged model, and whether each is live.
    fn terms(&mut self) -> Result<Vec<LiveTerm>> {
        let live = self.number(index::LIVE_TERMS, 0)?;
        let mut terms = Vec::new();
        // The entries of the terms follow law and choices.
        for place in 0..MAX_TERMS as u8 {
            let number = self.number(index::MODEL, 3 + place)? as u8;
            if let Some(kind) = TermKind::from_number(number) {
                terms.push(LiveTerm { kind, name: kind.name(), is_live: live >> number & 1 != 0 });
            }
        }
        Ok(terms)
    }

    /// Prints the status.
    pub(super) fn status(&mut self, json: bool) -> Result {
        let status = Status::read(self)?;
        print_result(json, &json!(status), &status.in_words())
    }
}

/// What a driver reports of itself, as `--json` prints it.
#[derive(Serialize)]
struct Status {
    name: String,
    hardware: String,
    software: String,
    state: String,
    faults: Vec<String>,
    limits: Vec<String>,
    /// Where the inputs come from.
    source: &'static str,
    /// Type of the numbers that it computes with.
    number: &'static str,
    parameters_crc: String,
    #[serde(rename = "commissioned")]
    is_commissioned: bool,
    /// Whether the torque stays within the band of the model; `None` before the first window.
    #[serde(rename = "model_in_band")]
    is_in_band: Option<bool>,
    windows_out_of_band: u32,
    terms: Vec<LiveTerm>,
    network: Option<NetworkStatus>,
    /// Texts of the last panic and the last refusal; empty without one.
    last_panic: String,
    last_refusal: String,
    /// Number of each kind of frame.
    counters: serde_json::Map<String, serde_json::Value>,
}

impl Status {
    fn read(driver: &mut Driver) -> Result<Self> {
        let mut counters = serde_json::Map::new();
        for (place, counter) in (1..).zip(FRAME_COUNTERS) {
            let count = driver.number(index::FRAME_COUNTERS, place)?;
            counters.insert((*counter).to_owned(), count.into());
        }
        let mut text = |at_index| driver.client.read_text(Address::new(at_index, 0));
        Ok(Self {
            name: text(index::DEVICE_NAME)?,
            hardware: text(index::HARDWARE_VERSION)?,
            software: text(index::SOFTWARE_VERSION)?,
            last_panic: text(index::LAST_PANIC)?,
            state: driver.state()?,
            faults: code_names(driver.number(index::STATE, 3)?, FIRST_FAULT),
            limits: code_names(driver.number(index::STATE, 4)?, FIRST_LIMIT),
            source: if driver.number(index::OPERATION, 1)? == 0 { "sensors" } else { "bus" },
            number: if driver.number(index::OPERATION, 2)? == 0 { "f32" } else { "fixed" },
            parameters_crc: format!("{:08x}", driver.number(index::COMMIT, 1)?),
            is_commissioned: driver.number(index::COMMISSIONING, 1)? != 0,
            is_in_band: match driver.number(index::WATCH, 1)? {
                0 => Some(false),
                1 => Some(true),
                _ => None,
            },
            windows_out_of_band: driver.number(index::WATCH, 3)?,
            network: driver.network()?,
            terms: driver.terms()?,
            last_refusal: driver.client.read_refusal()?,
            counters,
        })
    }

    fn in_words(&self) -> String {
        let Self { name, hardware, software, state, source, number, parameters_crc, .. } = self;
        let list = |codes: &[String]| {
            if codes.is_empty() { "none".to_owned() } else { codes.join(", ") }
        };
        let mut out = format!(
            "{name}, {hardware}, {software}\nstate       {state}\nfaults      {}\nlimits      {}\n\
             inputs      from {source}, computes in {number}\nparameters  crc {parameters_crc}, {}\n\
             model       {}, {} windows out of band\n",
            list(&self.faults),
            list(&self.limits),
            if self.is_commissioned {
                "commissioned"
            } else {
                "NOT commissioned: cannot be armed with its own sensors as inputs"
            },
            match self.is_in_band {
                None => "not evaluated yet",
                Some(true) => "in band",
                Some(false) => "OUT OF BAND",
            },
            self.windows_out_of_band,
        );
        if !self.terms.is_empty() {
            out += &format!("terms       {}\n", terms_in_words(&self.terms));
        }
        if let Some(network) = &self.network {
            out += &format!("network     {}\n", network.in_words());
        }
        for (label, text) in
            [("last panic  ", &self.last_panic), ("last refusal", &self.last_refusal)]
        {
            if !text.is_empty() {
                out += &format!("{label} {text}\n");
            }
        }
        for (name, count) in self.counters.iter().filter(|(_, count)| **count != 0) {
            out += &format!("{name:<20} {count}\n");
        }
        out
    }
}

/// Returns the terms in words; a term without its input has no effect.
fn terms_in_words(terms: &[LiveTerm]) -> String {
    let words = terms.iter().map(|LiveTerm { kind, name, is_live }| match kind.reads() {
        _ if *is_live => format!("{name} live"),
        Some(quantity) => format!("{name} WITHOUT ITS INPUT ({})", quantity.info().label),
        None => format!("{name} not in use: commit the staged model"),
    });
    words.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::can::NodeId;
    use joint_bus::bus::{Bus, Hub};
    use joint_bus::canopen::Client;
    use joint_bus::joint::JointNode;
    use joint_bus::parameters::{read_set, write_set};

    #[test]
    fn terms_of_a_driver_are_live_only_with_their_inputs() {
        let hub = Hub::new();
        hub.attach(JointNode::start(NodeId::FIRST, None).expect("a driver"));
        let bus: Box<dyn Bus> = Box::new(hub.port());
        let mut driver = Driver { client: Client::new(bus, NodeId::FIRST) };
        assert!(driver.terms().expect("it answers").is_empty());
        let mut set = read_set(&mut driver.client).expect("its set");
        set.friction.model.add_term(TermKind::PressureCoulomb);
        set.friction.model.add_term(TermKind::QuadraticDrag);
        write_set(&mut driver.client, &set).expect("it is valid");
        let terms = driver.terms().expect("it answers");
        let found: Vec<_> = terms.iter().map(|term| (term.kind, term.is_live)).collect();
        assert_eq!(found, [(TermKind::PressureCoulomb, false), (TermKind::QuadraticDrag, true)]);
        let text = terms_in_words(&terms);
        assert!(text.starts_with("pressure-coulomb WITHOUT ITS INPUT ("), "{text}");
        assert!(text.ends_with("quadratic-drag live"), "{text}");
    }

    #[test]
    #[cfg(feature = "network")]
    fn network_status_is_present_only_for_a_driver_with_a_network() {
        use crate::reference_network as reference;

        let hub = Hub::new();
        hub.attach(JointNode::start(NodeId::FIRST, None).expect("a driver"));
        let bus: Box<dyn Bus> = Box::new(hub.port());
        let mut driver = Driver { client: Client::new(bus, NodeId::FIRST) };
        assert!(driver.network().expect("it answers").is_none());
        let mut set = read_set(&mut driver.client).expect("its set");
        set.friction.model = reference::parameters();
        set.network = Some(reference::joint());
        write_set(&mut driver.client, &set).expect("it is valid");
        let text = driver.network().expect("it answers").expect("it has one").in_words();
        // The network has not been evaluated, so all factors are 1.
        assert!(text.contains("100 %") && text.matches("x 1.000").count() == 3, "{text}");
        crate::snapshot::check("units-of-commands", "status of a network", &text);
    }
}
