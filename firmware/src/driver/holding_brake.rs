//! The holding brake of a joint: when its output releases it, and when the motor must hold the joint meanwhile.
//!
//! ```text
//! bridge drives -> output releases -> release delay -> motion is permitted
//! joint stands  -> output engages  -> engage delay  -> the bridge may open
//! ```
//! In both delays the motor holds the joint, because the brake is not yet open, or not yet closed. If the bridge opens
//! while the joint moves, the brake engages at once, or waits for standstill: a brake that is only made to hold wears or
//! slips when it stops a moving joint. It does not wait if the bridge has a fault and cannot brake the joint, if the joint
//! gets faster, if its speed is unknown, or longer than the longest wait: such a load falls.
//!
//! The brake closes without power. A processor without firmware does not drive the output, and a resistor on the
//! board keeps the brake closed then.

use crate::drive_settings::DriveSettings;
use crate::driver::profile::STANDSTILL_RAD_S;

/// What the brake reacts to.
#[derive(Clone, Copy, Debug)]
pub struct BrakeInputs {
    /// The bridge drives, so that the motor can hold the joint.
    pub is_driven: bool,
    /// The driver wants the brake closed although the bridge drives.
    pub wants_closed: bool,
    /// The bridge has no fault, so that its low sides can brake the motor.
    pub is_bridge_sound: bool,
    /// Speed, rad/s; `None` if it is unknown.
    pub speed_rad_s: Option<f32>,
    /// Time, us.
    pub now_us: u64,
}

/// A bridge that does not drive.
#[derive(Clone, Copy, Debug)]
struct OpenBridge {
    /// Time since which it is open, us.
    since_us: u64,
    /// Lowest speed since then, rad/s; NaN if it was never known.
    lowest_rad_s: f32,
}

/// State of the brake.
#[derive(Clone, Copy, Debug, Default)]
pub struct HoldingBrake {
    is_released: bool,
    /// Time of the last change of the output, us.
    changed_us: u64,
    /// `None` while the bridge drives.
    open: Option<OpenBridge>,
}

impl HoldingBrake {
    /// Runs a step, once per tick.
    // Not inlined: from its own part, it reaches the fields by short offsets.
    #[inline(never)]
    pub fn step(&mut self, settings: &DriveSettings, inputs: &BrakeInputs) {
        let BrakeInputs { is_driven, wants_closed, is_bridge_sound, speed_rad_s, now_us } = *inputs;
        let is_released = if is_driven {
            self.open = None;
            !wants_closed
        } else {
            // An unknown speed is none that decreases.
            let speed_rad_s = speed_rad_s.unwrap_or(f32::NAN);
            let begun = OpenBridge { since_us: now_us, lowest_rad_s: speed_rad_s };
            let OpenBridge { since_us, lowest_rad_s } = self.open.unwrap_or(begun);
            self.open = Some(OpenBridge { since_us, lowest_rad_s: lowest_rad_s.min(speed_rad_s) });
            let longest_us = 1000 * u64::from(settings.brake_longest_wait_ms);
            let slows_down =
                speed_rad_s > STANDSTILL_RAD_S && speed_rad_s <= lowest_rad_s + STANDSTILL_RAD_S;
            let waits = settings.brake_engage_at == 0 && is_bridge_sound && slows_down;
            self.is_released && waits && now_us - since_us < longest_us
        };
        if is_released != self.is_released {
            (self.is_released, self.changed_us) = (is_released, now_us);
        }
    }

    /// Returns true if the output releases the brake.
    pub const fn is_released(&self) -> bool {
        self.is_released
    }

    /// Returns the level of the output; `None` if the joint has no brake: the output is not driven.
    pub const fn output(&self, settings: &DriveSettings) -> Option<bool> {
        match settings.brake_output {
            0 => None,
            1 => Some(self.is_released),
            _ => Some(!self.is_released),
        }
    }

    /// Returns true if the brake is open, or if there is none: the joint may move.
    pub fn is_open(&self, settings: &DriveSettings, now_us: u64) -> bool {
        let delay_us = 1000 * u64::from(settings.brake_release_ms);
        settings.brake_output == 0 || self.is_released && now_us - self.changed_us >= delay_us
    }

