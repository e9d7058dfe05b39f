//! Fuzzes the parsers of parameter records, parameter sets and node settings with any bytes.
//!
//! A parser returns an error or a valid value, which must survive writing and reading again. A parsed friction model
//! must also run in a HIL joint with finite results.

use compensator_core::can::{Message, MotionFrame, NodeId, SealFrame, SyncFrame};
use compensator_core::configuration::Configuration;
use compensator_core::record;
use firmware::hil::{HilJoint, HilSetup, HilStep, NumberType};
use firmware::node_settings::{NodeSettings, emit_block};
use firmware::parameter_set::ParameterSet;

const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// Replaces the last four bytes by the correct CRC. Random bytes almost never contain one.
fn with_crc(data: &[u8]) -> Vec<u8> {
    let mut bytes = data.to_vec();
    if let Some((body, crc)) = bytes.split_last_chunk_mut::<4>() {
        *crc = CRC.checksum(body).to_le_bytes();
    }
    bytes
}

fn execute(configuration: &Configuration) {
    for number in [NumberType::Float, NumberType::Fixed] {
        let setup = HilSetup { number, period_s: 1e-3, campaign_h: 0.0 };
        let Ok(mut joint) = HilJoint::build(NodeId::FIRST, configuration, None, setup) else {
            continue;
        };
        joint.set_enabled(true);
        let limit = configuration.model.envelope.velocity_max_rad_s;
        let speeds = [0.0, limit, -limit, limit * 1e-3, -limit * 1e-6, 2.0 * limit, f32::NAN, 0.0];
        for (sequence, velocity_rad_s) in speeds.into_iter().enumerate() {
            let seal = SealFrame { radial_force_n: 1e3 * sequence as f32, pressure_diff_pa: 1e6 };
            joint.take(&Message::Seal(NodeId::FIRST, seal));
            joint.take(&Message::Motion(
                NodeId::FIRST,
                MotionFrame { velocity_rad_s, position_rad: 1.0 },
            ));
            let HilStep::Reply(reply, 0) = joint.sync(SyncFrame::of(sequence as u32)) else {
                panic!("no reply to a SYNC")
            };
            assert!(reply.answer.friction_torque_nm.is_finite(), "{number:?} {reply:?}");
            assert!(reply.answer.feed_forward_current_a.is_finite(), "{number:?} {reply:?}");
        }
    }
}

/// Executes the target on an input.
pub fn run(data: &[u8]) {
    for bytes in [data.to_vec(), with_crc(data)] {
        if let Ok(configuration) = record::parse(&bytes) {
            configuration.validate().expect("a parsed record is valid");
            // Bytes are compared, because parameters that a model does not use may be NaN.
            let written = record::emit(&configuration);
            assert_eq!(record::parse(&written).map(|again| record::emit(&again)), Ok(written));
            execute(&configuration);
        }
    }
    if let Ok(set) = ParameterSet::parse(data) {
        set.validate().expect("a parsed set is valid");
        assert_eq!(ParameterSet::parse(&set.emit()).map(|again| again.emit()), Ok(set.emit()));
    }
    if let Some((settings, _)) = NodeSettings::split(data) {
        settings.validate().expect("parsed settings are valid");
        assert_eq!(NodeSettings::split(&settings.emit()), Some((settings, &[][..])));
    }
    // A block of settings and parameters, with the correct CRC of its record.
    let mut block = data.to_vec();
    let record = NodeSettings::LENGTH..NodeSettings::LENGTH + record::LENGTH;
    if let Some(record) = block.get_mut(record) {
        let corrected = with_crc(record);
        record.copy_from_slice(&corrected);
    }
    for block in [data, &block] {
        let parse = |block| {
            let (settings, set) = NodeSettings::split(block)?;
            Some(emit_block(&settings, &ParameterSet::parse(set).ok()?))
        };
        if let Some(written) = parse(block) {
            assert_eq!(parse(&written), Some(written.clone()));
        }
    }
}
