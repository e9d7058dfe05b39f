use super::*;
use crate::bus::Hub;
use crate::joint::JointNode;
use crate::monitor::ReopenError;
use crate::monitor::joint_view::JointView;
use crate::monitor::test_joint::{MS, assert_shows, check_screen, model, receive, seen, setting};
use compensator_core::can::{Frame, NodeId};

const TERMINAL: Terminal = Terminal { width: 80, height: 30, colour: false };

fn shown(view: &View, setting: &Setting, terminal: &Terminal) -> String {
    text(&screen(view, false, setting, terminal), 0, terminal)
}

#[test]
fn screen_of_moving_joint_shows_values_state_and_events() {
    let text = shown(&seen(&model(), 4999), &setting(), &TERMINAL);
    assert_shows(
        &text,
        &[
            "node 1 on can0",
            "live",
            "velocity",
            "rad/s",
            "min  -3.500 max   3.500",
            "current",
            "bus-overvoltage",
            "parameters-default",
            "operational",
            "slew",
            "1000/s, answers 1000/s",
            "SYNC",
            "Ctrl-C",
        ],
    );
    check_screen("plain screen", &text);
    assert!(!text.contains("OLD") && !text.contains("SILENT"), "{text}");
}

#[test]
fn screen_of_silent_joint_shows_age_of_values() {
    let mut joint = model();
    joint.tick(12_000 * MS);
    let text = shown(&seen(&joint, 12_000), &setting(), &TERMINAL);
    assert_shows(&text, &["SILENT for 7.0 s", "7.0 s OLD"]);
    check_screen("plain screen of a silent joint", &text);
    let gone = Setting { gone: Some("bus can0: down".into()), ..setting() };
    let text = shown(&seen(&joint, 12_000), &gone, &TERMINAL);
    assert_shows(&text, &["NO BUS", "bus can0: down"]);
}

#[test]
fn screen_with_missing_frame_shows_its_command() {
    let mut waiting = JointView::new(NodeId::FIRST, 0);
    waiting.set_bus("can0", 1_000_000);
    for at in [0, 1000, 2000, 3000, 4000] {
        receive(&mut waiting, at, Frame::new(0x701, &[5]).unwrap());
    }
    waiting.tick(4000 * MS);
    let text = shown(&seen(&waiting, 4000), &setting(), &TERMINAL);
    assert_shows(&text, &["no SYNC 080h", "host-sim replay TRACE --bus can0 --node-id 1"]);
}

#[test]
fn text_at_any_size_stays_within_the_terminal() {
    for joint in [&model(), &JointView::new(NodeId::FIRST, 0)] {
        let view = seen(joint, 4999);
        for width in [1, 7, 40, 80, 250] {
            for height in [1, 2, 3, 10, 24, 60] {
                let terminal = Terminal { width, height, colour: false };
                let rows = screen(&view, true, &setting(), &terminal);
                assert!(rows.len() < height.max(3), "{} rows of {height}", rows.len());
                let text = text(&rows, 0, &terminal);
                let is_within =
                    |line: &str| line.trim_end_matches("\x1b[K").chars().count() <= width;
                assert!(text.trim_end_matches("\x1b[J").lines().all(is_within), "{text}");
            }
        }
    }
}

#[test]
fn text_after_another_replaces_its_rows() {
    let rows = vec![vec![part("one", Mark::Bad)], vec![part("two", Mark::Plain)]];
    let first = text(&rows, 0, &TERMINAL);
    assert_eq!(first, "one\x1b[K\ntwo\x1b[K\n\x1b[J");
    assert_eq!(text(&rows, 2, &TERMINAL), format!("\r\x1b[2A{first}"));
    let coloured = text(&rows, 0, &Terminal { colour: true, ..TERMINAL });
    assert_eq!(coloured, "\x1b[1;31mone\x1b[0m\x1b[K\ntwo\x1b[K\n\x1b[J");
}

/// A terminal that is closed after a number of writes.
struct Screen {
    writes_left: usize,
    text: String,
}

impl Write for Screen {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        if self.writes_left == 0 {
            return Err(rustix::io::Errno::IO.into());
        }
        self.writes_left -= 1;
        self.text += std::str::from_utf8(bytes).expect("UTF-8");
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[test]
fn run_plain_redraws_until_it_is_over_or_the_terminal_is_closed() {
    for writes_left in [2, usize::MAX] {
        let hub = Hub::new();
        hub.attach(JointNode::start(NodeId::FIRST, None).unwrap());
        let port = hub.port();
        let mut session = Session::new(NodeId::FIRST, false, port.now_ns());
        let mut out = Screen { writes_left, text: String::new() };
        let begin = Instant::now();
        let is_over =
            |_| begin.elapsed() > Duration::from_secs(if writes_left == 2 { 60 } else { 1 });
        let open = || Err(ReopenError::DemoEnded);
        let setting = Setting { bus: "loop".into(), ..Setting::default() };
        let port = Box::new(port);
        let end = run_plain(&mut session, port, setting, &mut out, || TERMINAL, open, is_over);
        assert!(end.is_ok(), "{end:?}");
        // Each picture deletes what is below it.
        let pictures = out.text.matches("\x1b[J").count();
        assert!(if writes_left == 2 { pictures == 2 } else { pictures >= 2 }, "{pictures}");
        assert_shows(&out.text, &["node 1", "loop", "live", "safe", "\r\x1b["]);
    }
}
