use super::*;
mod picture;

use crate::test_joint::{MS, assert_shows, check_screen, model, receive, seen, setting};
use compensator_core::can::{Frame as JointFrame, NodeId};
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::NetworkObject;
use joint_bus::monitor::joint_view::JointView;
use joint_bus::monitor::sdo_poller::SdoReply;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::buffer::Buffer;

fn drawn(view: &View, controls: &Controls, setting: &Setting, size: (u16, u16)) -> Buffer {
    let mut terminal = Terminal::new(TestBackend::new(size.0, size.1)).unwrap();
    terminal.draw(|frame| draw(frame, view, controls, setting)).unwrap();
    terminal.backend().buffer().clone()
}

fn text(buffer: &Buffer) -> String {
    let width = usize::from(buffer.area.width).max(1);
    let rows = buffer.content.chunks(width);
    rows.map(|row| row.iter().map(|cell| cell.symbol()).collect::<String>() + "\n").collect()
}

fn screen(model: &JointView, at_ms: u64, size: (u16, u16)) -> String {
    text(&drawn(&seen(model, at_ms), &Controls::new(false), &setting(), size))
}

const VITAL: [&str; 18] = [
    "node 1 on can0",
    "live",
    "velocity",
    "friction",
    "feed-fwd",
    "current",
    "residual",
    "rad/s",
    "min  -3.500 max   3.500",
    "operational",
    "bus-overvoltage",
    "parameters-default",
    "pressure",
    "1 lost, 0 twice, 0 late",
    "1000/s, answers 1000/s",
    "? help",
    "bus load",
    "q quit",
];

#[test]
fn draw_on_narrow_and_wide_screen_shows_all_values() {
    let model = model();
    for size in [(80, 24), (120, 40), (200, 60)] {
        let screen = screen(&model, 4999, size);
        assert_shows(&screen, &VITAL);
        assert_shows(&screen, &["1000/s", "2 emergencies", "slew"]);
        assert!(!screen.contains("OLD") && !screen.contains("SILENT"), "{screen}");
        assert!(!screen.contains("more lines"), "{screen}");
        let dots = screen.chars().filter(|sign| ('\u{2801}'..='\u{28FF}').contains(sign)).count();
        assert!(dots > 60, "{dots} on\n{screen}");
    }
    let wide = screen(&model, 4999, (120, 40));
    assert_shows(&wide, &["fault bus-overvoltage (3210h)", "00:00:00.001"]);
    check_screen("wide screen", &wide);
    check_screen("narrow screen", &screen(&model, 4999, (80, 24)));
}

#[test]
fn draw_with_network_shows_its_state() {
    let mut model = model();
    assert!(!screen(&model, 4999, (120, 40)).contains("LSTM"));
    for (place, value) in [
        (NetworkObject::PRESENT, 1),
        (NetworkObject::OUTSIDE, 1),
        (NetworkObject::OUTSIDE_COUNT, 3),
        (NetworkObject::SHARE, 0.25f32.to_bits()),
    ] {
        let at = canopen_rs::Address::new(index::NETWORK, place);
        model.on_reply(SdoReply::Value(at, value), 4998 * MS);
    }
    for (size, line) in [
        ((80, 24), "LSTM      outside, 25 % applied"),
        ((120, 40), "LSTM      outside, 25 % applied, 3 x outside"),
    ] {
        let screen = screen(&model, 4999, size);
        assert_shows(&screen, &[line]);
        assert_shows(&screen, &VITAL);
    }
}

#[test]
fn draw_with_old_values_dims_them_and_shows_their_age() {
    let mut model = model();
    model.tick(12_000 * MS);
    let view = seen(&model, 12_000);
    let buffer = drawn(&view, &Controls::new(false), &setting(), (120, 40));
    let screen = text(&buffer);
    assert_shows(&screen, &["SILENT for 7.0 s", "7.0 s OLD"]);
    check_screen("old values", &screen);
    // The value of the velocity is dimmed, as it is not while it is fresh.
    let style = |buffer: &Buffer| buffer.cell((0, 1)).unwrap().fg;
    assert_eq!(buffer.cell((0, 1)).unwrap().symbol(), "v");
    assert_eq!(style(&buffer), Color::DarkGray);
    let fresh = drawn(&seen(&model, 4999), &Controls::new(false), &setting(), (120, 40));
    assert_ne!(style(&fresh), Color::DarkGray);
    // The course has rolled on: its right part is empty.
    let braille = |buffer: &Buffer, x: u16| {
        (2..30).any(|y| {
            let sign = buffer.cell((x, y)).and_then(|cell| cell.symbol().chars().next());
            sign.is_some_and(|sign| ('\u{2801}'..='\u{28FF}').contains(&sign))
        })
    };
    assert!(
        (60..70).any(|x| braille(&fresh, x))
            && !(62..70).any(|x| {
                let sign = buffer.cell((x, 2)).and_then(|cell| cell.symbol().chars().next());
                sign.is_some_and(|sign| ('\u{2801}'..='\u{28FF}').contains(&sign))
            })
    );
}

