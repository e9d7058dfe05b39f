//! Samples of logs as text.

use super::*;
use crate::candump;

fn on(interface: &str, node: u8) -> JointOnBus {
    JointOnBus { interface: interface.as_bytes().into(), node: NodeId::new(node).expect("a node") }
}

/// Returns the samples and the summary of a log.
fn assemble(log: &str) -> (Vec<TraceSample>, Summary) {
    let mut assembler = Assembler::default();
    let mut samples = Vec::new();
    for (at, line) in log.lines().enumerate() {
        let line = candump::parse(line.trim().as_bytes()).unwrap();
        samples.extend(assembler.push(at as u64 + 1, &line));
    }
    let (last, summary) = assembler.finish();
    samples.extend(last);
    (samples, summary)
}

/// Data bytes of the pair (1.0, 2.0) in `f32`.
const ONE_TWO: &str = "0000803F00000040";

#[test]
fn assembler_with_sync_completes_sample_and_attaches_answers() {
    let (samples, summary) = assemble(&format!(
        "(1.000000) can0 601#2300200105000000
         (1.001000) can0 481#{ONE_TWO}
         (1.001000) can0 681#{ONE_TWO}
         (1.001000) can0 401#{ONE_TWO}
         (1.002000) can0 080#01
         (1.003000) can0 181#{ONE_TWO}
         (1.003000) can0 281#0000020000000000
         (1.004000) can0 481#{ONE_TWO}
         (1.004000) can0 681#{ONE_TWO}
         (1.005000) can0 080#02"
    ));
    assert_eq!(samples.len(), 2);
    let [first, second] = [samples[0], samples[1]];
    assert_eq!(
        (first.line, first.time_ns, first.run, first.sequence),
        (5, 1_002_000_000, Some(5), 0)
    );
    assert_eq!((first.motion.velocity_rad_s, first.motion.position_rad), (1.0, 2.0));
    assert_eq!(first.answer.unwrap().feed_forward_current_a, 2.0);
    assert_eq!(first.status.unwrap().flags.bits(), 1 << 17);
    assert_eq!((second.sequence, second.answer), (1, None));
    assert_eq!(second.seal.pressure_diff_pa, 2.0, "a slow PDO keeps its value");
    assert!(second.surroundings.temperature_c.is_nan());
    assert_eq!((summary.samples, summary.answers, summary.lost), (2, 1, 0));
    assert_eq!(summary.joint, Some(on("can0", 1)));
}

#[test]
fn assembler_of_a_joint_that_sends_torque_at_every_third_sync_completes_these_samples() {
    let cycles: String = (1..=240)
        .map(|counter| {
            // One of its torques is lost.
            let has_torque = counter % 3 == 1 && counter != 151;
            let torque = format!("(1.0) can0 681#{ONE_TWO}\n");
            let torque = if has_torque { &*torque } else { "" };
            format!("(1.0) can0 481#{ONE_TWO}\n{torque}(1.0) can0 080#{counter:02X}\n")
        })
        .collect();
    let (samples, summary) = assemble(&cycles);
    // The distance of the torques is known from the second one on.
    let sequences: Vec<u32> = samples.iter().map(|sample| sample.sequence).collect();
    let expected: Vec<u32> = [0, 1, 2].into_iter().chain((3..240).step_by(3)).collect();
    assert_eq!(sequences, expected);
    let without: Vec<u32> = samples
        .iter()
        .filter(|sample| sample.torque.torque_nm.is_nan())
        .map(|sample| sample.sequence)
        .collect();
    assert_eq!(without, [1, 2, 150]);
    assert_eq!((summary.samples, summary.lost), (82, 0));
}

#[test]
fn assembler_with_lost_and_damaged_frames_counts_losses_and_invalidates_one_sample() {
    let pair = format!("(1.0) can0 481#{ONE_TWO}\n(1.0) can0 681#{ONE_TWO}\n");
    let (samples, summary) = assemble(&format!(
        "{pair}(1.0) can0 080#EF
         {pair}(1.0) can0 080#02
         (1.0) can0 481#00112233
         (1.0) can0 681#{ONE_TWO}
         (1.0) can0 080#03
         (1.0) can0 481#{ONE_TWO}
         (1.0) can0 080#04
         (1.0) can0 080#05
         (1.0) can0 601#23002002F1010000
         {pair}(1.0) can0 080#12"
    ));
    let sequences: Vec<u32> = samples.iter().map(|sample| sample.sequence).collect();
    assert_eq!(sequences, [238, 241, 242, 243, 497]);
    assert_eq!(summary.lost, 2 + 252);
    let length = FrameError::Length { identifier: 0x481, found: 4, expected: 8 };
    assert_eq!(samples[2].fault, Some(length));
    assert!(samples[2].motion.velocity_rad_s.is_nan() && samples[3].fault.is_none());
    assert!(samples[3].torque.torque_nm.is_nan(), "a missing fast PDO is NaN");
    assert!(samples[4].torque.torque_nm == 1.0);
}

