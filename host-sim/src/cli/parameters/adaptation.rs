//! The adaptation of the friction levels: its mode, its orders, and what it learnt beside the set.
//!
//! While it is on, the joint learns gains on the level, on viscous friction and on the terms of its set. The set itself stays
//! until the order `adopt` multiplies it by them. `diff --learnt` shows both.

use super::drive::Change;
use super::{Driver, Result, print_result};
use crate::cli::error::found;
use canopen_rs::Address;
use compensator_core::adaptation::{Frozen, Gains, MAX_GAINS};
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::AdaptationObject;
use joint_bus::parameters::read_set;
use joint_tuning::names::{Difference, differences};
use serde_json::json;
use std::process::ExitCode;

/// The item of `params set` that is followed by a mode or an order.
pub(super) const ITEM: &str = "adapt";

/// Modes, in the order of 2044h:1, and orders, from 1 in that of 2044h:5.
const MODES: [&str; 4] = ["off", "on", "hold", "on-in-every-mode"];
const ORDERS: [&str; 2] = ["adopt", "discard"];

/// What `params set adapt` changes.
pub(super) enum Request {
    /// A mode, which is a setting of the drive.
    Mode(Change),
    /// An order.
    Order(Order),
}

/// An order to the adaptation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Order {
    /// Number in 2044h:5.
    number: u8,
    pub(super) name: &'static str,
}

/// Parses the word after `adapt`.
///
/// # Errors
/// Returns one line if it is none of the modes and orders.
pub(super) fn parse(word: &str) -> Result<Request> {
    let place = |words: &[&str]| words.iter().position(|known| *known == word);
    if let Some(mode) = place(&MODES) {
        return Ok(Request::Mode(Change::of("drive.adapt", mode as i64)?));
    }
    let order = place(&ORDERS).ok_or_else(|| {
        let expected = "on, hold, off, on-in-every-mode, adopt or discard";
        found(ITEM, format!("{word:?}"), expected)
    })?;
    Ok(Request::Order(Order { number: order as u8 + 1, name: ORDERS[order] }))
}

impl Driver {
    /// Gives an order.
    pub(super) fn order_adaptation(&mut self, order: Order) -> Result {
        let at = Address::new(index::ADAPTATION, AdaptationObject::ORDER);
        Ok(self.client.write(at, &[order.number])?)
    }

    fn reals(&mut self, at_index: u16) -> Result<[f32; MAX_GAINS]> {
        let mut values = [0.0; MAX_GAINS];
        for (place, value) in (1..).zip(&mut values) {
            *value = f32::from_bits(self.number(at_index, place)?);
        }
        Ok(values)
    }

    /// Shows what the joint learnt beside its set. Exit code 1 if it differs.
    pub(super) fn diff_learnt(&mut self, json: bool) -> Result<ExitCode> {
        let set = read_set(&mut self.client)?;
        let gains = Gains::from_array(&self.reals(index::LEARNT_GAINS)?);
        let deviations = self.reals(index::GAIN_DEVIATIONS)?;
        let state = self.number(index::ADAPTATION, AdaptationObject::FROZEN)?;
        let state = Frozen::ALL.get(state as usize).map_or("unknown", |reason| reason.name());
        let learnt_s = f32::from_bits(self.number(index::ADAPTATION, AdaptationObject::LEARNT_S)?);
        let age_s = f32::from_bits(self.number(index::ADAPTATION, AdaptationObject::AGE_S)?);
        let mut learnt = set.clone();
        learnt.friction.model = set.friction.model.with_gains(&gains);
        let lines = differences(&set, &learnt);
        let terms = set.friction.model.terms.iter().map(|kind| kind.name());
        let names = ["level", "viscous"].into_iter().chain(terms);
        let of_gains = names.zip(gains.to_array()).zip(deviations);
        let mut text =
            format!("{state}, learnt from {learnt_s:.0} s of sliding, {age_s:.0} s ago\n");
        let (mut gains, mut rows) = (Vec::new(), Vec::new());
        for ((name, gain), deviation) in of_gains {
            text += &format!("gain on {name}: {gain:.3} +- {deviation:.3}\n");
            gains.push(json!({"name": name, "gain": gain, "std_deviation": deviation}));
        }
        for Difference { name, before, after } in &lines {
            text += &format!("{name}: set {before}, learnt {after}\n");
            rows.push(json!({"name": name, "set": before, "learnt": after}));
        }
        let document = json!({"state": state, "learnt_s": learnt_s, "age_s": age_s, "gains": gains, "differences": rows});
        print_result(json, &document, &text)?;
        Ok(ExitCode::from(u8::from(!lines.is_empty())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::can::NodeId;
    use joint_bus::bus::{Bus, Hub};
    use joint_bus::canopen::Client;
    use joint_bus::joint::JointNode;

    #[test]
    fn parse_of_modes_and_orders_names_what_is_expected() {
        assert!(matches!(parse("hold"), Ok(Request::Mode(_))));
        assert!(matches!(parse("discard"), Ok(Request::Order(Order { number: 2, .. }))));
        let refused = parse("yes").err().unwrap().to_string();
        assert!(refused.contains("on-in-every-mode, adopt or discard"), "{refused}");
        crate::snapshot::check("units-of-commands", "an unknown mode of the adaptation", &refused);
    }

    #[test]
    fn set_of_modes_and_orders_reaches_the_driver() {
        let hub = Hub::new();
        hub.attach(JointNode::start(NodeId::FIRST, None).expect("a driver"));
        let bus: Box<dyn Bus> = Box::new(hub.port());
        let mut driver = Driver { client: Client::new(bus, NodeId::FIRST) };
        let items =
            |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>();
        let refused = driver
            .set(&items(&["adapt", "adopt"]), false, &Default::default())
            .unwrap_err()
            .to_string();
        assert!(refused.contains("2044h:1"), "{refused}");
        crate::snapshot::check(
            "units-of-commands",
            "an order to an adaptation that is off",
            &refused,
        );
        let done =
            driver.set(&items(&["adapt", "on"]), false, &Default::default()).expect("a mode");
        assert!(done.contains("drive.adapt 0 -> 1"), "{done}");
        let done = driver.set(&items(&["adapt=hold"]), false, &Default::default()).expect("a mode");
        assert!(done.contains("drive.adapt 1 -> 2"), "{done}");
        let done =
            driver.set(&items(&["adapt", "adopt"]), false, &Default::default()).expect("an order");
        assert!(done.contains("learnt levels: adopt"), "{done}");
        assert!(driver.diff_learnt(false).is_ok_and(|code| code == ExitCode::SUCCESS));
        let refused =
            driver.set(&items(&["adapt"]), false, &Default::default()).unwrap_err().to_string();
        assert!(refused.contains("on-in-every-mode, adopt or discard"), "{refused}");
    }
}
