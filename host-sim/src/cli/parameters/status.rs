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
use serde_json::json;

/// State of the network (object 200Bh).
struct NetworkStatus {
    is_outside: bool,
    outside_count: u32,
    /// Share of the network's factors that is applied, 0 to 1.
    share: f32,
    /// Factors on Coulomb level, static level and stiffness.
    factors: [f32; 3],
}

impl NetworkStatus {
    fn json(&self) -> serde_json::Value {
        let [coulomb, static_level, stiffness] = self.factors;
        json!({
            "outside": self.is_outside, "outside_count": self.outside_count, "share": self.share,
            "coulomb_factor": coulomb, "static_factor": static_level, "stiffness_factor": stiffness,
        })
    }

    fn in_words(&self) -> String {
        let place = if self.is_outside { "OUTSIDE" } else { "inside" };
        let [coulomb, static_level, stiffness] = self.factors;
        format!(
            "inputs {place} the trained range ({} evaluations outside), {:.0} % applied: Coulomb x {coulomb:.3}, static x \
             {static_level:.3}, stiffness x {stiffness:.3}",
            self.outside_count,
            100.0 * self.share
        )
    }
}

impl Driver {
    /// Reads the state of the network; `None` if the driver has no network.
    fn network(&mut self) -> Result<Option<NetworkStatus>> {
        if self.number(index::NETWORK, NetworkObject::PRESENT)? == 0 {
            return Ok(None);
        }
        let mut real = |place| self.number(index::NETWORK, place).map(f32::from_bits);
        let share = real(NetworkObject::SHARE)?;
        let factors = [
            real(NetworkObject::COULOMB_FACTOR)?,
            real(NetworkObject::STATIC_FACTOR)?,
            real(NetworkObject::STIFFNESS_FACTOR)?,
        ];
        let is_outside = self.number(index::NETWORK, NetworkObject::OUTSIDE)? != 0;
        let outside_count = self.number(index::NETWORK, NetworkObject::OUTSIDE_COUNT)?;
        Ok(Some(NetworkStatus { is_outside, outside_count, share, factors }))
    }

    /// Reads the terms of the staged model, and whether each is live.
    fn terms(&mut self) -> Result<Vec<(TermKind, bool)>> {
        let live = self.number(index::LIVE_TERMS, 0)?;
        let mut terms = Vec::new();
        // The entries of the terms follow law and choices.
        for place in 0..MAX_TERMS as u8 {
            let number = self.number(index::MODEL, 3 + place)? as u8;
            if let Some(kind) = TermKind::from_number(number) {
                terms.push((kind, live >> number & 1 != 0));
            }
        }
        Ok(terms)
    }

    /// Prints the status.
    pub(super) fn status(&mut self, json: bool) -> Result {
        let mut text = |at_index| self.client.read_text(Address::new(at_index, 0));
        let [name, hardware, software, panic] = [
            index::DEVICE_NAME,
            index::HARDWARE_VERSION,
            index::SOFTWARE_VERSION,
            index::LAST_PANIC,
        ]
        .map(&mut text);
        let (name, hardware, software, panic) = (name?, hardware?, software?, panic?);
        let state = self.state()?;
        let faults = code_names(self.number(index::STATE, 3)?, FIRST_FAULT);
        let limits = code_names(self.number(index::STATE, 4)?, FIRST_LIMIT);
        let source = if self.number(index::OPERATION, 1)? == 0 { "sensors" } else { "bus" };
        let number = if self.number(index::OPERATION, 2)? == 0 { "f32" } else { "fixed" };
        let crc = self.number(index::COMMIT, 1)?;
        let commissioned = self.number(index::COMMISSIONING, 1)? != 0;
        let in_band = match self.number(index::WATCH, 1)? {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        };
        let out_of_band = self.number(index::WATCH, 3)?;
        let network = self.network()?;
        let terms = self.terms()?;
        let refusal = self.client.read_refusal()?;
        let mut counters = serde_json::Map::new();
        for (place, counter) in (1..).zip(FRAME_COUNTERS) {
            counters
                .insert((*counter).to_owned(), self.number(index::FRAME_COUNTERS, place)?.into());
        }
        let status = json!({
            "name": name, "hardware": hardware, "software": software, "state": state,
            "faults": faults, "limits": limits, "source": source, "number": number,
            "parameters_crc": format!("{crc:08x}"), "commissioned": commissioned, "model_in_band": in_band,
            "windows_out_of_band": out_of_band, "terms": terms.iter().map(|(kind, is_live)| json!({"name": kind.name(), "live": is_live})).collect::<Vec<_>>(),
            "network": network.as_ref().map(NetworkStatus::json), "last_panic": panic,
            "last_refusal": refusal, "counters": counters,
        });
        let list = |codes: &[String]| {
            if codes.is_empty() { "none".to_owned() } else { codes.join(", ") }
        };
        let mut out = format!(
            "{name}, {hardware}, {software}\nstate       {state}\nfaults      {}\nlimits      {}\n\
             inputs      from {source}, computes in {number}\nparameters  crc {crc:08x}, {}\n\
             model       {}, {out_of_band} windows out of band\n",
            list(&faults),
            list(&limits),
            if commissioned {
                "commissioned"
            } else {
                "NOT commissioned: cannot be armed with its own sensors as inputs"
            },
            match in_band {
                None => "not evaluated yet",
                Some(true) => "in band",
                Some(false) => "OUT OF BAND",
            },
        );
        if !terms.is_empty() {
            out += &format!("terms       {}\n", terms_in_words(&terms));
        }
        if let Some(network) = network {
            out += &format!("network     {}\n", network.in_words());
        }
        for (label, value) in [("last panic  ", panic), ("last refusal", refusal)] {
            if !value.is_empty() {
                out += &format!("{label} {value}\n");
            }
        }
        for (name, value) in counters.iter().filter(|(_, value)| **value != 0) {
            out += &format!("{name:<20} {value}\n");
        }
        print_result(json, &status, &out)
    }
}

/// Returns the terms in words; a term without its input has no effect.
fn terms_in_words(terms: &[(TermKind, bool)]) -> String {
    let words = terms.iter().map(|(kind, is_live)| match (is_live, kind.reads()) {
        (true, _) => format!("{} live", kind.name()),
        (false, Some(quantity)) => {
            format!("{} WITHOUT ITS INPUT ({})", kind.name(), quantity.info().label)
        }
        (false, None) => format!("{} not in use: commit the staged model", kind.name()),
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
        assert_eq!(terms, [(TermKind::PressureCoulomb, false), (TermKind::QuadraticDrag, true)]);
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
