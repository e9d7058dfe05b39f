//! Tests of the kernel's CAN: each kind of frame with can-utils, time stamps, losses, full queues, and interfaces that are
//! down or removed.
//!
//! They need can-utils and an interface with CAN FD that is up: `vcan0`, or the one named by `VCAN`. Without it, each test
//! reports that it is skipped. `tests/vcan/run` provides one in a guest, and sets `VCAN_REQUIRED`.

#![cfg(target_os = "linux")]

use std::collections::HashSet;
use std::env;
use std::fs;
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use joint_bus::bus::socket::SocketCan;
use joint_bus::bus::{Bus, BusError, Hub, Recorder};
use joint_trace::{CanFrame, Fraction, Line, candump};

const SECOND: Duration = Duration::from_secs(1);

/// Returns the interface, for one test at a time; `None` if there is none.
fn interface() -> Option<(String, MutexGuard<'static, ()>)> {
    static ONE: Mutex<()> = Mutex::new(());
    let name = env::var("VCAN").unwrap_or("vcan0".into());
    let there = SocketCan::open(&name).map(|_| ());
    if let Err(error) = there {
        assert!(env::var("VCAN_REQUIRED").is_err(), "{error}");
        println!("skipped: {error}");
        return None;
    }
    if Command::new("candump").stdout(Stdio::null()).stderr(Stdio::null()).status().is_err() {
        assert!(env::var("VCAN_REQUIRED").is_err(), "no can-utils");
        println!("skipped: no candump here; apt install can-utils");
        return None;
    }
    Some((name, ONE.lock().unwrap_or_else(PoisonError::into_inner)))
}

/// Runs a program and asserts that it succeeds.
fn run(command: &str) {
    let words: Vec<&str> = command.split_whitespace().collect();
    let output = Command::new(words[0]).args(&words[1..]).output().expect(words[0]);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command}: {message}");
}

fn data(identifier: u32, extended: bool, data: &[u8]) -> CanFrame {
    let mut bytes = [0; 8];
    bytes[..data.len()].copy_from_slice(data);
    CanFrame::Data { identifier, extended, length: data.len() as u8, bytes }
}

fn flexible(identifier: u32, extended: bool, flags: u8, length: u8) -> CanFrame {
    let bytes =
        std::array::from_fn(|at| if at < usize::from(length) { at as u8 ^ 0x5A } else { 0 });
    CanFrame::Flexible { identifier, extended, flags, length, bytes }
}

fn every_kind() -> Vec<CanFrame> {
    vec![
        data(0x000, false, &[]),
        data(0x7FF, false, &[1, 2, 3, 4, 5, 6, 7, 8]),
        data(0x0000_0001, true, &[0xAA]),
        data(0x1FFF_FFFF, true, &[0; 8]),
        CanFrame::Remote { identifier: 0x123, extended: false, length: 0 },
        CanFrame::Remote { identifier: 0x0012_3456, extended: true, length: 8 },
        flexible(0x321, false, 0, 12),
        flexible(0x0765_4321, true, 1, 64),
        flexible(0x10, false, 3, 0),
        flexible(0x11, false, 1, 8),
        CanFrame::Error { class: 0x4, length: 8, bytes: [0, 0x0C, 0, 0, 0, 0, 0, 0] },
    ]
}

/// Removes the flag that only marks CAN FD, which some kernels set.
fn plain(mut frame: CanFrame) -> CanFrame {
    if let CanFrame::Flexible { flags, .. } = &mut frame {
        *flags &= 3;
    }
    frame
}

/// Returns the number of listeners of the kernel for all frames of an interface.
fn listeners(interface: &str) -> usize {
    let list = fs::read_to_string("/proc/net/can/rcvlist_all").unwrap_or_default();
    list.lines().filter(|line| line.split_whitespace().next() == Some(interface)).count()
}

