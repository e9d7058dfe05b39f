//! Tests of slcan with an adapter that uses the board's own code, and with one that misbehaves. The links are TCP, a socket
//! in the file system, and a pseudo-terminal as the serial line.

use super::message;
use std::fs::File;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::os::unix::net::UnixListener;
use std::sync::mpsc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use compensator_core::can::Frame;
use compensator_core::can::slcan::{Adapter, BitRate, MAX_CLASSIC_LINE_BYTES, emit_frame};
use joint_bus::bus::Address;
use joint_bus::bus::slcan::{Options, Slcan};
use joint_bus::bus::{Bus, BusError};
use joint_trace::CanFrame;

/// Longest wait for a frame that comes. It is far longer than any machine takes.
const LIMIT: Duration = Duration::from_secs(30);

fn data(identifier: u32, extended: bool, data: &[u8]) -> CanFrame {
    let mut bytes = [0; 8];
    bytes[..data.len()].copy_from_slice(data);
    CanFrame::Data { identifier, extended, length: data.len() as u8, bytes }
}

/// Runs an adapter with one joint on its bus: each frame is answered with the next identifier. Ends when the link closes.
/// Returns the received frames.
fn joint(mut line: impl Read + Write) -> Vec<Frame> {
    let mut adapter = Adapter::<MAX_CLASSIC_LINE_BYTES>::new();
    let (mut bytes, mut taken) = ([0; 256], Vec::new());
    while let Ok(length @ 1..) = line.read(&mut bytes) {
        let mut out = Vec::new();
        for arrived in bytes[..length].iter().filter_map(|byte| adapter.push(*byte)) {
            out.extend_from_slice(arrived.answer);
            if let Some(frame) = arrived.frame {
                let answer = Frame::new(frame.identifier() + 1, frame.data()).expect("legal");
                let mut text = [0; MAX_CLASSIC_LINE_BYTES + 1];
                let length = emit_frame(&answer, &mut text).expect("fits");
                out.extend_from_slice(&text[..length]);
                taken.push(frame);
            }
        }
        if line.write_all(&out).is_err() {
            break;
        }
    }
    taken
}

/// Sends frames to a joint at `address` and receives its answers. Returns round trips per second.
fn converse(address: &str) -> f64 {
    let address = Address::parse(address).expect("an address");
    let mut bus = Slcan::open(&address, Options::default()).expect("an adapter");
    let begin = Instant::now();
    for count in 0..500u16 {
        let sent = data(u32::from(count), false, &count.to_le_bytes());
        let before_ns = bus.now_ns();
        bus.send(&sent).expect("sent");
        let arrived = bus.receive_within(LIMIT).expect("open").expect("an answer");
        assert_eq!(arrived.frame, data(u32::from(count) + 1, false, &count.to_le_bytes()));
        assert!(before_ns <= arrived.time_ns && arrived.time_ns <= bus.now_ns());
    }
    let rate = 500.0 / begin.elapsed().as_secs_f64();
    let counters = bus.counters();
    assert_eq!((counters.sent, counters.received), (500, 500));
    assert_eq!((counters.garbage, counters.refused), (0, 0));
    rate
}

#[test]
fn slcan_over_tcp_receives_answers() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address").to_string();
    let peer = thread::spawn(move || {
        let line = listener.accept().expect("a host").0;
        line.set_nodelay(true).expect("set");
        joint(line)
    });
    println!("{:.0} round trips a second over TCP", converse(&address));
    assert_eq!(peer.join().expect("no panic").len(), 500, "closing ends it");
}

#[test]
fn slcan_over_unix_socket_receives_answers() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("joint");
    let listener = UnixListener::bind(&path).expect("a socket");
    let peer = thread::spawn(move || joint(listener.accept().expect("a host").0));
    println!("{:.0} round trips a second over a socket", converse(path.to_str().expect("text")));
    assert_eq!(peer.join().expect("no panic").len(), 500);
}

#[test]
fn slcan_over_serial_line_receives_answers() {
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    let open = || {
        let adapter = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
        grantpt(&adapter)?;
        unlockpt(&adapter)?;
        let path = ptsname(&adapter, Vec::new())?;
        Ok::<_, rustix::io::Errno>((adapter, path))
    };
    let (adapter, path) = match open() {
        Ok(opened) => opened,
        Err(error) => {
            println!("skipped: no pseudo-terminal here: {error}");
            return;
        }
    };
    let path = path.into_string().expect("text");
    // The other end closes when the last copy is dropped; then reading fails.
    let peer = thread::spawn(move || joint(File::from(adapter)));
    println!("{:.0} round trips a second over a serial line", converse(&format!("{path}@3000000")));
    assert_eq!(peer.join().expect("no panic").len(), 500);
}

