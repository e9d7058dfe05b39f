//! `monitor` as a user runs it: lines in a pipe, the screen on a terminal, and the restored terminal after its end.
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
#[cfg(feature = "monitor")]
const LEAVES_PAGE: &str = "\x1b[?1049l";
#[cfg(feature = "monitor")]
const SHOWS_CURSOR: &str = "\x1b[?25h";

fn run(arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(PROGRAM).arg("monitor").args(arguments).output().expect("starts");
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn monitor_in_pipe_prints_one_json_line_per_second() {
    let (code, lines, stderr) = run(&["--seconds", "2.2"]);
    assert_eq!(code, Some(0), "{stderr}");
    assert!(stderr.starts_with("note: ") && stderr.lines().count() == 1, "{stderr}");
    let all: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(all.len(), 2, "{lines}");
    let at = |path: &str| all[1].pointer(path).unwrap_or_else(|| panic!("{path}: {lines}")).clone();
    assert_eq!((at("/schema"), at("/node"), at("/state")), (1.into(), 1.into(), "armed".into()));
    assert_eq!(at("/nmt"), "operational");
    assert!(at("/bus").as_str().unwrap().contains("simulated"));
    // 1 kHz, exact because the rate is counted in slots of 0.1 s.
    assert_eq!(at("/samples_per_s"), 1000.0);
    assert_eq!(at("/answers_per_s"), 1000.0);
    assert_eq!(at("/sync_lost"), 0);
    assert!((0.6..0.95).contains(&at("/bus_load").as_f64().unwrap()), "{}", at("/bus_load"));
    let friction = at("/quantities/friction_torque_nm");
    assert!(friction["max"].as_f64().unwrap() > friction["min"].as_f64().unwrap() + 0.1);
    assert!(friction["stale"] == false && friction["age_s"].as_f64().unwrap() < 0.1);
    // Only the first line reports the start of the driver.
    let starts = |line: &Value| line["events"].to_string().matches("has started").count();
    assert_eq!((starts(&all[0]), starts(&all[1])), (1, 0));
}

#[test]
fn monitor_with_listen_sends_no_frame() {
    let folder = tempfile::tempdir().unwrap();
    let sent = |arguments: &[&str]| {
        let log = folder.path().join("log");
        let path = log.to_str().unwrap();
        let (code, lines, stderr) =
            run(&[arguments, &["--json", "--seconds", "2.2", "--record", path]].concat());
        assert_eq!((code, stderr.as_str()), (Some(0), ""));
        let log = std::fs::read_to_string(&log).unwrap();
        assert!(log.lines().count() > 6000, "{}", log.lines().count());
        let line: Value = serde_json::from_str(lines.lines().last().unwrap()).unwrap();
        (log.lines().filter(|line| line.ends_with(" T")).count(), line)
    };
    let (count, line) = sent(&["--listen"]);
    assert_eq!(count, 0);
    assert_eq!(line["samples_per_s"], 1000.0);
    let (count, line) = sent(&[]);
    // All objects twice a second.
    assert!((9..=90).contains(&count), "{count}");
    assert_eq!(line["input_source"], "the bus");
}

#[test]
fn monitor_on_silent_bus_names_missing_frame_and_command() {
    // An adapter whose bus is silent.
    let adapter = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let bus = format!("slcan:{}", adapter.local_addr().expect("its address"));
    let held = std::thread::spawn(move || {
        let (mut line, _) = adapter.accept().expect("a connection");
        let mut bytes = [0; 256];
        while let Ok(1..) = line.read(&mut bytes) {}
    });
    let (code, lines, stderr) = run(&["--bus", &bus, "--listen", "--json", "--seconds", "4.2"]);
    held.join().expect("the adapter");
    assert_eq!((code, stderr.as_str()), (Some(0), ""));
    let all: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let missing = |line: &Value| line["quantities"]["current_a"]["missing_frame"].clone();
    assert!(missing(&all[1]).is_null(), "a heartbeat may take this long: {}", all[1]);
    let command = format!("host-sim params status --bus {bus} --node-id 1");
    let expected =
        serde_json::json!({"name": "heartbeat", "identifier": 0x701, "command": command});
    assert_eq!(missing(&all[3]), expected, "{lines}");
    assert_eq!(lines.matches("no heartbeat (701h)").count(), 1, "it is logged once: {lines}");
}

#[test]
fn monitor_with_bad_arguments_returns_one_line_error() {
    for arguments in [
        &["--seconds", "0"][..],
        &["--node-id", "0"],
        &["--bus", "slcan:127.0.0.1:1"],
        &["--bus", "no-such-bus0"],
    ] {
        let (code, lines, stderr) = run(arguments);
        assert_eq!((code, lines.as_str()), (Some(2), ""), "{arguments:?}");
        let errors: Vec<&str> = stderr.lines().filter(|l| !l.starts_with("note: ")).collect();
        assert!(errors.len() == 1 && errors[0].starts_with("error: "), "{stderr}");
    }
}

/// A program on its own pseudo-terminal.
pub struct OnTerminal {
    child: Child,
    keyboard: File,
    /// The program's end of the terminal, to read its modes.
    terminal_end: File,
    screen: Receiver<Vec<u8>>,
    seen: String,
}

impl OnTerminal {
    pub fn start(command: &mut Command) -> Self {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a terminal");
        grantpt(&master).and_then(|()| unlockpt(&master)).expect("a terminal");
        let path = ptsname(&master, Vec::new()).expect("its name").into_string().expect("UTF-8");
        let size = Winsize { ws_row: 40, ws_col: 120, ws_xpixel: 0, ws_ypixel: 0 };
        tcsetwinsize(&master, size).expect("a size");
        let open = || OpenOptions::new().read(true).write(true).open(&path).expect("its other end");
        let terminal_end = open();
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
        Self { child, keyboard, terminal_end, screen, seen: String::new() }
    }

    pub fn wait_for(&mut self, what: &str) {
        let start = Instant::now();
        while !self.seen.contains(what) {
            assert!(start.elapsed() < Duration::from_secs(30), "no {what:?} in {:?}", self.seen);
            if let Ok(bytes) = self.screen.recv_timeout(Duration::from_millis(100)) {
                self.seen += &String::from_utf8_lossy(&bytes);
            }
        }
    }

    fn is_raw(&self) -> bool {
        let modes = tcgetattr(&self.terminal_end).expect("a terminal").local_modes;
        !modes.intersects(LocalModes::ECHO | LocalModes::ICANON)
    }

    /// Waits until the program ends. Returns the exit code.
    fn wait_for_end(&mut self) -> Option<i32> {
        let start = Instant::now();
        loop {
            match self.child.try_wait().expect("a child") {
                Some(status) => break status.code(),
                None => assert!(start.elapsed() < Duration::from_secs(60), "does not end"),
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Waits until the program ends and checks that the terminal is restored. Returns the exit code.
    #[cfg(feature = "monitor")]
    fn assert_restored(&mut self) -> Option<i32> {
        self.wait_for(LEAVES_PAGE);
        self.wait_for(SHOWS_CURSOR);
        let code = self.wait_for_end();
        let modes = tcgetattr(&self.terminal_end).expect("a terminal").local_modes;
        assert!(modes.contains(LocalModes::ECHO | LocalModes::ICANON), "{modes:?}");
        code
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
fn monitor_plain_view_redraws_in_place_and_leaves_the_terminal_as_it_is() {
    let mut monitor = on_terminal(&["--view", "plain", "--seconds", "2"]);
    for word in
        ["DEMO", "ARMED", "velocity", "rad/s", "friction", "current", "flags", "windows out"]
    {
        monitor.wait_for(word);
    }
    monitor.wait_for("Ctrl-C ends");
    assert!(!monitor.is_raw());
    // The second picture starts where the first one did.
    let rows = monitor.seen.split("Ctrl-C ends").next().unwrap().matches('\n').count() + 1;
    monitor.wait_for(&format!("\r\x1b[{rows}A"));
    assert_eq!(monitor.wait_for_end(), Some(0));
    assert!(!monitor.seen.contains("\x1b[?1049h"), "{:?}", monitor.seen);
}

#[test]
fn monitor_plain_view_ends_by_signal_and_when_its_terminal_is_closed() {
    let mut monitor = on_terminal(&["--view", "plain"]);
    monitor.wait_for("velocity");
    // This view has no keys.
    monitor.keyboard.write_all(b"q\n").unwrap();
    monitor.seen.clear();
    monitor.wait_for("velocity");
    let process = rustix::process::Pid::from_child(&monitor.child);
    rustix::process::kill_process(process, rustix::process::Signal::TERM).unwrap();
    assert_eq!(monitor.wait_for_end(), Some(0));
    assert_ends_without_terminal(&["--view", "plain"]);
}

#[test]
#[cfg(feature = "monitor")]
fn monitor_keys_disarm_arm_and_quit() {
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
    monitor.wait_for("arm: requested");
    monitor.keyboard.write_all(b" ").unwrap();
    monitor.wait_for("PAUSED");
    monitor.keyboard.write_all(b"q").unwrap();
    assert_eq!(monitor.assert_restored(), Some(0));
}

#[test]
#[cfg(feature = "monitor")]
fn monitor_ended_by_time_or_signal_restores_terminal() {
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
#[cfg(feature = "monitor")]
fn monitor_ends_when_its_terminal_is_closed() {
    assert_ends_without_terminal(&[]);
}

/// Closes the terminal of a monitor with these arguments, and requires that the monitor ends.
fn assert_ends_without_terminal(arguments: &[&str]) {
    // The child must not inherit this end, because it would keep the terminal open.
    let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
    let master = openpt(flags).expect("a terminal");
    grantpt(&master).and_then(|()| unlockpt(&master)).expect("a terminal");
    let path = ptsname(&master, Vec::new()).expect("its name").into_string().expect("UTF-8");
    let size = Winsize { ws_row: 40, ws_col: 120, ws_xpixel: 0, ws_ypixel: 0 };
    tcsetwinsize(&master, size).expect("a size");
    let open = || OpenOptions::new().read(true).write(true).open(&path).expect("its other end");
    let mut child = Command::new(PROGRAM)
        .arg("monitor")
        .args(arguments)
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
    // Close the terminal without sending a signal.
    drop(screen);
    let start = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().expect("a child") {
            break status;
        }
        if start.elapsed() > Duration::from_secs(60) {
            child.kill().expect("ended");
            panic!("still running without a terminal");
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    assert_eq!(status.code(), Some(0));
}

/// The test below runs this one on a pseudo-terminal.
#[test]
#[cfg(feature = "monitor")]
#[ignore = "takes the terminal and panics"]
fn panics_on_its_terminal() {
    let _ = joint_monitor::screen::with_terminal::<()>(|terminal| {
        terminal.draw(|frame| frame.render_widget("drawn", frame.area())).expect("drawn");
        panic!("intended panic");
    });
}

#[test]
#[cfg(feature = "monitor")]
fn panic_restores_terminal_before_printing_its_message() {
    let mut command = Command::new(std::env::current_exe().expect("this test"));
    command.args(["monitor::panics_on_its_terminal", "--exact", "--ignored", "--nocapture"]);
    let mut test = OnTerminal::start(&mut command);
    test.wait_for("drawn");
    assert_ne!(test.assert_restored(), Some(0));
    test.wait_for("intended panic");
    let (restored, message) = (test.seen.find(LEAVES_PAGE), test.seen.find("intended panic"));
    assert!(restored < message, "{:?}", test.seen);
}
