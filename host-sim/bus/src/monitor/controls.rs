//! What the keys do: pure, so that a test can press them.

use super::sdo_poller::Request;
use super::view_data::View;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

/// Windows of the charts, s.
pub const WINDOWS_S: [f64; 9] = [1.0, 2.0, 5.0, 10.0, 20.0, 60.0, 120.0, 300.0, 600.0];

/// What a key asks of whoever runs the monitor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// End.
    Quit,
    /// Hold the screen, or let it go.
    Pause,
    /// Begin least and most anew.
    ForgetRanges,
    /// Ask the joint for this.
    Request(Request),
    /// Nothing but to draw.
    Redraw,
}

/// How the screen stands.
#[derive(Debug)]
pub struct Controls {
    /// Nothing is ever sent.
    pub listen: bool,
    /// The screen as it was when it was held.
    pub held: Option<View>,
    /// The keys are shown.
    pub help: bool,
    /// Arming waits for a yes.
    pub confirm: bool,
    /// Lines the log is scrolled back.
    pub scroll: usize,
    /// Something to be told until the next key.
    pub hint: Option<&'static str>,
    window: usize,
}

impl Controls {
    /// As at the start: ten seconds.
    pub fn new(listen: bool) -> Self {
        let (held, hint) = (None, None);
        Self { listen, held, help: false, confirm: false, scroll: 0, hint, window: 3 }
    }

    /// How far back charts go, s.
    pub fn window_s(&self) -> f64 {
        WINDOWS_S[self.window.min(WINDOWS_S.len() - 1)]
    }

    /// A key was pressed.
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
            // Anything but a yes is a no.
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
                self.hint = Some("min and max begin anew");
                return Some(Action::ForgetRanges);
            }
            (_, 'd' | 'a' | 'c') if self.listen => {
                self.hint = Some("listening only: nothing is sent; start without --listen");
            }
            (_, 'd') => return Some(Action::Request(Request::Disarm)),
            (_, 'c') => return Some(Action::Request(Request::ClearFaults)),
            (_, 'a') => self.confirm = true,
            (_, '?' | 'h') => self.help = !self.help,
            (_, '+' | '=') => self.window = (self.window + 1).min(WINDOWS_S.len() - 1),
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
    fn arming_takes_a_yes_and_disarming_none() {
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
    fn who_listens_asks_for_nothing() {
        let mut keys = Controls::new(true);
        for letter in ['a', 'y', 'd', 'c'] {
            assert!(!matches!(press(&mut keys, letter), Some(Action::Request(_))), "{letter}");
            assert!(!keys.confirm);
        }
        press(&mut keys, 'd');
        assert!(keys.hint.is_some_and(|hint| hint.contains("--listen")));
    }

    #[test]
    fn windows_have_ends_and_control_c_quits() {
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