/// A peer that writes the texts of the test once the bus is open, and returns the received bytes.
struct Peer {
    address: Address,
    say: mpsc::Sender<Vec<u8>>,
    arrived: JoinHandle<Vec<u8>>,
}

/// Answers the commands that open the bus with these texts; later commands get no answer.
fn peer(answers: &'static [&'static [u8]]) -> Peer {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address").to_string();
    let (say, texts) = mpsc::channel::<Vec<u8>>();
    let arrived = thread::spawn(move || {
        let mut line: TcpStream = listener.accept().expect("a host").0;
        line.set_nodelay(true).expect("set");
        let mut arrived = Vec::new();
        let mut bytes = [0; 4096];
        for answer in answers {
            let length = line.read(&mut bytes).unwrap_or(0);
            arrived.extend_from_slice(&bytes[..length]);
            line.write_all(answer).expect("written");
        }
        for text in texts {
            line.write_all(&text).expect("written");
            thread::sleep(Duration::from_millis(5));
        }
        line.shutdown(std::net::Shutdown::Write).expect("shut");
        let _ = line.read_to_end(&mut arrived);
        arrived
    });
    Peer { address: Address::parse(&address).expect("an address"), say, arrived }
}

const WELL: &[&[u8]] = &[b"\r\r\x07", b"\r", b"\r"];

#[test]
fn receive_with_split_malformed_and_overlong_lines_counts_them() {
    let peer = peer(WELL);
    let mut bus = Slcan::open(&peer.address, Options::default()).expect("open");
    let say = |text: &[u8]| peer.say.send(text.to_vec()).expect("sent");
    for piece in ["t", "20", "13A", "0B1", "C2\rT1FFF", "FFFF0\r"] {
        say(piece.as_bytes());
    }
    let mut receive = || bus.receive_within(LIMIT).expect("open").map(|arrived| arrived.frame);
    assert_eq!(receive(), Some(data(0x201, false, &[0xA0, 0xB1, 0xC2])));
    assert_eq!(receive(), Some(data(0x1FFF_FFFF, true, &[])));
    say(b"\xFF\x00nonsense\rt8000\r\x07O\r");
    say(&[b't'; 1000]);
    say(b"\rz\rZ\rV1013\r\rr0053\rR000000068\r");
    assert_eq!(receive(), Some(CanFrame::Remote { identifier: 5, extended: false, length: 3 }));
    assert_eq!(receive(), Some(CanFrame::Remote { identifier: 6, extended: true, length: 8 }));
    say(b"d0019000102030405060708090A0B\rB00000002111\r");
    let mut bytes = [0; 64];
    bytes.iter_mut().zip(0..12).for_each(|(byte, at)| *byte = at);
    let (flags, length) = (0, 12);
    let flexible = CanFrame::Flexible { identifier: 1, extended: false, flags, length, bytes };
    assert_eq!(receive(), Some(flexible));
    let mut bytes = [0; 64];
    bytes[0] = 0x11;
    let (flags, length) = (1, 1);
    let switched = CanFrame::Flexible { identifier: 2, extended: true, flags, length, bytes };
    assert_eq!(receive(), Some(switched));
    let counters = bus.counters();
    // A malformed line, an identifier out of range, a command, an overlong line, and one refusal.
    assert_eq!((counters.received, counters.garbage, counters.refused), (6, 4, 1));
    let begin = Instant::now();
    assert_eq!(bus.receive_within(Duration::from_millis(50)).expect("open"), None);
    assert!(begin.elapsed() >= Duration::from_millis(50));
}

#[test]
fn send_with_each_kind_of_frame_writes_its_line() {
    let peer = peer(WELL);
    let options = Options { bit_rate: BitRate::new(6).expect("a rate"), ..Options::default() };
    let mut bus = Slcan::open(&peer.address, options).expect("open");
    let flexible = |flags, length| CanFrame::Flexible {
        identifier: 0x10,
        extended: false,
        flags,
        length,
        bytes: [0; 64],
    };
    bus.send(&data(0x7FF, false, &[1])).expect("sent");
    bus.send(&data(0x123, true, &[])).expect("sent");
    bus.send(&CanFrame::Remote { identifier: 2, extended: false, length: 4 }).expect("sent");
    bus.send(&flexible(0, 9)).expect("filled up to twelve bytes");
    bus.send(&flexible(5, 1)).expect("sent");
    let error = bus.send(&CanFrame::Error { class: 1, length: 8, bytes: [0; 8] });
    assert!(matches!(error, Err(BusError::Unsupported { what: "error frames", .. })), "{error:?}");
    let error = bus.send(&data(0x800, false, &[]));
    assert!(matches!(error, Err(BusError::Unsupported { .. })), "{error:?}");
    assert_eq!(bus.counters().sent, 5);
    drop(bus);
    drop(peer.say);
    let arrived = String::from_utf8(peer.arrived.join().expect("no panic")).expect("text");
    let zeros = "0".repeat(24);
    let lines = format!("\r\rC\rS6\rO\rt7FF101\rT000001230\rr0024\rd0109{zeros}\rb010100\rC\r");
    assert_eq!(arrived, lines);
}

