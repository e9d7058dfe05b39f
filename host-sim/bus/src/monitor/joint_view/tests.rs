use super::*;
use crate::message;
use crate::monitor::sdo_poller::{IN_BAND, LARGEST_IN_BANDS, WINDOWS, WINDOWS_OUT_OF_BAND};
use crate::monitor::view_data::{Lens, View};
use compensator_core::can::{AnswerFrame, MotionFrame, StatusFrame, TelemetryFrame};
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::NetworkObject;

const MS: u64 = 1_000_000;
/// A start that is not 0, as on a real bus.
const START: u64 = 1_700_000_000_000 * MS;
const LENS: Lens = Lens { window_s: 10.0, columns: 100, events: 100 };

fn model() -> JointView {
    JointView::new(NodeId::FIRST, START)
}

fn receive(model: &mut JointView, at_ms: u64, message: &Message) -> bool {
    frame(model, at_ms, &message.emit())
}

fn frame(model: &mut JointView, at_ms: u64, frame: &Frame) -> bool {
    model.receive(&Received { time_ns: START + at_ms * MS, frame: (*frame).into() })
}

fn raw(model: &mut JointView, at_ms: u64, identifier: u16, data: &[u8]) -> bool {
    frame(model, at_ms, &Frame::new(identifier, data).unwrap())
}

/// A second of a joint at 1 kHz that begins at this time, every frame of it.
fn second(model: &mut JointView, from_ms: u64) {
    for at in from_ms..from_ms + 1000 {
        let velocity_rad_s = at as f32 / 1000.0;
        let motion = MotionFrame { velocity_rad_s, position_rad: 0.0 };
        receive(model, at, &Message::Motion(NodeId::FIRST, motion));
        receive(model, at, &Message::Sync(SyncFrame::of(at as u32)));
        let answer = AnswerFrame { friction_torque_nm: 2.5, feed_forward_current_a: -1.25 };
        receive(model, at, &Message::Answer(NodeId::FIRST, answer));
        let status = StatusFrame { flags: Flags::SLEW_LIMITED, sequence: at as u32 };
        receive(model, at, &Message::Status(NodeId::FIRST, status));
        let telemetry = TelemetryFrame { current_a: 0.5, residual_torque_nm: f32::NAN };
        receive(model, at, &Message::Telemetry(NodeId::FIRST, telemetry));
    }
}

fn view(model: &JointView, at_ms: u64) -> View {
    model.view(START + at_ms * MS, &LENS)
}

fn texts(view: &View) -> Vec<&str> {
    view.events.iter().map(|event| event.text.as_str()).collect()
}

#[test]
fn view_of_running_joint_has_rates_and_ranges() {
    let mut model = model();
    second(&mut model, 0);
    second(&mut model, 1000);
    let view = view(&model, 2000);
    let [velocity, friction, forward, current, residual] = &view.readings;
    assert_eq!(velocity.value, Some(1.999));
    assert_eq!(velocity.range, Some([0.0, 1.999]));
    assert_eq!((friction.value, forward.value, current.value), (Some(2.5), Some(-1.25), Some(0.5)));
    assert!(residual.unmeasured && residual.value.is_none());
    assert!(view.readings.iter().all(|reading| !reading.stale));
    assert_eq!(
        (view.rates.samples, view.rates.answers, view.rates.frames),
        (1000.0, 1000.0, 5000.0)
    );
    // Four frames of 111 to 135 bits and a SYNC of some 55, 1000 times a second, at 1 Mbit/s.
    assert!((0.49..0.61).contains(&view.rates.load), "{}", view.rates.load);
    assert_eq!(view.syncs, SyncCounts::default());
    assert_eq!(view.flags.as_ref().unwrap().names, ["slew-limited"]);
    model.reset_ranges();
    assert_eq!(model.view(START, &LENS).readings[0].range, None);
}

