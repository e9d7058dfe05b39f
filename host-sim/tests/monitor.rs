//! `monitor` from outside: its lines in a pipe, its screen on a terminal, and the terminal it leaves behind.
#![cfg(target_os = "linux")]

use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{LocalModes, Winsize, tcgetattr, tcsetwinsize};
use serde_json::Value;
use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

const PROGRAM: &str = env!("CARGO_BIN_EXE_host-sim");
const LEAVES_PAGE: &str = "\x1b[?1049l";
const SHOWS_CURSOR: &str = "\x1b[?25h";

fn run(arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(PROGRAM).arg("monitor").args(arguments).output().expect("starts");
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn a_pipe_gets_a_line_of_json_a_second() {
    let (code, lines, complaint) = run(&["--seconds", "2.2"]);
    assert_eq!(code, Some(0), "{complaint}");
    assert!(complaint.starts_with("note: ") && complaint.lines().count() == 1, "{complaint}");
    let all: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(all.len(), 2, "{lines}");
    let at = |path: &str| all[1].pointer(path).unwrap_or_else(|| panic!("{path}: {lines}")).clone();
    assert_eq!((at("/schema"), at("/node"), at("/state")), (1.into(), 1.into(), "armed".into()));
    assert_eq!(at("/nmt"), "operational");
    assert!(at("/bus").as_str().unwrap().contains("simulated"));
    // At 1 kHz, to the slot of a tenth of a second.
    assert_eq!(at("/samples_per_s"), 1000.0);
    assert_eq!(at("/answers_per_s"), 1000.0);
    assert_eq!(at("/sync_lost"), 0);
    assert!((0.6..0.95).contains(&at("/bus_load").as_f64().unwrap()), "{}", at("/bus_load"));
    let friction = at("/quantities/friction_torque_nm");
    assert!(friction["max"].as_f64().unwrap() > friction["min"].as_f64().unwrap() + 0.1);
    assert!(friction["stale"] == false && friction["age_s"].as_f64().unwrap() < 0.1);
    // The start of the driver was heard, and is told in the first line alone.
    let starts = |line: &Value| line["events"].to_string().matches("has started").count();
    assert_eq!((starts(&all[0]), starts(&all[1])), (1, 0));
}

#[test]
fn who_listens_sends_nothing_and_who_does_not_asks() {
    let folder = tempfile::tempdir().unwrap();
    let sent = |arguments: &[&str]| {
        let log = folder.path().join("log");
        let path = log.to_str().unwrap();
        let (code, lines, complaint) =
            run(&[arguments, &["--json", "--seconds", "2.2", "--record", path]].concat());
        assert_eq!((code, complaint.as_str()), (Some(0), ""));
        let log = std::fs::read_to_string(&log).unwrap();
        assert!(log.lines().count() > 6000, "{}", log.lines().count());
        let line: Value = serde_json::from_str(lines.lines().last().unwrap()).unwrap();
        (log.lines().filter(|line| line.ends_with(" T")).count(), line)
    };
    let (count, listened) = sent(&["--listen"]);
    assert_eq!(count, 0);
    assert_eq!(listened["samples_per_s"], 1000.0);
    let (count, asked) = sent(&[]);
    // Nine objects twice a second, and not more.
    assert!((9..=45).contains(&count), "{count}");
    assert_eq!(asked["fed_by"], "the bus");
}

#[test]
fn what_is_wrong_is_one_line() {
    for arguments in [
        &["--seconds", "0"][..],
        &["--node-id", "0"],
        &["--bus", "slcan:127.0.0.1:1"],
        &["--bus", "no-such-bus0"],
    ] {
        let (code, lines, complaint) = run(arguments);
        assert_eq!((code, lines.as_str()), (Some(2), ""), "{arguments:?}");
        let said: Vec<&str> = complaint.lines().filter(|l| !l.starts_with("note: ")).collect();
        assert!(said.len() == 1 && said[0].starts_with("error: "), "{complaint}");
    }
}

/// A program on a terminal of its own.
struct OnTerminal {
    child: Child,
    keyboard: File,
    /// The program's end, to ask how the terminal stands.
    own_end: File,
    screen: Receiver<Vec<u8>>,
    seen: String,
}

impl OnTerminal {
    fn start(command: &mut Command) -> Self {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a terminal");
        grantpt(&master).and_then(|()| unlockpt(&master)).expect("a terminal");
        let path = ptsname(&master, Vec::new()).expect("its name").into_string().expect("UTF-8");
        let size = Winsize { ws_row: 40, ws_col: 120, ws_xpixel: 0, ws_ypixel: 0 };
        tcsetwinsize(&master, size).expect("a size");
        let open = || OpenOptions::new().read(true).write(true).open(&path).expect("its other end");
        let own_end = open();
        let child = command
            .stdin(Stdio::from(open()))
            .stdout(Stdio::from(open()))
            .stderr(Stdio::from(open()))
            .spawn()
            .expect("starts");
        let keyboard = File::from(master);
        let mut reader = keyboard.try_clone().expect("a second handle");
        let (sender, screen) = channel();
        std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(length @ 1..) = reader.read(&mut bytes) {
                if sender.send(bytes[..length].to_vec()).is_err() {
                    return;
                }
            }
        });
        Self { child, keyboard, own_end, screen, seen: String::new() }
    }

    fn wait_for(&mut self, what: &str) {
        let start = Instant::now();
        while !self.seen.contains(what) {
            assert!(start.elapsed() < Duration::from_secs(30), "no {what:?} in {:?}", self.seen);
            if let Ok(bytes) = self.screen.recv_timeout(Duration::from_millis(100)) {
                self.seen += &String::from_utf8_lossy(&bytes);
            }
        }
    }

    fn is_raw(&self) -> bool {
        let modes = tcgetattr(&self.own_end).expect("a terminal").local_modes;
        !modes.intersects(LocalModes::ECHO | LocalModes::ICANON)
    }

    /// Waits for the end; the terminal is as it was.
    fn assert_restored(&mut self) -> Option<i32> {
        self.wait_for(LEAVES_PAGE);
        self.wait_for(SHOWS_CURSOR);
        let start = Instant::now();
        let status = loop {
            match self.child.try_wait().expect("a child") {
                Some(status) => break status,
                None => assert!(start.elapsed() < Duration::from_secs(10), "does not end"),
            }
            std::thread::sleep(Duration::from_millis(20));
        };
        let modes = tcgetattr(&self.own_end).expect("a terminal").local_modes;
        assert!(modes.contains(LocalModes::ECHO | LocalModes::ICANON), "{modes:?}");
        status.code()
    }
}