    /// Returns true if the brake is closed, or if there is none: the torque may end.
    pub fn is_closed(&self, settings: &DriveSettings, now_us: u64) -> bool {
        let delay_us = 1000 * u64::from(settings.brake_engage_ms);
        settings.brake_output == 0 || !self.is_released && now_us - self.changed_us >= delay_us
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings() -> DriveSettings {
        DriveSettings {
            brake_output: 1,
            brake_release_ms: 60,
            brake_engage_ms: 50,
            brake_longest_wait_ms: 1000,
            ..DriveSettings::default()
        }
    }

    /// Runs a brake until this time, ms, from the time before.
    fn run(
        brake: &mut HoldingBrake,
        settings: &DriveSettings,
        ms: std::ops::Range<u64>,
        inputs: BrakeInputs,
    ) {
        for now_us in ms.map(|ms| 1000 * ms) {
            brake.step(settings, &BrakeInputs { now_us, ..inputs });
        }
    }

    const OPEN_BRIDGE: BrakeInputs = BrakeInputs {
        is_driven: false,
        wants_closed: false,
        is_bridge_sound: true,
        speed_rad_s: Some(0.0),
        now_us: 0,
    };
    const DRIVEN: BrakeInputs = BrakeInputs { is_driven: true, ..OPEN_BRIDGE };

    #[test]
    fn brake_permits_motion_and_ends_torque_after_its_delays() {
        let (settings, mut brake) = (settings(), HoldingBrake::default());
        run(&mut brake, &settings, 0..100, OPEN_BRIDGE);
        assert!(!brake.is_released() && brake.is_closed(&settings, 100_000));
        run(&mut brake, &settings, 100..150, DRIVEN);
        assert!(brake.is_released() && !brake.is_open(&settings, 149_000));
        assert!(brake.is_open(&settings, 160_000));
        run(&mut brake, &settings, 200..210, BrakeInputs { wants_closed: true, ..DRIVEN });
        assert!(!brake.is_released() && !brake.is_closed(&settings, 249_000));
        assert!(brake.is_closed(&settings, 250_000));
    }

    #[test]
    fn brake_of_an_open_bridge_waits_for_standstill_at_most_for_the_longest_wait() {
        let moving = BrakeInputs { speed_rad_s: Some(2.0), ..OPEN_BRIDGE };
        let released = |settings: &DriveSettings| {
            let mut brake = HoldingBrake::default();
            run(&mut brake, settings, 0..10, DRIVEN);
            brake
        };
        let mut brake = released(&settings());
        run(&mut brake, &settings(), 10..1009, moving);
        assert!(brake.is_released());
        run(&mut brake, &settings(), 1009..1012, moving);
        assert!(!brake.is_released(), "the longest wait is over");
        let mut brake = released(&settings());
        run(&mut brake, &settings(), 10..11, OPEN_BRIDGE);
        assert!(!brake.is_released(), "it stands");
        let mut brake = released(&settings());
        run(&mut brake, &settings(), 10..11, BrakeInputs { speed_rad_s: None, ..moving });
        assert!(!brake.is_released(), "its speed is unknown");
        let mut brake = released(&settings());
        run(&mut brake, &settings(), 10..11, BrakeInputs { is_bridge_sound: false, ..moving });
        assert!(!brake.is_released(), "its bridge cannot brake it");
        let mut brake = released(&settings());
        for (ms, speed) in [(10, 2.0), (11, 1.5), (12, 1.55), (13, 1.4)] {
            let speed_rad_s = Some(speed);
            run(&mut brake, &settings(), ms..ms + 1, BrakeInputs { speed_rad_s, ..moving });
            assert!(brake.is_released(), "it slows down, with the noise of its speed");
        }
        run(&mut brake, &settings(), 14..15, BrakeInputs { speed_rad_s: Some(1.51), ..moving });
        assert!(!brake.is_released(), "it gets faster");
        let at_once = DriveSettings { brake_engage_at: 1, ..settings() };
        let mut brake = released(&at_once);
        run(&mut brake, &at_once, 10..11, moving);
        assert!(!brake.is_released());
    }

    #[test]
    fn output_follows_the_polarity_and_is_not_driven_without_a_brake() {
        let mut brake = HoldingBrake::default();
        let of = |brake_output| DriveSettings { brake_output, ..settings() };
        assert_eq!([0, 1, 2].map(|of_| brake.output(&of(of_))), [None, Some(false), Some(true)]);
        run(&mut brake, &settings(), 0..1, DRIVEN);
        assert_eq!([0, 1, 2].map(|of_| brake.output(&of(of_))), [None, Some(true), Some(false)]);
        assert!(HoldingBrake::default().is_open(&of(0), 0) && brake.is_closed(&of(0), 0));
    }
}