/// Returns a log of a joint on its sensors, with its answers in classic frames or in one of CAN FD.
fn log_of_sensors(is_fd: bool) -> String {
    let mut out = Vec::new();
    let mut emit = |time_ns, frame| {
        let line = Line { time_ns, interface: b"can0", frame, direction: None };
        candump::emit(&line, crate::Fraction::Microseconds, &mut out);
    };
    for sequence in 0..5u32 {
        let time_ns = 1_000_000 * u64::from(sequence);
        let sync = SyncFrame::of(sequence);
        emit(time_ns, CanFrame::from(Message::Sync(sync).emit()));
        let mut telemetry = FdTelemetry::new(NodeId::FIRST, sync.counter, 0);
        for pdo in 0..6 {
            telemetry.put(
                pdo,
                [f32::to_le_bytes(sequence as f32 + 0.5); 2].concat().try_into().unwrap(),
            );
        }
        if is_fd {
            emit(time_ns + 300_000, CanFrame::from(telemetry));
        } else {
            telemetry.frames().for_each(|frame| emit(time_ns + 300_000, frame.into()));
        }
    }
    String::from_utf8(out).unwrap()
}

#[test]
fn assembler_with_fd_telemetry_returns_the_samples_of_the_classic_frames() {
    let of = |is_fd| {
        let (mut samples, summary) = assemble(&log_of_sensors(is_fd));
        samples.iter_mut().for_each(|sample| sample.line = 0);
        let summary = Summary { frames: 0, ..summary };
        (samples.len(), format!("{samples:?} {summary:?}"))
    };
    let classic = of(false);
    assert_eq!(of(true), classic);
    assert_eq!(classic.0, 4);
    assert!(log_of_sensors(true).contains("381##1"));
}

#[test]
fn assembler_with_both_sides_of_the_gear_returns_the_position_of_the_joints_side() {
    let pair = format!("(1.0) can0 481#{ONE_TWO}\n(1.0) can0 681#{ONE_TWO}\n");
    // 1.5 rad and -2 rad, then no valid frame of the encoder, another joint, and none.
    let (samples, summary) = assemble(&format!(
        "{pair}(1.0) can0 261#60E3160080841E00
         (1.0) can0 080#01
         {pair}(1.0) can0 261#807BE1FF80841E00
         (1.0) can0 080#02
         {pair}(1.0) can0 261#0000008080841E00
         (1.0) can0 080#03
         {pair}(1.0) can0 262#60E3160080841E00
         (1.0) can0 080#04"
    ));
    let positions: Vec<f64> = samples.iter().map(|sample| sample.joint_position_rad).collect();
    assert_eq!(positions[..2], [1.5, -2.0]);
    assert!(positions[2].is_nan() && positions[3].is_nan() && positions.len() == 4);
    assert_eq!((samples[2].torque.torque_nm, summary.foreign), (1.0, 1));
}

#[test]
fn assembler_with_several_joints_follows_the_first() {
    let (samples, summary) = assemble(&format!(
        "(1.0) can0 080#01
         (1.0) can0 000#0102
         (1.0) can0 20000004#000C000000000000
         (1.0) can0 00000481#{ONE_TWO}
         (1.0) can0 481##0{ONE_TWO}
         (1.0) can0 482#{ONE_TWO}
         (1.0) can0 483#{ONE_TWO}
         (1.0) can1 482#{ONE_TWO}
         (1.0) can1 080#01
         (1.0) can0 181#{ONE_TWO}
         (1.0) can0 302#{ONE_TWO}
         (1.0) can0 182#{ONE_TWO}
         (1.0) can0 080#07"
    ));
    assert_eq!(samples.len(), 1);
    assert_eq!((samples[0].sequence, samples[0].run), (6, None));
    assert_eq!(summary.joint, Some(on("can0", 2)));
    assert_eq!(summary.others, [on("can0", 3), on("can1", 2)]);
    assert_eq!((summary.frames, summary.errors, summary.answers), (13, 1, 0));
}