#[test]
fn view_after_silence_is_stale_and_logs_it_once() {
    let mut model = model();
    second(&mut model, 0);
    raw(&mut model, 1000, 0x701, &[5]);
    for at in (1000..9000).step_by(20) {
        model.tick(START + at * MS);
    }
    let view = view(&model, 9000);
    assert!(view.silent);
    let measured = view.readings.iter().filter(|reading| reading.value.is_some());
    assert!(measured.clone().count() == 4 && measured.into_iter().all(|reading| reading.stale));
    assert!((view.readings[0].age_s.unwrap() - 8.001).abs() < 1e-9);
    assert!(view.flags.as_ref().unwrap().is_stale && view.heartbeat.late);
    assert_eq!((view.rates.samples, view.rates.load), (0.0, 0.0));
    let silences = texts(&view).iter().filter(|text| text.contains("silent")).count();
    assert_eq!(silences, 1);
    assert!(raw(&mut model, 9100, 0x701, &[5]));
    assert!(!model.view(START + 9100 * MS, &LENS).silent);
}

#[test]
fn view_with_lost_syncs_counts_them_and_ignores_pauses() {
    let mut model = model();
    let mut sync =
        |at_ms, counter| receive(&mut model, at_ms, &Message::Sync(SyncFrame { counter }));
    for (at, counter) in [(0, 1), (1, 2), (2, 2), (3, 6), (4, 5), (5, 9), (3000, 200), (3001, 201)]
    {
        sync(at, counter);
    }
    let view = view(&model, 3001);
    assert_eq!(view.syncs, SyncCounts { lost: 5, duplicate: 1, late: 1 });
    // Losses close together are one line.
    assert_eq!(texts(&view), ["5 SYNCs lost"]);
}

#[test]
fn view_with_failed_self_test_names_it_by_number() {
    let mut model = model();
    raw(&mut model, 0, 0x701, &[0]);
    assert_eq!(view(&model, 1).codes.failed_self_test, None);
    raw(&mut model, 1, 0x081, &[0x20, 0x52, 0x01, 20, 0, 13, 0, 0]);
    let seen = view(&model, 2);
    assert_eq!(seen.codes.faults, ["self-test-failed"]);
    message::check("events", "failed self-test", texts(&seen)[1], &["13", "comparator 3"]);
    assert_eq!(seen.codes.failed_self_test.as_deref(), Some("13: comparator 3"));
    // A monitor that has missed the emergency reads the number.
    let mut model = self::model();
    let at = FAILED_SELF_TEST;
    model.on_reply(SdoReply::Value(at, 4), START + 5 * MS);
    let test = view(&model, 6).codes.failed_self_test.expect("a number");
    assert!(test.starts_with("4: ") && test.contains("phase a"), "{test}");
    model.on_reply(SdoReply::Value(at, 0), START + 7 * MS);
    assert_eq!(view(&model, 8).codes.failed_self_test, None);
}

#[test]
fn view_with_emergencies_and_objects_updates_faults() {
    let mut model = model();
    raw(&mut model, 0, 0x701, &[0]);
    raw(&mut model, 1, 0x081, &[0x10, 0x32, 0x05, 8, 0, 0, 0, 0]);
    raw(&mut model, 2, 0x081, &[0x10, 0x63, 0x81, 34, 0, 0, 0, 0]);
    let seen = view(&model, 3);
    assert_eq!(seen.codes.faults, ["bus-overvoltage"]);
    assert_eq!(seen.codes.limits, ["parameters-default"]);
    assert!(!seen.codes.read);
    message::check("events", "fault", texts(&seen)[1], &["bus-overvoltage", "3210h"]);
    raw(&mut model, 4, 0x081, &[0, 0, 0, 34, 0, 0, 0, 0]);
    let now_ns = START + 5 * MS;
    let value = |place, value| SdoReply::Value(Address::new(index::STATE, place), value);
    model.on_reply(value(2, 1), now_ns);
    model.on_reply(value(3, 0b1001), now_ns);
    model.on_reply(value(4, 1 << 26), now_ns);
    let seen = view(&model, 6);
    // The joint's own word counts.
    assert_eq!(seen.codes.faults, ["command-timeout", "overcurrent"]);
    assert_eq!(seen.codes.limits, ["brake-test-failed"]);
    assert_eq!(
        (seen.state, seen.emergencies, seen.objects_stale),
        (Some(ReportedState::Armed), 3, false)
    );
    assert!(view(&model, 3000).objects_stale);
    // After a start nothing of that is known any more.
    assert!(raw(&mut model, 3001, 0x701, &[0]));
    let seen = view(&model, 3002);
    assert!(seen.state.is_none() && seen.codes.faults.is_empty() && !seen.codes.read);
}

