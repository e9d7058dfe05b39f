//! `params status`: what a driver is, and how it fares.

use super::{Driver, words};
use crate::cli::output::say;
use canopen_rs::Address;
use firmware::node::dictionary::records::NetworkState;
use firmware::node::dictionary::{FRAME_COUNTERS, index};
use firmware::supervisor::Code;
use joint_bus::bus::Bus;
use joint_bus::canopen::Client;
use serde_json::json;

/// Object 200Bh of a driver that has a network.
struct Network {
    outside: bool,
    outside_count: u32,
    share: f32,
    /// On Coulomb level, static level and stiffness.
    factors: [f32; 3],
}

impl Network {
    fn json(&self) -> serde_json::Value {
        let [coulomb, static_level, stiffness] = self.factors;
        json!({
            "outside": self.outside, "outside_count": self.outside_count, "share": self.share,
            "coulomb_factor": coulomb, "static_factor": static_level, "stiffness_factor": stiffness,
        })
    }

    fn in_words(&self) -> String {
        let place = if self.outside { "OUTSIDE" } else { "inside" };
        let [coulomb, static_level, stiffness] = self.factors;
        format!(
            "{place} what it was trained on ({} evaluations outside), {:.0} % in force: Coulomb x {coulomb:.3}, static x \
             {static_level:.3}, stiffness x {stiffness:.3}",
            self.outside_count,
            100.0 * self.share
        )
    }
}

impl Driver {
    /// The network that supplies the law; `None` of a driver without one.
    fn network(&mut self) -> Result<Option<Network>, String> {
        if self.number(index::NETWORK, NetworkState::PRESENT)? == 0 {
            return Ok(None);
        }
        let mut real = |place| self.number(index::NETWORK, place).map(f32::from_bits);
        let share = real(NetworkState::SHARE)?;
        let factors = [
            real(NetworkState::COULOMB_FACTOR)?,
            real(NetworkState::STATIC_FACTOR)?,
            real(NetworkState::STIFFNESS_FACTOR)?,
        ];
        let outside = self.number(index::NETWORK, NetworkState::OUTSIDE)? != 0;
        let outside_count = self.number(index::NETWORK, NetworkState::OUTSIDE_COUNT)?;
        Ok(Some(Network { outside, outside_count, share, factors }))
    }

    /// Prints it.
    pub(super) fn status(&mut self, json: bool) -> Result<(), String> {
        let text = |client: &mut Client<Box<dyn Bus>>, at_index| {
            client.read_text(Address::new(at_index, 0)).map_err(words)
        };
        let name = text(&mut self.client, index::DEVICE_NAME)?;
        let hardware = text(&mut self.client, index::HARDWARE_VERSION)?;
        let software = text(&mut self.client, index::SOFTWARE_VERSION)?;
        let state = self.state()?;
        let faults = codes(self.number(index::STATE, 3)?, 1);
        let limits = codes(self.number(index::STATE, 4)?, 33);
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
        let panic = text(&mut self.client, index::LAST_PANIC)?;
        let refusal = text(&mut self.client, index::REFUSAL)?;
        let mut counters = Vec::new();
        for (place, counter) in FRAME_COUNTERS.iter().enumerate() {
            let value = self.number(index::FRAME_COUNTERS, place as u8 + 1)?;
            counters.push((*counter, value));
        }
        if json {
            let counters: serde_json::Map<_, _> =
                counters.iter().map(|(name, value)| ((*name).to_owned(), json!(value))).collect();
            let status = json!({
                "name": name, "hardware": hardware, "software": software, "state": state,
                "faults": faults, "limits": limits, "source": source, "number": number,
                "parameters_crc": format!("{crc:08x}"), "commissioned": commissioned, "model_in_band": in_band,
                "windows_out_of_band": out_of_band, "network": network.as_ref().map(Network::json), "last_panic": panic,
                "last_refusal": refusal, "counters": counters,
            });
            let text = serde_json::to_string_pretty(&status).map_err(|e| e.to_string())?;
            return say(&(text + "\n"));
        }
        let list = |codes: &[&str]| {
            if codes.is_empty() { "none".to_owned() } else { codes.join(", ") }
        };
        let mut out = format!(
            "{name}, {hardware}, {software}\nstate       {state}\nfaults      {}\nlimits      {}\n\
             fed by      {source}, computes in {number}\nparameters  crc {crc:08x}, {}\n\
             model       {}, {out_of_band} windows out of band\n",
            list(&faults),
            list(&limits),
            if commissioned {
                "commissioned"
            } else {
                "NOT commissioned: does not arm on its sensors"
            },
            match in_band {
                None => "nothing to judge yet",
                Some(true) => "in band",
                Some(false) => "OUT OF BAND",
            },
        );
        if let Some(network) = network {
            out += &format!("network     {}\n", network.in_words());
        }
        for (label, value) in [("last panic  ", panic), ("last refusal", refusal)] {
            if !value.is_empty() {
                out += &format!("{label} {value}\n");
            }
        }
        for (name, value) in counters.iter().filter(|(_, value)| *value > 0) {
            out += &format!("{name:<20} {value}\n");
        }
        say(&out)
    }
}

/// Codes of a set of bits, by name; bit 0 is number `first`.
pub(super) fn codes(bits: u32, first: u8) -> Vec<&'static str> {
    let set = (0..32u8).filter(|bit| bits >> bit & 1 != 0);
    set.filter_map(|bit| Code::from_number(first + bit)).map(|code| code.info().name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::can::Node;
    use compensator_core::network::reference;
    use joint_bus::bus::Hub;
    use joint_bus::joint::JointNode;

    #[test]
    fn a_network_is_told_of_a_driver_that_has_one() {
        let hub = Hub::new();
        hub.attach(JointNode::start(Node::FIRST, None).expect("a driver"));
        let bus: Box<dyn Bus> = Box::new(hub.port());
        let mut driver = Driver { client: Client::new(bus, Node::FIRST) };
        assert!(driver.network().expect("it answers").is_none());
        let mut set = driver.read_set().expect("its set");
        set.friction.model = reference::parameters();
        set.network = Some(reference::joint());
        driver.commit(&set).expect("it is valid");
        let told = driver.network().expect("it answers").expect("it has one").in_words();
        // Nothing was evaluated yet: all of what it says, which is the law's constants.
        let expected = "inside what it was trained on (0 evaluations outside), 100 % in force: Coulomb x 1.000, static x \
                        1.000, stiffness x 1.000";
        assert_eq!(told, expected);
    }
}
