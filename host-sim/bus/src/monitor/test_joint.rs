//! A joint for the tests of the views.

use super::joint_view::JointView;
use super::rows::Setting;
use super::view_data::{Lens, View};
use crate::bus::Received;
use compensator_core::can::{
    AnswerFrame, Frame as JointFrame, Message, MotionFrame, NodeId, StatusFrame, SyncFrame,
    TelemetryFrame,
};
use compensator_core::compensator::Flags;

pub const MS: u64 = 1_000_000;

pub fn receive(model: &mut JointView, at_ms: u64, frame: JointFrame) {
    model.receive(&Received { time_ns: at_ms * MS, frame: frame.into() });
}

/// Returns the view of a joint that moved for five seconds and then stopped sending.
pub fn model() -> JointView {
    let mut model = JointView::new(NodeId::FIRST, 0);
    receive(&mut model, 0, JointFrame::new(0x701, &[0]).unwrap());
    receive(&mut model, 1, JointFrame::new(0x081, &[0x10, 0x32, 5, 8, 0, 0, 0, 0]).unwrap());
    receive(&mut model, 2, JointFrame::new(0x081, &[0x10, 0x63, 0x81, 34, 0, 0, 0, 0]).unwrap());
    for at in 0..5000u64 {
        let phase = at as f32 * 2e-3;
        let node = NodeId::FIRST;
        let flags = Flags::PRESSURE_STALE | Flags::SLEW_LIMITED;
        for message in [
            Message::Motion(
                node,
                MotionFrame { velocity_rad_s: 3.5 * phase.sin(), position_rad: 0.0 },
            ),
            Message::Sync(SyncFrame::of(at as u32 + u32::from(at > 3000))),
            Message::Answer(
                node,
                AnswerFrame {
                    friction_torque_nm: 2.0 * phase.cos(),
                    feed_forward_current_a: phase.cos(),
                },
            ),
            Message::Status(node, StatusFrame { flags, sequence: at as u32 }),
            Message::Telemetry(
                node,
                TelemetryFrame { current_a: 0.25, residual_torque_nm: f32::NAN },
            ),
        ] {
            receive(&mut model, at, message.emit());
        }
        if at % 1000 == 500 {
            receive(&mut model, at, JointFrame::new(0x701, &[5]).unwrap());
        }
    }
    model
}

pub fn setting() -> Setting {
    Setting { bus: "can0".into(), ..Setting::default() }
}

pub fn seen(model: &JointView, at_ms: u64) -> View {
    model.view(at_ms * MS, &Lens { window_s: 10.0, columns: 240, events: 500 })
}

/// Compares the words of a screen, without its charts.
#[track_caller]
pub fn check_screen(section: &str, screen: &str) {
    let is_dot = |sign: char| ('\u{2801}'..='\u{28FF}').contains(&sign);
    crate::snapshot::check("screens", section, &screen.replace(is_dot, " "));
}

pub fn assert_shows(screen: &str, words: &[&str]) {
    for word in words {
        assert!(screen.contains(word), "{word:?} is not on\n{screen}");
    }
}