/// Starts candump for a number of frames. It is listening when this returns.
fn candump(interface: &str, frames: usize) -> Child {
    let before = listeners(interface);
    let filter = format!("{interface},0:0,#FFFFFFFF");
    let child = Command::new("timeout")
        .args(["20", "candump", "-L", "-n", &frames.to_string(), &filter])
        .stdout(Stdio::piped())
        .spawn()
        .expect("candump");
    let begin = Instant::now();
    while listeners(interface) == before {
        assert!(begin.elapsed() < 10 * SECOND, "candump does not listen");
        thread::sleep(Duration::from_millis(5));
    }
    child
}

#[test]
fn send_with_each_kind_of_frame_is_received_by_candump() {
    let Some((name, _one)) = interface() else { return };
    let frames = every_kind();
    let dump = candump(&name, frames.len());
    let mut bus = SocketCan::open(&name).expect("open");
    assert!(bus.supports_can_fd());
    frames.iter().for_each(|frame| bus.send(frame).expect("sent"));
    let output = dump.wait_with_output().expect("candump ends");
    let arrived: Vec<CanFrame> = output
        .stdout
        .split(|byte| *byte == b'\n')
        .filter(|line| !line.is_empty())
        .map(|line| plain(candump::parse(line).expect("a line").frame))
        .collect();
    assert_eq!(arrived, frames);
    assert_eq!(bus.counters().sent, frames.len() as u64);
    assert_eq!(bus.receive(0).expect("open"), None, "own frames are not received");
}

#[test]
fn receive_with_frames_of_cansend_returns_them() {
    let Some((name, _one)) = interface() else { return };
    let mut bus = SocketCan::open(&name).expect("open");
    for frame in every_kind() {
        let line = Line { time_ns: 0, interface: b"x", frame, direction: None };
        let mut text = Vec::new();
        candump::emit(&line, Fraction::Microseconds, &mut text);
        let text = String::from_utf8(text).expect("text");
        let words = text.split_whitespace().nth(2).expect("a frame");
        let before_ns = bus.now_ns();
        run(&format!("cansend {name} {words}"));
        let arrived = bus.receive_within(SECOND).expect("open").expect(words);
        assert_eq!(plain(arrived.frame), frame, "{words}");
        // The kernel's time stamp lies between the call and now, within the reading error of both clocks.
        let slack = 1_000_000;
        assert!(before_ns <= arrived.time_ns + slack && arrived.time_ns <= bus.now_ns(), "{words}");
    }
    let counters = bus.counters();
    assert_eq!((counters.received, counters.errors, counters.lost), (11, 1, 0));
}

#[test]
fn receive_after_pause_returns_time_of_arrival() {
    let Some((name, _one)) = interface() else { return };
    let (mut bus, mut other) =
        (SocketCan::open(&name).expect("open"), SocketCan::open(&name).expect("open"));
    other.send(&data(1, false, &[])).expect("sent");
    let after_ns = bus.now_ns();
    thread::sleep(Duration::from_millis(300));
    let arrived = bus.receive(0).expect("open").expect("it waits");
    // Within the reading error of both clocks.
    assert!(arrived.time_ns <= after_ns + 1_000_000, "{} after {after_ns}", arrived.time_ns);
}

#[test]
fn recording_played_by_canplayer_is_unchanged() {
    let Some((name, _one)) = interface() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("trace.log");
    let mut frames = every_kind();
    frames.extend((0..500u32).map(|at| data(at, false, &at.to_le_bytes())));
    let hub = Hub::new();
    let file = fs::File::create(&path).expect("a file");
    let mut record = Recorder::new(hub.port(), file, &name, Fraction::Microseconds);
    for (frame, time_ns) in frames.iter().zip((0..).step_by(200_000)) {
        record.receive(time_ns).expect("a loop");
        record.send(frame).expect("a loop");
    }
    record.flush().expect("written");
    let mut bus = SocketCan::open(&name).expect("open");
    run(&format!("timeout 20 canplayer -I {}", path.display()));
    let arrived: Vec<CanFrame> = std::iter::from_fn(|| bus.receive(0).expect("open"))
        .map(|arrived| plain(arrived.frame))
        .collect();
    assert_eq!(arrived, frames);
}