#[test]
fn receive_after_closed_link_returns_frames_then_error() {
    for last in [&b"t12"[..], b""] {
        let peer = peer(WELL);
        let mut bus = Slcan::open(&peer.address, Options::default()).expect("open");
        peer.say.send([b"t1230\r", last].concat()).expect("sent");
        drop(peer.say);
        let arrived = bus.receive_within(LIMIT).expect("open").map(|arrived| arrived.frame);
        assert_eq!(arrived, Some(data(0x123, false, &[])));
        let error = bus.receive_within(LIMIT).expect_err("closed");
        assert!(matches!(error, BusError::Closed { .. }), "{error}");
        let error = error.to_string();
        assert_eq!(error.lines().count(), 1, "{error}");
        if last.is_empty() {
            message::check("buses", "link closed", &error, &[]);
        } else {
            message::check("buses", "link closed in a line", &error, &[]);
        }
        assert!(matches!(bus.send(&data(1, false, &[])), Err(BusError::Closed { .. })));
        assert!(matches!(bus.receive_within(LIMIT), Err(BusError::Closed { .. })));
    }
}

#[test]
fn open_with_refusing_adapter_fails_and_with_silent_adapter_succeeds() {
    const RATE: &[&[u8]] = &[b"\r", b"\x07"];
    const OPENING: &[&[u8]] = &[b"\x07", b"\r", b"\x07"];
    for (answers, refused) in [(RATE, "BitRate"), (OPENING, "Open")] {
        let peer = peer(answers);
        let error =
            Slcan::open(&peer.address, Options::default()).expect_err("refused").to_string();
        assert!(error.contains("refuses") && error.contains(refused), "{error}");
    }
    let silent = peer(&[]);
    let mut bus = Slcan::open(&silent.address, Options::default()).expect("believed");
    silent.say.send(b"t0010\r".to_vec()).expect("sent");
    let arrived = bus.receive_within(LIMIT).expect("open").map(|arrived| arrived.frame);
    assert_eq!(arrived, Some(data(1, false, &[])));
}

#[test]
fn open_discards_earlier_output_of_the_adapter() {
    // A partial frame at the start, and more frames before the close command takes effect.
    let peer = peer(&[b"7788\rt1230\rt1240\r\x07", b"\r", b"\rt1250\r"]);
    let mut bus = Slcan::open(&peer.address, Options::default()).expect("open");
    let arrived = bus.receive_within(LIMIT).expect("open").map(|arrived| arrived.frame);
    assert_eq!(arrived, Some(data(0x125, false, &[])));
    assert_eq!(bus.counters().garbage, 0);
}

/// The peer does not read: sending fails after the link is full, and no line is split.
#[test]
fn send_to_peer_that_does_not_read_returns_full() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address").to_string();
    let (resume, resumed) = mpsc::channel::<()>();
    let peer = thread::spawn(move || {
        let mut line = listener.accept().expect("a host").0;
        let mut bytes = [0; 64];
        for _ in 0..3 {
            let _ = line.read(&mut bytes);
            line.write_all(b"\r").expect("written");
        }
        resumed.recv().expect("sent");
        let mut arrived = Vec::new();
        let _ = line.read_to_end(&mut arrived);
        arrived
    });
    let address = Address::parse(&address).expect("an address");
    let mut bus = Slcan::open(&address, Options::default()).expect("open");
    let frame = data(0x123, false, &[7; 8]);
    let mut sent = 0;
    let error = loop {
        match bus.send(&frame) {
            Ok(()) => sent += 1,
            Err(error) => break error,
        }
        assert!(sent < 10_000_000, "a peer that takes all");
    };
    assert!(matches!(error, BusError::Full { .. }), "{error}");
    assert!(bus.counters().waits > 0 && bus.counters().sent == sent);
    resume.send(()).expect("it waits");
    // The peer reads on. A call gives up after a limit, so several may be needed on a busy machine.
    let has_room = |_: &u32| bus.send(&frame).is_ok();
    assert!((0..100).find(has_room).is_some(), "there is room again");
    drop(bus);
    let arrived = peer.join().expect("no panic");
    let lines: Vec<&[u8]> = arrived.split(|byte| *byte == b'\r').collect();
    let whole = lines.iter().filter(|line| **line == b"t12380707070707070707").count() as u64;
    assert_eq!(whole, sent + 1);
    assert_eq!(lines.len() as u64, sent + 1 + 2, "C, and nothing behind its end");
}
