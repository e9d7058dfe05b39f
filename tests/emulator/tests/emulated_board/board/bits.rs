//! The shipped image in HIL computes drawn courses over its bus, and every answer equals the core on this PC bit for bit.
//!
//! The replay's set-up and check write a model before each course of `hil_course`, and compare its answers. The interrupt of the loop
//! preempts the computation at 20 kHz. `LONG_TESTS=1` plays longer courses.

use super::board_bus::{BoardBus, NODE, started_image};
use super::hil_course::{Model, course, models};
use super::update::is_long;
use canopen_rs::Address;
use compensator_core::LawKind;
use compensator_core::can::Message;
use compensator_core::configuration::Configuration;
use compensator_core::parameter::ParameterId;
use core_image::PERIOD_S;
use firmware::hil::{HilJoint, HilSetup, HilStep, NumberType};
use firmware::node::dictionary::index;
use firmware::reference_joint::configuration;
use joint_bus::bus::Bus;
use joint_bus::canopen::{Client, SdoError};
use joint_bus::replay::{Check, Plan, ReplaySetup, Tally, set_up};
use std::time::Instant;

/// Samples of each model's course, in the short and in the long form.
const SAMPLES: [u32; 2] = [330, 3300];

/// Longest time until the image has answered a SYNC, ns.
const LONGEST_ANSWER_NS: u64 = 20_000_000;

/// Writes a model to the image and arms it; returns the comparison with the same model.
fn set_up_model(client: &mut Client<BoardBus>, friction: &Configuration) -> Check {
    let setup = ReplaySetup {
        friction: Some(friction.clone()),
        network: None,
        number: Some(NumberType::Float),
        period_s: PERIOD_S,
        adaptation: None,
    };
    Check::new(NODE, set_up(client, NODE, &setup).expect("a legal model"))
}

/// Sends the frames of a course; each sample after the answers to the one before.
fn play_course(client: &mut Client<BoardBus>, plan: &Plan, mut check: Check) -> Tally {
    let bus = client.bus();
    for planned in &plan.frames {
        check.sent(&planned.message, bus.now_ns());
        bus.send(&planned.message.emit().into()).expect("a bus");
        let until_ns = bus.now_ns() + LONGEST_ANSWER_NS;
        let mut is_answered = !matches!(planned.message, Message::Sync(_));
        while !is_answered && let Some(received) = bus.receive(until_ns).expect("a bus") {
            for frame in received.frame.joint_frames() {
                check.received(&frame, received.time_ns);
                // Telemetry is the last of them.
                is_answered |= matches!(Message::parse(&frame), Ok(Message::Telemetry(..)));
            }
        }
    }
    check.finish().0
}

#[test]
fn answers_of_shipped_image_equal_those_of_this_pc_bit_for_bit() {
    let (begin, mut samples, mut client) = (Instant::now(), 0, started_image());
    let models = models();
    for (Model { name, friction }, seed) in models.iter().zip(0..) {
        let check = set_up_model(&mut client, friction);
        let plan = course(SAMPLES[usize::from(is_long())], seed);
        let tally = play_course(&mut client, &plan, check);
        assert!(tally.holds() && tally.duplicated + tally.reordered == 0, "{name}: {tally:?}");
        assert_eq!((tally.equal, tally.telemetry_equal), (plan.samples, plan.samples), "{name}");
        samples += tally.equal;
    }
    let elapsed_s = begin.elapsed().as_secs_f64();
    println!("measured: {samples} samples of {} models in {elapsed_s:.1} s", models.len());
    assert!(samples >= 10_000, "{samples}");
}

/// Returns the words of all answers of the core on this PC.
fn words(friction: &Configuration, plan: &Plan) -> Vec<[u32; 6]> {
    let setup = HilSetup { number: NumberType::Float, period_s: PERIOD_S, campaign_h: 0.0 };
    let mut joint = HilJoint::build(NODE, friction, None, setup).expect("a legal model");
    joint.set_enabled(true);
    let mut answers = Vec::new();
    for planned in &plan.frames {
        match planned.message {
            Message::Sync(sync) => {
                if let HilStep::Reply(reply, _) = joint.sync(sync) {
                    answers.push(reply.words());
                }
            }
            message => {
                joint.take(&message);
            }
        }
    }
    answers
}

#[test]
fn every_term_of_the_courses_changes_the_answers() {
    for (Model { name, friction }, seed) in models().into_iter().zip(0..) {
        let plan = course(SAMPLES[0], seed);
        let found = words(&friction, &plan);
        for at in 0..friction.model.terms.len() {
            let mut without = friction.clone();
            let term = without.model.terms.remove(at);
            let changes = found != words(&without, &plan);
            assert!(changes, "{name}: {} does nothing", term.name());
        }
    }
}

#[test]
fn parameter_that_differs_by_its_last_bit_is_reported() {
    let pc = configuration(LawKind::ImprovedLugre, &[]);
    let mut driver = pc.clone();
    let coulomb = pc.model.get(ParameterId::CoulombTorque);
    driver.model.set(ParameterId::CoulombTorque, f32::from_bits(coulomb.to_bits() + 1));
    let mut client = started_image();
    let check = set_up_model(&mut client, &pc);
    set_up_model(&mut client, &driver);
    let tally = play_course(&mut client, &course(SAMPLES[0], 1), check);
    assert!(!tally.holds() && tally.mismatches > 50, "{tally:?}");
}

#[test]
fn fixed_point_is_refused_by_shipped_image() {
    let at = Address::new(index::OPERATION, 2);
    let refused = started_image().write(at, &[NumberType::Fixed as u8]);
    assert!(matches!(refused, Err(SdoError::Refused { code: 0x0609_0030, .. })), "{refused:?}");
}