#[test]
fn receive_without_frames_waits_for_the_given_time() {
    let Some((name, _one)) = interface() else { return };
    let mut bus = SocketCan::open(&name).expect("open");
    let begin = Instant::now();
    assert_eq!(bus.receive_within(Duration::from_millis(120)).expect("open"), None);
    assert!(begin.elapsed() >= Duration::from_millis(119));
    let begin = Instant::now();
    assert_eq!(bus.receive(0).expect("open"), None);
    assert!(begin.elapsed() < 10 * SECOND, "at once");
}

#[test]
fn send_with_full_queue_waits_up_to_the_limit() {
    let Some((name, _one)) = interface() else { return };
    let shape = |what: &str| {
        let command = format!("qdisc replace dev {name} root tbf {what}");
        let output = Command::new("tc").args(command.split_whitespace()).output();
        output.is_ok_and(|output| output.status.success())
    };
    // 100 kbit/s of packets of 16 bytes, room for 20: 781 frames a second.
    if !shape("rate 100kbit burst 160 limit 320") {
        println!("skipped: no traffic shaping here");
        return;
    }
    let (mut bus, mut other) =
        (SocketCan::open(&name).expect("open"), SocketCan::open(&name).expect("open"));
    let begin = Instant::now();
    (0..400u32).for_each(|at| bus.send(&data(1, false, &at.to_le_bytes())).expect("sent"));
    let took = begin.elapsed();
    let arrived = std::iter::from_fn(|| other.receive_within(SECOND).expect("open")).take(400);
    let arrived: Vec<u32> = arrived
        .map(|arrived| u32::from_le_bytes(arrived.frame.data().try_into().expect("four bytes")))
        .collect();
    assert_eq!(arrived, (0..400).collect::<Vec<u32>>(), "in order, none lost");
    assert!(bus.counters().waits > 0);
    assert!(took > Duration::from_millis(300) && took < 60 * SECOND, "{took:?}");

    // A frame every two seconds.
    assert!(shape("rate 64bit burst 72 limit 160"));
    let begin = Instant::now();
    let error = (0..100)
        .find_map(|_| bus.send(&data(2, false, &[])).err())
        .expect("there is no end of room");
    assert!(matches!(error, BusError::Full { .. }) && begin.elapsed() < 60 * SECOND, "{error}");
    run(&format!("tc qdisc del dev {name} root"));
}

#[test]
fn counters_with_full_buffer_report_losses() {
    let Some((name, _one)) = interface() else { return };
    let (mut slow, mut sender) =
        (SocketCan::open(&name).expect("open"), SocketCan::open(&name).expect("open"));
    let mut sent = 0;
    while slow.counters().lost < 100 {
        (0..1000).for_each(|_| sender.send(&data(1, false, &[0; 8])).expect("sent"));
        sent += 1000;
        assert!(sent < 300_000, "a kernel that loses nothing");
    }
    let received = std::iter::from_fn(|| slow.receive(0).expect("open")).count() as u64;
    let counters = slow.counters();
    println!("measured: room for {received} frames in the kernel");
    assert_eq!((received, received + counters.lost), (counters.received, sent));
    assert!(received > 200);
}

#[test]
fn open_with_down_missing_or_classic_interface_reports_it() {
    let Some((_, _one)) = interface() else { return };
    let fresh = "vcan7";
    let _ = Command::new("ip").args(["link", "del", fresh]).output();
    let add = Command::new("ip").args(["link", "add", "dev", fresh, "type", "vcan"]).output();
    if !add.is_ok_and(|output| output.status.success()) {
        println!("skipped: we may not make interfaces");
        return;
    }
    let refused = |advice: &str| {
        let text = SocketCan::open(fresh).expect_err("not to be used").to_string();
        assert!(text.contains(advice) && text.lines().count() == 1, "{text}");
    };
    refused("vcan7 mtu 72 up");
    run("ip link set vcan7 mtu 16 up");
    let mut bus = SocketCan::open(fresh).expect("open");
    assert!(!bus.supports_can_fd());
    let error = bus.send(&flexible(1, false, 0, 8)).expect_err("classic");
    assert!(matches!(error, BusError::Unsupported { what: "CAN FD", .. }), "{error}");
    bus.send(&data(1, false, &[])).expect("classic goes");
    run("ip link set vcan7 down");
    let error = bus.receive_within(SECOND).expect_err("down").to_string();
    assert!(error.contains("vcan7 up"), "{error}");
    let error = bus.send(&data(1, false, &[])).expect_err("down").to_string();
    assert!(error.contains("down"), "{error}");
    run("ip link set vcan7 up");
    bus.send(&data(1, false, &[])).expect("up again");
    run("ip link del vcan7");
    let error = bus.receive_within(SECOND).expect_err("gone");
    assert!(matches!(error, BusError::NoInterface { .. }), "{error}");
    refused("vcan7 type vcan");
    let error = SocketCan::open("lo").expect_err("no CAN");
    assert!(matches!(&error, BusError::Open { name, .. } if name == "lo"), "{error}");
}