#[test]
fn draw_at_any_size_in_any_state_does_not_panic() {
    let model = model();
    let mut held = Controls::new(true);
    held.held = Some(seen(&model, 3000));
    let mut asking = Controls::new(false);
    (asking.confirm, asking.help, asking.scroll) = (true, true, 1000);
    let gone = Setting { gone: Some("bus can0: gone".into()), demo: true, ..setting() };
    let nothing = JointView::new(NodeId::FIRST, 0);
    for model in [&model, &nothing] {
        for at_ms in [0, 4999, 60_000] {
            let view = seen(model, at_ms);
            for controls in [&Controls::new(false), &held, &asking] {
                for width in (1..40).chain([69, 70, 71, 80, 120, 250]) {
                    for height in [1, 2, 3, 5, 8, 13, 14, 24, 80] {
                        drawn(&view, controls, &gone, (width, height));
                    }
                }
            }
        }
    }
}

#[test]
fn draw_on_small_screen_keeps_state_and_values() {
    let model = model();
    let screen = screen(&model, 4999, (40, 14));
    assert_shows(&screen, &["velocity", "residual", "operational", "bus-overvoltage"]);
    assert_shows(&screen, &["more lines: enlarge"]);
}

#[test]
fn draw_in_special_states_shows_them() {
    let model = model();
    let view = seen(&model, 4999);
    let demo = Setting { demo: true, ..setting() };
    let mut controls = Controls::new(true);
    for size in [(80, 24), (120, 40)] {
        assert_shows(&text(&drawn(&view, &controls, &demo, size)), &["DEMO"]);
    }
    let screen = |view: &View, controls: &Controls, setting: &Setting| {
        text(&drawn(view, controls, setting, (80, 24)))
    };
    check_screen("demonstration without sending", &screen(&view, &controls, &demo));
    controls = Controls::new(false);
    controls.held = Some(seen(&model, 2000));
    assert_shows(&screen(&view, &controls, &setting()), &["PAUSED 3.0 s"]);
    controls = Controls::new(false);
    controls.confirm = true;
    assert_shows(&screen(&view, &controls, &setting()), &["Arm joint 1?"]);
    check_screen("confirmation of arming", &screen(&view, &controls, &setting()));
    (controls.confirm, controls.help) = (false, true);
    check_screen("help", &screen(&view, &controls, &setting()));
    let gone = Setting { gone: Some("bus can0: down".into()), ..setting() };
    let lost = screen(&view, &Controls::new(false), &gone);
    assert_shows(&lost, &["NO BUS", "bus can0: down"]);
    check_screen("no bus", &lost);
    let empty = seen(&JointView::new(NodeId::FIRST, 0), 0);
    check_screen("no frames yet", &screen(&empty, &Controls::new(false), &setting()));
}

#[test]
fn draw_with_missing_frame_shows_its_name_and_command() {
    let mut waiting = JointView::new(NodeId::FIRST, 0);
    waiting.set_bus("can0", 1_000_000);
    for at in [0, 1000, 2000, 3000, 4000] {
        receive(&mut waiting, at, JointFrame::new(0x701, &[5]).unwrap());
    }
    waiting.tick(4000 * MS);
    let command = "host-sim replay TRACE --bus can0 --node-id 1";
    assert_shows(&screen(&waiting, 4000, (120, 40)), &["velocity", "no SYNC 080h", command]);
    // Without room for charts, the names remain.
    assert_shows(&screen(&waiting, 4000, (60, 24)), &["no SYNC 080h"]);
    // An old value shows its age and the frame.
    let mut stopped = model();
    stopped.tick(20_000 * MS);
    assert_shows(&screen(&stopped, 20_000, (120, 40)), &["OLD: no heartbeat 701h"]);
}
