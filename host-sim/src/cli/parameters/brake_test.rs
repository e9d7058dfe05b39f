//! `params brake-test`: requests a test of the holding brake and prints its result.
//!
//! A worn or oily brake holds less than its rated torque, and the load falls when the bridge opens. So the driver presses
//! the motor against the closed brake with a set torque, in both directions, and measures how far the joint turns. This tool
//! orders the test (2030h), waits for its end and prints its result. Exit code 1 means that the brake was not found to hold:
//! it slipped, or the test has no result.

use super::{Driver, Result, print_result};
use canopen_rs::Address;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::HoldingBrakeObject;
use serde_json::json;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Longest test that the driver permits, with a margin for a slow bus.
const TIMEOUT: Duration = Duration::from_secs(15);
/// Order that starts a test.
const START: u8 = 1;
/// Results by their number on the bus.
const RUNNING: u32 = 1;
const HELD: u32 = 2;
const SLIPPED: u32 = 3;
const NO_TORQUE: u32 = 4;
const INTERRUPTED: u32 = 5;

/// Reason why a test has no result.
#[derive(Debug, thiserror::Error)]
enum BrakeTestError {
    #[error("the test of the brake does not end")]
    Endless,
}

/// Result of a test.
struct BrakeTest {
    result: u32,
    /// Largest way forwards and back, rad.
    ways_rad: [f64; 2],
}

impl BrakeTest {
    fn name(&self) -> &'static str {
        match self.result {
            HELD => "held",
            SLIPPED => "slipped",
            NO_TORQUE => "no-torque",
            INTERRUPTED => "interrupted",
            _ => "unknown",
        }
    }

    fn in_words(&self) -> String {
        let [forwards, back] = self.ways_rad;
        let verdict = match self.result {
            HELD => "the brake holds its test torque in both directions",
            SLIPPED => "the brake SLIPPED: the joint must not be left to it",
            NO_TORQUE => "the current did not reach the test torque, so the brake is NOT tested",
            INTERRUPTED => "the test was interrupted, so the brake is NOT tested",
            _ => "the driver reports an unknown result",
        };
        format!("{verdict}; the joint turned by {forwards:.4} rad forwards and {back:.4} rad back")
    }
}

impl Driver {
    fn request_brake_test(&mut self) -> Result<BrakeTest> {
        let order = Address::new(index::HOLDING_BRAKE, HoldingBrakeObject::TEST_ORDER);
        self.client.write(order, &[START])?;
        let since = Instant::now();
        let mut result = RUNNING;
        while result == RUNNING {
            if since.elapsed() > TIMEOUT {
                return Err(BrakeTestError::Endless.into());
            }
            result = self.number(index::HOLDING_BRAKE, HoldingBrakeObject::TEST_RESULT)?;
        }
        let mut way = |place| {
            let word = self.number(index::HOLDING_BRAKE, place);
            word.map(|word| 1e-6 * f64::from(word as i32))
        };
        let forwards = way(HoldingBrakeObject::WAY_FORWARDS)?;
        Ok(BrakeTest { result, ways_rad: [forwards, way(HoldingBrakeObject::WAY_BACK)?] })
    }

    /// Tests the brake. The exit code is 1 if it was not found to hold.
    pub(super) fn brake_test(&mut self, name: &str, json: bool) -> Result<ExitCode> {
        let test = self.request_brake_test()?;
        let [forwards, back] = test.ways_rad;
        let document = json!({
            "result": test.name(), "way_forwards_rad": forwards, "way_back_rad": back,
        });
        print_result(json, &document, &format!("{name}: {}\n", test.in_words()))?;
        Ok(ExitCode::from(u8::from(test.result != HELD)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::can::NodeId;
    use joint_bus::bus::{Bus, Hub};
    use joint_bus::canopen::Client;
    use joint_rig::MotorNode;
    use simulated_machines::joint_plant::HoldingBrake;

    /// Returns a joint with a holding brake of this torque, Nm, and its test with 10.4 Nm.
    fn joint(brake_nm: f64) -> Driver {
        let mut node = MotorNode::commissioned().expect("a joint");
        node.rig().plant_mut().brake = Some(HoldingBrake::new(brake_nm, 0.03, 0.04));
        let hub = Hub::new();
        hub.attach(node);
        let bus: Box<dyn Bus> = Box::new(hub.port());
        let mut driver = Driver { client: Client::new(bus, NodeId::FIRST) };
        for (place, value) in [(1, &[1][..]), (7, &[0x90, 1])] {
            let at = Address::new(index::HOLDING_BRAKE, place);
            driver.client.write(at, value).expect("a setting");
        }
        driver
    }

    #[test]
    fn requested_test_reports_a_brake_that_holds_or_slips() {
        let held = joint(30.0).request_brake_test().expect("a result");
        assert_eq!((held.result, held.name()), (HELD, "held"));
        assert!(held.ways_rad.iter().all(|way| (0.0..0.01).contains(way)), "{:?}", held.ways_rad);
        let slipped = joint(1.0).request_brake_test().expect("a result");
        assert_eq!(slipped.name(), "slipped");
        assert!(slipped.ways_rad[0] > 0.02, "{:?}", slipped.ways_rad);
        assert!(slipped.in_words().contains("SLIPPED"));
    }

    #[test]
    fn requested_test_without_torque_is_refused_with_the_reason() {
        let mut driver = joint(30.0);
        let torque = Address::new(index::HOLDING_BRAKE, 7);
        driver.client.write(torque, &[0, 0]).expect("a setting");
        let error = driver.request_brake_test().err().expect("a refusal").to_string();
        assert!(error.contains("2030h:7 = 0"), "{error}");
    }
}