#[test]
fn bus_carries_a_kilohertz_of_samples() {
    let Some((name, _one)) = interface() else { return };
    let (mut bus, mut other) =
        (SocketCan::open(&name).expect("open"), SocketCan::open(&name).expect("open"));
    let begin = Instant::now();
    let mut arrived = 0u32;
    for at in 0..20_000u32 {
        bus.send(&data(0x201, false, &[0; 8])).expect("sent");
        if at % 50 == 49 {
            arrived += std::iter::from_fn(|| other.receive(0).expect("open")).count() as u32;
        }
    }
    let rate = f64::from(arrived) / begin.elapsed().as_secs_f64();
    println!("measured: {rate:.0} frames a second sent and received by one thread");
    assert_eq!((arrived, other.counters().lost), (20_000, 0));
    // The rate is judged where the machine may be expected to be idle.
    assert!(rate > 1000.0 || std::env::var_os("LONG_TESTS").is_none_or(|long| long.is_empty()));

    // Samples of a joint: five frames every millisecond, and one answer from another thread.
    let samples = 2000u64;
    let answering = thread::spawn(move || {
        let mut seen = HashSet::new();
        while (seen.len() as u64) < samples {
            let arrived = other.receive_within(5 * SECOND).expect("open").expect("a sample");
            if let CanFrame::Data { identifier: 0x080, .. } = arrived.frame {
                seen.insert(arrived.frame.data().to_vec());
                other.send(&data(0x181, false, arrived.frame.data())).expect("sent");
            }
        }
        other.counters()
    });
    let start_ns = bus.now_ns() + 50_000_000;
    let (mut trips, mut late) = (Vec::new(), 0u64);
    for sample in 0..samples {
        let due_ns = start_ns + sample * 1_000_000;
        assert_eq!(bus.receive(due_ns).expect("open"), None, "an answer that was not requested");
        late = late.max(bus.now_ns().saturating_sub(due_ns));
        for identifier in [0x481, 0x681, 0x401, 0x501] {
            bus.send(&data(identifier, false, &[1; 8])).expect("sent");
        }
        let sent_ns = bus.now_ns();
        bus.send(&data(0x080, false, &sample.to_le_bytes())).expect("sent");
        let arrived = bus.receive_within(SECOND).expect("open").expect("an answer");
        assert_eq!(arrived.frame, data(0x181, false, &sample.to_le_bytes()));
        trips.push(arrived.time_ns.saturating_sub(sent_ns) / 1000);
    }
    let took = (bus.now_ns() - start_ns) as f64 * 1e-9;
    trips.sort_unstable();
    let at = |share: f64| trips[((trips.len() - 1) as f64 * share) as usize];
    println!(
        "measured: 1 kHz, six frames a sample: {samples} samples in {took:.3} s, answer after {} us \
         (median), {} us (99 %), {} us (worst); latest start {} us",
        at(0.5),
        at(0.99),
        at(1.0),
        late / 1000
    );
    let counters = answering.join().expect("no panic");
    assert_eq!((counters.lost, bus.counters().lost), (0, 0));
    assert_eq!(counters.received, 20_000 + 5 * samples);
}