#[test]
fn view_of_a_joint_with_the_published_test_key_warns_once() {
    let mut model = model();
    assert_eq!(view(&model, 1).accepts_test_key, None);
    let mut read = |value| {
        model.on_reply(SdoReply::Value(UPDATE_KEY, value), START);
        let warnings =
            texts(&view(&model, 1)).iter().filter(|text| text.contains("test key")).count();
        (view(&model, 1).accepts_test_key, warnings)
    };
    assert_eq!(read(PUBLISHED_KEY), (Some(true), 1));
    assert_eq!(read(PUBLISHED_KEY), (Some(true), 1));
    assert_eq!(read(PUBLISHED_KEY + 1), (Some(false), 1));
}

#[test]
fn view_with_network_objects_has_network() {
    let mut model = model();
    let set_object = |model: &mut JointView, place, value| {
        let at = Address::new(index::NETWORK, place);
        model.on_reply(SdoReply::Value(at, value), START);
    };
    set_object(&mut model, NetworkObject::PRESENT, 0);
    set_object(&mut model, NetworkObject::SHARE, 0);
    assert!(view(&model, 1).network.is_none());
    set_object(&mut model, NetworkObject::PRESENT, 1);
    set_object(&mut model, NetworkObject::OUTSIDE, 1);
    set_object(&mut model, NetworkObject::OUTSIDE_COUNT, 3);
    set_object(&mut model, NetworkObject::SHARE, 0.25f32.to_bits());
    let seen = view(&model, 1);
    let network = seen.network.expect("it has one");
    assert_eq!((network.outside, network.outside_count, network.share), (true, 3, Some(0.25)));
    let json = seen.json("can0", &[None; Quantity::ALL.len()]);
    assert_eq!((&json["network_outside"], &json["network_share"]), (&true.into(), &0.25.into()));
}

#[test]
fn view_of_a_watch_that_has_not_decided_is_neither_in_nor_out_of_band() {
    const NOT_DECIDED: u32 = 2;
    for (number, in_band) in [(NOT_DECIDED, None), (0, Some(false)), (1, Some(true))] {
        let mut model = model();
        let mut read = |at, value| model.on_reply(SdoReply::Value(at, value), START);
        read(IN_BAND, number);
        read(WINDOWS_OUT_OF_BAND, 1);
        read(LARGEST_IN_BANDS, 0.5f32.to_bits());
        assert!(view(&model, 1).band.is_none(), "the number of windows is not read yet");
        model.on_reply(SdoReply::Value(WINDOWS, 3), START);
        let seen = view(&model, 1);
        assert_eq!(seen.band.expect("it is read").in_band, in_band);
        let json = seen.json("can0", &[None; Quantity::ALL.len()]);
        assert_eq!(json["model_in_band"], serde_json::json!(in_band));
        assert_eq!(json["windows"], 3);
    }
}

#[test]
fn view_with_frames_of_other_nodes_ignores_them() {
    let mut model = model();
    let other = NodeId::new(2).unwrap();
    let motion = MotionFrame { velocity_rad_s: 9.0, position_rad: 0.0 };
    assert!(!receive(&mut model, 0, &Message::Motion(other, motion)));
    assert!(!raw(&mut model, 1, 0x702, &[5]));
    raw(&mut model, 2, 0x082, &[0x10, 0x32, 5, 8, 0, 0, 0, 0]);
    let error = CanFrame::Error { class: 4, length: 8, bytes: [0; 8] };
    model.receive(&Received { time_ns: START + 3 * MS, frame: error });
    let view = view(&model, 1000);
    assert!(
        view.last_frame_age_s.is_none() && view.nmt.is_none() && view.readings[0].value.is_none()
    );
    assert_eq!((view.emergencies, view.error_frames), (0, 1));
}

