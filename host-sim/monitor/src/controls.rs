//! The keys of the monitor. The functions are pure, so that tests can call them.

use joint_bus::monitor::sdo_poller::Request;
use joint_bus::monitor::view_data::View;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

/// Durations of the charts, s.
pub const CHART_DURATIONS_S: [f64; 9] = [1.0, 2.0, 5.0, 10.0, 20.0, 60.0, 120.0, 300.0, 600.0];

/// Action that a key requests from the monitor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Quit.
    Quit,
    /// Freeze or release the display.
    Pause,
    /// Reset the minimum and maximum.
    ResetRanges,
    /// Send a request to the joint.
    Request(Request),
    /// Draw only.
    Redraw,
}

/// State of the controls.
#[derive(Debug)]
pub struct Controls {
    /// True if the monitor sends nothing.
    pub listen: bool,
    /// Frozen view.
    pub held: Option<View>,
    /// True while the help is shown.
    pub help: bool,
    /// True while arming awaits confirmation.
    pub confirm: bool,
    /// Number of lines that the log is scrolled back.
    pub scroll: usize,
    /// Hint, shown until the next key.
    pub hint: Option<&'static str>,
    window: usize,
}

impl Controls {
    /// Creates the initial controls, with charts of ten seconds.
    pub fn new(listen: bool) -> Self {
        let (held, hint) = (None, None);
        Self { listen, held, help: false, confirm: false, scroll: 0, hint, window: 3 }
    }

    /// Returns the duration of the charts, s.
    pub fn window_s(&self) -> f64 {
        CHART_DURATIONS_S[self.window.min(CHART_DURATIONS_S.len() - 1)]
    }

    /// Processes a key.
    pub fn press(&mut self, key: &KeyEvent) -> Option<Action> {
        if key.kind == KeyEventKind::Release {
            return None;
        }
        self.hint = None;
        let letter = match key.code {
            KeyCode::Char(letter) => letter.to_ascii_lowercase(),
            _ => '\0',
        };
        if key.modifiers.contains(KeyModifiers::CONTROL) {
            return (letter == 'c').then_some(Action::Quit);
        }
        if self.confirm {
            self.confirm = false;
            // Any other key cancels.
            if letter == 'y' {
                return Some(Action::Request(Request::Arm));
            }
            if !matches!(letter, 'd' | 'q') {
                self.hint = Some("not armed");
                return Some(Action::Redraw);
            }
        }
        if self.help && key.code == KeyCode::Esc {
            self.help = false;
            return Some(Action::Redraw);
        }
        match (key.code, letter) {
            (_, 'q') => return Some(Action::Quit),
            (_, ' ') => return Some(Action::Pause),
            (_, 'r') => {
                self.hint = Some("min and max reset");
                return Some(Action::ResetRanges);
            }
            (_, 'd' | 'a' | 'c') if self.listen => {
                self.hint = Some("listening only: nothing is sent; start without --listen");
            }
            (_, 'd') => return Some(Action::Request(Request::Disarm)),
            (_, 'c') => return Some(Action::Request(Request::ClearFaults)),
            (_, 'a') => self.confirm = true,
            (_, '?' | 'h') => self.help = !self.help,
            (_, '+' | '=') => self.window = (self.window + 1).min(CHART_DURATIONS_S.len() - 1),
            (_, '-' | '_') => self.window = self.window.saturating_sub(1),
            (KeyCode::Up, _) => self.scroll += 1,
            (KeyCode::Down, _) => self.scroll = self.scroll.saturating_sub(1),
            (KeyCode::PageUp, _) => self.scroll += 10,
            (KeyCode::PageDown, _) => self.scroll = self.scroll.saturating_sub(10),
            (KeyCode::End, _) => self.scroll = 0,
            _ => return None,
        }
        Some(Action::Redraw)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn press(controls: &mut Controls, letter: char) -> Option<Action> {
        controls.press(&KeyEvent::new(KeyCode::Char(letter), KeyModifiers::NONE))
    }

    #[test]
    fn press_arm_requires_confirmation_and_disarm_does_not() {
        let mut keys = Controls::new(false);
        for no in ['n', 'a', ' ', 'c', 'x'] {
            assert_eq!(press(&mut keys, 'a'), Some(Action::Redraw));
            assert!(keys.confirm);
            assert_eq!(press(&mut keys, no), Some(Action::Redraw), "{no}");
            assert!(!keys.confirm && keys.hint == Some("not armed"));
        }
        assert_ne!(press(&mut keys, 'y'), Some(Action::Request(Request::Arm)));
        press(&mut keys, 'a');
        assert_eq!(press(&mut keys, 'y'), Some(Action::Request(Request::Arm)));
        assert_eq!(press(&mut keys, 'd'), Some(Action::Request(Request::Disarm)));
        press(&mut keys, 'a');
        assert_eq!(press(&mut keys, 'd'), Some(Action::Request(Request::Disarm)));
        assert!(!keys.confirm);
        assert_eq!(press(&mut keys, 'c'), Some(Action::Request(Request::ClearFaults)));
    }

    #[test]
    fn press_while_listening_sends_no_request() {
        let mut keys = Controls::new(true);
        for letter in ['a', 'y', 'd', 'c'] {
            assert!(!matches!(press(&mut keys, letter), Some(Action::Request(_))), "{letter}");
            assert!(!keys.confirm);
        }
        press(&mut keys, 'd');
        assert!(keys.hint.is_some_and(|hint| hint.contains("--listen")));
    }

    #[test]
    fn press_beyond_durations_stays_and_control_c_quits() {
        let mut keys = Controls::new(false);
        for _ in 0..20 {
            press(&mut keys, '+');
        }
        assert_eq!(keys.window_s(), 600.0);
        for _ in 0..20 {
            press(&mut keys, '-');
        }
        assert_eq!(keys.window_s(), 1.0);
        let control_c = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        assert_eq!(keys.press(&control_c), Some(Action::Quit));
        assert_eq!(press(&mut keys, 'q'), Some(Action::Quit));
    }
}
