//! Any bytes as a parameter record: refused, or a model that is valid, written as it was read, and that runs.

#![no_main]

use compensator_core::can::{Message, Motion, Node, Seal, Sync};
use compensator_core::configuration::Configuration;
use compensator_core::record;
use firmware::hil::{HilJoint, HilSetup, Number, Step};
use firmware::parameter_set::ParameterSet;
use firmware::node_settings::{NodeSettings, emit_block, parse_block};
use libfuzzer_sys::fuzz_target;

const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// With the CRC that belongs to it: dice do not find one.
fn guarded(data: &[u8]) -> Vec<u8> {
    let mut bytes = data.to_vec();
    if let Some((body, crc)) = bytes.split_last_chunk_mut::<4>() {
        *crc = CRC.checksum(body).to_le_bytes();
    }
    bytes
}

fn run(configuration: &Configuration) {
    for number in [Number::Float, Number::Fixed] {
        let setup = HilSetup { number, period_s: 1e-3, campaign_h: 0.0 };
        let Ok(mut joint) = HilJoint::build(Node::FIRST, configuration, None, setup) else { continue };
        joint.set_enabled(true);
        let most = configuration.model.envelope.velocity_max_rad_s;
        let speeds = [0.0, most, -most, most * 1e-3, -most * 1e-6, 2.0 * most, f32::NAN, 0.0];
        for (sequence, velocity_rad_s) in speeds.into_iter().enumerate() {
            let seal = Seal { radial_force_n: 1e3 * sequence as f32, pressure_diff_pa: 1e6 };
            joint.take(&Message::Seal(Node::FIRST, seal));
            joint.take(&Message::Motion(Node::FIRST, Motion { velocity_rad_s, position_rad: 1.0 }));
            let Step::Reply(reply, 0) = joint.sync(Sync::of(sequence as u32)) else { panic!() };
            assert!(reply.answer.friction_torque_nm.is_finite(), "{number:?} {reply:?}");
            assert!(reply.answer.feed_forward_current_a.is_finite(), "{number:?} {reply:?}");
        }
    }
}

fuzz_target!(|data: &[u8]| {
    for bytes in [data.to_vec(), guarded(data)] {
        if let Ok(configuration) = record::parse(&bytes) {
            configuration.validate().expect("what is read is valid");
            // By its bytes: what a model does not use may be no number at all, which equals nothing.
            let written = record::emit(&configuration);
            assert_eq!(record::parse(&written).map(|again| record::emit(&again)), Ok(written));
            run(&configuration);
        }
    }
    if let Ok(set) = ParameterSet::parse(data) {
        set.validate().expect("what is read is valid");
        assert_eq!(ParameterSet::parse(&set.emit()).map(|again| again.emit()), Ok(set.emit()));
    }
    if let Some(bytes) = data.first_chunk::<{ NodeSettings::LENGTH }>()
        && let Some(settings) = NodeSettings::parse(bytes)
    {
        settings.validate().expect("what is read is valid");
        assert_eq!(NodeSettings::parse(&settings.emit()), Some(settings));
    }
    // A whole block, with the record's CRC put right.
    let mut block = data.to_vec();
    let record = NodeSettings::LENGTH..NodeSettings::LENGTH + record::LENGTH;
    if let Some(place) = block.get_mut(record) {
        let whole = guarded(place);
        place.copy_from_slice(&whole);
    }
    for block in [data, &block] {
        if let Ok((settings, set)) = parse_block(block) {
            let written = emit_block(&settings, &set);
            let again = parse_block(&written).map(|(settings, set)| emit_block(&settings, &set));
            assert_eq!(again, Ok(written));
        }
    }
});