impl Drop for OnTerminal {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn on_terminal(arguments: &[&str]) -> OnTerminal {
    OnTerminal::start(Command::new(PROGRAM).arg("monitor").args(arguments))
}

#[test]
fn keys_disarm_and_arm_a_joint_and_quit_gives_the_terminal_back() {
    let mut monitor = on_terminal(&[]);
    for word in ["DEMO", "ARMED", "velocity", "q quit"] {
        monitor.wait_for(word);
    }
    assert!(monitor.is_raw());
    monitor.keyboard.write_all(b"d").unwrap();
    monitor.wait_for("disarm: done");
    monitor.keyboard.write_all(b"a").unwrap();
    monitor.wait_for("Arm joint 1?");
    monitor.keyboard.write_all(b"y").unwrap();
    monitor.wait_for("arm: asked for");
    monitor.keyboard.write_all(b" ").unwrap();
    monitor.wait_for("PAUSED");
    monitor.keyboard.write_all(b"q").unwrap();
    assert_eq!(monitor.assert_restored(), Some(0));
}

#[test]
fn time_a_signal_and_control_c_give_the_terminal_back() {
    let mut monitor = on_terminal(&["--seconds", "1"]);
    assert_eq!(monitor.assert_restored(), Some(0));
    let mut monitor = on_terminal(&[]);
    monitor.wait_for("velocity");
    let process = rustix::process::Pid::from_child(&monitor.child);
    rustix::process::kill_process(process, rustix::process::Signal::TERM).unwrap();
    assert_eq!(monitor.assert_restored(), Some(0));
    let mut monitor = on_terminal(&[]);
    monitor.wait_for("velocity");
    monitor.keyboard.write_all(&[3]).unwrap();
    assert_eq!(monitor.assert_restored(), Some(0));
}

#[test]
fn a_terminal_that_goes_ends_it() {
    // Not the child's too: it would hold its own terminal open.
    let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
    let master = openpt(flags).expect("a terminal");
    grantpt(&master).and_then(|()| unlockpt(&master)).expect("a terminal");
    let path = ptsname(&master, Vec::new()).expect("its name").into_string().expect("UTF-8");
    let size = Winsize { ws_row: 40, ws_col: 120, ws_xpixel: 0, ws_ypixel: 0 };
    tcsetwinsize(&master, size).expect("a size");
    let open = || OpenOptions::new().read(true).write(true).open(&path).expect("its other end");
    let mut child = Command::new(PROGRAM)
        .arg("monitor")
        .stdin(open())
        .stdout(open())
        .stderr(Stdio::piped())
        .spawn()
        .expect("starts");
    let mut screen = File::from(master);
    let (mut seen, mut bytes) = (String::new(), [0; 4096]);
    while !seen.contains("velocity") {
        let length = screen.read(&mut bytes).expect("a picture");
        seen += &String::from_utf8_lossy(&bytes[..length]);
    }
    // Nobody sends a signal: the window is closed, and that is all.
    drop(screen);
    let start = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().expect("a child") {
            break status;
        }
        if start.elapsed() > Duration::from_secs(10) {
            child.kill().expect("ended");
            panic!("goes on without a terminal");
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    assert_eq!(status.code(), Some(0));
}

/// Run by the test below, on a terminal of its own.
#[test]
#[ignore = "takes the terminal and panics"]
fn panics_on_its_terminal() {
    let _ = joint_bus::monitor::screen::with_terminal::<()>(|terminal| {
        terminal.draw(|frame| frame.render_widget("taken", frame.area())).expect("drawn");
        panic!("as it was told to");
    });
}

#[test]
fn a_panic_gives_the_terminal_back_before_it_speaks() {
    let mut command = Command::new(std::env::current_exe().expect("this test"));
    command.args(["panics_on_its_terminal", "--exact", "--ignored", "--nocapture"]);
    let mut test = OnTerminal::start(&mut command);
    test.wait_for("taken");
    assert_ne!(test.assert_restored(), Some(0));
    test.wait_for("as it was told to");
    let (left, spoke) = (test.seen.find(LEAVES_PAGE), test.seen.find("as it was told to"));
    assert!(left < spoke, "{:?}", test.seen);
}