#[test]
fn view_with_random_frames_and_times_does_not_panic() {
    let mut model = model();
    let mut state = 1u64;
    for _ in 0..50_000 {
        state = state.wrapping_mul(0x5851_F42D_4C95_7F2D).wrapping_add(0x1405_7B7E_F767_814F);
        let length = (state >> 60).min(8) as usize;
        let bases = [0, 0x80, 0x180, 0x280, 0x300, 0x380, 0x480, 0x580, 0x600, 0x680, 0x700];
        let identifier = bases[(state >> 50) as usize % bases.len()] + (state >> 40 & 1) as u16;
        let data = state.to_le_bytes();
        let frame = Frame::new(identifier, &data[..length]).unwrap();
        // Times that jump, before the start too.
        model.receive(&Received { time_ns: state >> 20, frame: frame.into() });
    }
    model.tick(0);
    let view = model.view(0, &LENS);
    assert!(view.events.len() <= 100 && view.elapsed_s == 0.0);
    assert!(view.json("x", &model.take_line_ranges()).to_string().contains("\"schema\":1"));
}

#[test]
fn json_with_missing_values_has_null() {
    let mut model = model();
    second(&mut model, 0);
    let ranges = model.take_line_ranges();
    let json = view(&model, 1000).json("vcan0", &ranges);
    let at = |path: &str| json.pointer(path).unwrap_or_else(|| panic!("{path}: {json}")).clone();
    assert_eq!(at("/quantities/velocity_rad_s/value"), 0.999);
    assert_eq!(at("/quantities/velocity_rad_s/max"), 0.999);
    assert!(at("/quantities/residual_torque_nm/value").is_null());
    assert!(at("/model_in_band").is_null() && at("/state").is_null());
    assert_eq!(at("/flags"), serde_json::json!(["slew-limited"]));
    assert_eq!(at("/bus"), "vcan0");
}

#[test]
fn view_without_sync_names_frame_and_command_once() {
    let mut model = model();
    model.set_bus("can0", 1_000_000);
    // A joint that waits for its master: heartbeats, no SYNC.
    for at in [0, 1000, 2000, 3000, 4000] {
        raw(&mut model, at, 0x701, &[5]);
        model.tick(START + at * MS);
    }
    let view_at = |model: &JointView, at| view(model, at);
    assert!(view_at(&model, 2900).readings.iter().all(|reading| reading.missing.is_none()));
    let missing = view_at(&model, 4000).readings.map(|reading| reading.missing.unwrap());
    assert!(missing.iter().all(|frame| (frame.name, frame.identifier) == ("SYNC", 0x080)));
    let logged = |model: &JointView| {
        let texts: Vec<String> =
            texts(&view_at(model, 4000)).into_iter().map(str::to_owned).collect();
        texts.into_iter().filter(|text| text.contains("080h") || text.contains("--bus")).collect()
    };
    let events: Vec<String> = logged(&model);
    assert_eq!(events.len(), 2, "{events:?}");
    let quantities = "velocity, friction, feed-fwd, current, residual";
    let command = "host-sim replay TRACE --bus can0 --node-id 1";
    let parts = ["SYNC", "080h", quantities, command];
    message::check("events", "missing frame", &events.join("\n"), &parts);
    // SYNCs and Motion arrive, answers do not: the joint was stopped.
    raw(&mut model, 4500, 0x701, &[4]);
    for at in 4500..8000 {
        let motion = MotionFrame { velocity_rad_s: 1.0, position_rad: 0.0 };
        receive(&mut model, at, &Message::Motion(NodeId::FIRST, motion));
        receive(&mut model, at, &Message::Sync(SyncFrame::of(at as u32)));
    }
    raw(&mut model, 8000, 0x701, &[4]);
    let [velocity, friction, ..] = view_at(&model, 8000).readings;
    assert_eq!(velocity.missing, None);
    assert_eq!(friction.missing.unwrap().command, "cansend can0 000#0101");
}
