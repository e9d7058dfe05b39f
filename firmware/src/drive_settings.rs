//! Settings of the CiA 402 drive that are stored: reactions to a stop, ramps, limits.
//!
//! Each setting is an object of the dictionary. A master writes it, and `save` (1010h:1) stores it with the parameters.
//! A value out of range is refused when it is written. Units are those of the profile: 1e-6 rad, 1e-6 rad/s,
//! 1e-6 rad/s^2, ms.

use crate::node::dictionary::index;
use crate::setting_error::SettingError;
use compensator_core::parameters::Text;
use compensator_core::text;

macro_rules! drive_settings {
    ($(
        $(#[$doc:meta])*
        $INDEX:ident $sub_index:literal $field:ident: $kind:ident = $default:expr,
            $least:literal..=$most:literal $(except $gap:pat)?, $text:literal;
    )*) => {
        /// Settings of the drive.
        #[derive(Clone, Copy, Debug)]
        pub struct DriveSettings {
            $($(#[$doc])* pub $field: $kind,)*
        }

        impl Default for DriveSettings {
            fn default() -> Self {
                // Copied from flash, because a store for each field takes more.
                static DEFAULTS: DriveSettings = DriveSettings { $($field: $default,)* };
                DEFAULTS
            }
        }

        impl DriveSettings {
            /// Objects of the settings, in the order of their storage: index and sub-index.
            pub const PLACES: [(u16, u8); [$($sub_index as u8),*].len()] =
                [$((index::$INDEX, $sub_index)),*];

            /// Names of the settings and their legal values, as refusals contain them.
            pub const TEXTS: [[Text; 2]; Self::PLACES.len()] =
                [$([text!(stringify!($field)), text!($text)]),*];

            /// Names of the settings, in the order of [`Self::PLACES`].
            pub const NAMES: [&str; Self::PLACES.len()] = [$(stringify!($field)),*];

            /// Returns true if an object is a setting with a sign.
            pub fn is_signed(at_index: u16, sub_index: u8) -> bool {
                match (at_index, sub_index) {
                    $((index::$INDEX, $sub_index) => $kind::MIN != 0,)*
                    _ => false,
                }
            }

            /// Returns the values, in the order of [`Self::PLACES`].
            // As words and out of line, because a comparison or a branch for each setting takes more flash.
            #[inline(never)]
            pub fn to_words(self) -> Words {
                [$(self.$field as u32),*]
            }

            /// Creates the settings from their values; `None` if one is out of range.
            #[inline(never)]
            fn from_words(words: &Words) -> Option<Self> {
                let [$($field),*] = *words;
                let settings = Self { $($field: $field as $kind),* };
                settings.is_legal().then_some(settings)
            }

            fn is_legal(&self) -> bool {
                // A range with a sign begins below 0.
                static RANGES: [(i32, u32); DriveSettings::PLACES.len()] = [$(($least, $most as i64 as u32)),*];
                let is_within = |(word, (least, most)): (u32, &(i32, u32))| match *least {
                    0.. => (*least as u32..=*most).contains(&word),
                    _ => (*least..=*most as i32).contains(&(word as i32)),
                };
                let is_in_gap = false $($(|| matches!(self.$field, $gap))?)*;
                !is_in_gap && self.to_words().into_iter().zip(&RANGES).all(is_within)
            }
        }
    };
}

drive_settings! {
    /// 2030h:1: output of the holding brake: 0 none, 1 a high level releases it, 2 a low level releases it.
    HOLDING_BRAKE 1 brake_output: u8 = 0, 0..=2, "0 (none), 1 (high releases) or 2 (low releases)";
    /// 2030h:2: time until the brake is open, ms.
    HOLDING_BRAKE 2 brake_release_ms: u16 = 100, 0..=5000, "0 to 5000";
    /// 2030h:3: time until the brake is closed, ms.
    HOLDING_BRAKE 3 brake_engage_ms: u16 = 100, 0..=5000, "0 to 5000";
    /// 2030h:4: if the bridge opens in motion, the brake engages: 0 at standstill, 1 at once.
    HOLDING_BRAKE 4 brake_engage_at: u8 = 0, 0..=1, "0 (standstill) or 1 (at once)";
    /// 2030h:5: longest wait for standstill, ms.
    HOLDING_BRAKE 5 brake_longest_wait_ms: u16 = 1000, 0..=60000, "0 to 60000";
    /// 6007h: what the loss of the connection does: 1 the fault reaction (605Eh), 2 opens the bridge, 3 the quick stop
    /// (605Ah). It raises its fault in any case.
    ABORT_CONNECTION 0 abort_connection: i16 = 1, 1..=3, "1 (605Eh), 2 (disable voltage) or 3 (605Ah)";
    /// 605Ah: see [`crate::driver::profile::stop`].
    QUICK_STOP_OPTION 0 quick_stop_option: i16 = 0, -1..=6 except 3 | 4, "-1, 0, 1, 2, 5 or 6";
    /// 605Bh.
    SHUTDOWN_OPTION 0 shutdown_option: i16 = 0, -1..=1, "-1, 0 or 1";
    /// 605Ch.
    DISABLE_OPTION 0 disable_option: i16 = 0, -1..=1, "-1, 0 or 1";
    /// 605Dh.
    HALT_OPTION 0 halt_option: i16 = 1, 1..=2, "1 or 2";
    /// 605Eh.
    FAULT_OPTION 0 fault_option: i16 = 0, -1..=2, "-1, 0, 1 or 2";
    /// 6065h: largest following error, 1e-6 rad; FFFFFFFFh disables its check.
    FOLLOWING_WINDOW 0 following_window: u32 = u32::MAX, 0..=0xFFFF_FFFF, "";
    /// 6066h: time for which the following error must exceed its window, ms.
    FOLLOWING_TIME 0 following_time_ms: u16 = 0, 0..=0xFFFF, "";
    /// 6067h: distance from the target within which it is reached, 1e-6 rad.
    POSITION_WINDOW 0 position_window: u32 = 2_000, 0..=0xFFFF_FFFF, "";
    /// 6068h: time for which the joint must be within the window, ms.
    POSITION_TIME 0 position_time_ms: u16 = 10, 0..=0xFFFF, "";
    /// 607Dh:1: smallest position, 1e-6 rad. If it is not below the largest one, there are no limits.
    POSITION_LIMITS 1 position_min: i32 = 0, -0x8000_0000..=0x7FFF_FFFF, "";
    /// 607Dh:2: largest position, 1e-6 rad.
    POSITION_LIMITS 2 position_max: i32 = 0, -0x8000_0000..=0x7FFF_FFFF, "";
    /// 6081h: speed of a move in mode 1, 1e-6 rad/s.
    PROFILE_VELOCITY 0 profile_velocity: u32 = 1_000_000, 100..=0xFFFF_FFFF, "at least 100 (1e-4 rad/s)";
    /// 6083h: acceleration of a move in mode 1, 1e-6 rad/s^2.
    ACCELERATION 0 acceleration: u32 = 10_000_000, 10_000..=0xFFFF_FFFF, "at least 10000 (0.01 rad/s^2)";
    /// 6084h: deceleration of the slow-down ramp, 1e-6 rad/s^2. The reference joint stops from its maximum speed in 1.2 s.
    DECELERATION 0 deceleration: u32 = 10_000_000, 10_000..=0xFFFF_FFFF, "at least 10000 (0.01 rad/s^2)";
    /// 6085h: deceleration of the quick-stop ramp, 1e-6 rad/s^2.
    QUICK_DECELERATION 0 quick_deceleration: u32 = 50_000_000, 10_000..=0xFFFF_FFFF, "at least 10000 (0.01 rad/s^2)";
    /// 6099h:1: speed towards the stop in homing, 1e-6 rad/s.
    HOMING_SPEEDS 1 homing_speed: u32 = 200_000, 10_000..=2_000_000, "10000 to 2000000 (0.01 to 2 rad/s)";
    /// 6099h:2: speed from the stop to position 0, 1e-6 rad/s.
    HOMING_SPEEDS 2 homing_return_speed: u32 = 200_000, 10_000..=2_000_000, "10000 to 2000000 (0.01 to 2 rad/s)";
    /// 609Ah: acceleration of homing, 1e-6 rad/s^2.
    HOMING_ACCELERATION 0 homing_acceleration: u32 = 5_000_000, 10_000..=0xFFFF_FFFF, "at least 10000 (0.01 rad/s^2)";
    /// 2031h:1: torque at which a joint that stands has met its stop, thousandths of the rated torque.
    HOMING_STOP 1 homing_torque: u16 = 150, 10..=1000, "10 to 1000 thousandths of the rated torque";
    /// 2031h:2: time for which it must stand, ms.
    HOMING_STOP 2 homing_time_ms: u16 = 100, 20..=1000, "20 to 1000";
    /// 2031h:3: largest way to the stop, 1e-6 rad.
    HOMING_STOP 3 homing_way: u32 = 6_300_000, 0..=0xFFFF_FFFF, "";
    /// 60C2h:1: time between two targets in mode 8, in units of 60C2h:2.
    INTERPOLATION_TIME 1 interpolation_period: u8 = 1, 1..=100, "1 to 100";
    /// 60C2h:2: exponent of ten of its unit, s.
    INTERPOLATION_TIME 2 interpolation_index: i8 = -3, -3..=-2, "-3 (ms) or -2 (10 ms)";
    /// 60FBh:1: gain of the position loop, 1e-3 1/s. It must be below half of the crossover of the velocity loop, rad/s.
    POSITION_LOOP 1 position_gain: u32 = 10_000, 100..=200_000, "100 to 200000 (0.1 to 200 per s)";
    /// 2044h:1: adaptation of the friction levels: 0 off, 1 on, 2 hold, 3 on with gains above 1 in torque modes.
    ADAPTATION 1 adapt: u8 = 0, 0..=3, "0 (off), 1 (on), 2 (hold) or 3 (on in every mode)";
    /// 2044h:2: least learnt gain, thousandths.
    ADAPTATION 2 adapt_least_permille: u16 = 400, 50..=1000, "50 to 1000";
    /// 2044h:3: largest learnt gain, thousandths.
    ADAPTATION 3 adapt_most_permille: u16 = 2500, 1000..=10000, "1000 to 10000";
    /// 2044h:4: memory of the learning, s of sliding.
    ADAPTATION 4 adapt_memory_s: u16 = 10, 1..=10000, "1 to 10000";
    /// 606Dh: difference to 60FFh within which mode 3 has reached it, 1e-6 rad/s.
    VELOCITY_WINDOW 0 velocity_window: u16 = 50_000, 0..=0xFFFF, "";
    /// 606Eh: time for which the velocity must be within its window, ms.
    VELOCITY_TIME 0 velocity_time_ms: u16 = 10, 0..=0xFFFF, "";
    /// 606Fh: speed below which a joint in mode 3 stands, 1e-6 rad/s.
    VELOCITY_THRESHOLD 0 velocity_threshold: u16 = 20_000, 0..=0xFFFF, "";
    /// 6070h: time for which the speed must be below its threshold, ms.
    THRESHOLD_TIME 0 threshold_time_ms: u16 = 10, 0..=0xFFFF, "";
    /// 607Fh: largest speed in the modes 1 and 3, 1e-6 rad/s.
    MAX_PROFILE_VELOCITY 0 max_profile_velocity: u32 = u32::MAX, 0..=0xFFFF_FFFF, "";
    /// 6086h: shape of the velocity in the modes 1 and 3.
    MOTION_PROFILE 0 motion_profile: i16 = 0, 0..=0, "0 (linear ramps): the driver has no other profile";
    /// 6087h: slope of the torque in mode 4, thousandths of the rated torque per second.
    TORQUE_SLOPE 0 torque_slope: u32 = 1000, 1..=0xFFFF_FFFF, "at least 1";
    /// 6088h: shape of the torque in mode 4.
    TORQUE_PROFILE 0 torque_profile: i16 = 0, 0..=0, "0 (linear ramps): the driver has no other profile";
    /// 2030h:7: torque of the brake test, thousandths of the rated torque; 0 disables the test.
    HOLDING_BRAKE 7 brake_test_torque: u16 = 0, 0..=1000 except 1..=9, "0 (no test) or 10 to 1000 thousandths of the rated torque";
    /// 2030h:8: time for which the test presses in each direction, ms.
    HOLDING_BRAKE 8 brake_test_ms: u16 = 200, 50..=5000, "50 to 5000";
    /// 2030h:9: way that the joint may turn in the test, 1e-6 rad.
    HOLDING_BRAKE 9 brake_test_way: u32 = 20_000, 1_000..=200_000, "1000 to 200000 (0.001 to 0.2 rad)";
    /// 2030h:10: operating hours after which arming tests the brake again; 0 tests on request only.
    HOLDING_BRAKE 10 brake_test_interval_h: u16 = 24, 0..=0xFFFF, "";
}

/// Values of the settings; those with a sign in two's complement.
pub type Words = [u32; DriveSettings::PLACES.len()];

impl PartialEq for DriveSettings {
    fn eq(&self, other: &Self) -> bool {
        self.to_words() == other.to_words()
    }
}

impl Eq for DriveSettings {}

impl DriveSettings {
    /// Returns the position of an object in [`Self::PLACES`]; `None` if it is no setting.
    #[inline(never)]
    fn position(at_index: u16, sub_index: u8) -> Option<usize> {
        static PLACES: [(u16, u8); DriveSettings::PLACES.len()] = DriveSettings::PLACES;
        PLACES.iter().position(|place| *place == (at_index, sub_index))
    }

    /// Returns the value of an object as a word; `None` if the object is no setting.
    pub fn get(&self, at_index: u16, sub_index: u8) -> Option<u32> {
        self.to_words().get(Self::position(at_index, sub_index)?).copied()
    }

    /// Sets the value of an object; `None` if the object is no setting.
    ///
    /// # Errors
    /// The value is out of range.
    pub fn set(
        &mut self,
        at_index: u16,
        sub_index: u8,
        word: u32,
    ) -> Option<Result<(), SettingError>> {
        static TEXTS: [[Text; 2]; DriveSettings::PLACES.len()] = DriveSettings::TEXTS;
        let position = Self::position(at_index, sub_index)?;
        let mut words = self.to_words();
        *words.get_mut(position)? = word;
        // The other values are in their ranges already.
        if let Some(changed) = Self::from_words(&words) {
            *self = changed;
            return Some(Ok(()));
        }
        let [name, legal] = TEXTS.get(position).copied()?;
        Some(Err(SettingError { name, legal }))
    }

    /// Returns the time between two targets in mode 8, ms.
    pub const fn interpolation_ms(&self) -> u32 {
        let unit_ms = if self.interpolation_index == -3 { 1 } else { 10 };
        self.interpolation_period as u32 * unit_ms
    }

    /// Length of the encoded settings, bytes.
    pub const LENGTH: usize = 4 * Self::PLACES.len();

    /// Length of the encoded settings before profile modes and brake test had any, bytes.
    pub const LENGTH_WITHOUT_PROFILES: usize = Self::LENGTH - 12 * 4;

    /// Length of the encoded settings before the adaptation had any, bytes.
    pub const LENGTH_WITHOUT_ADAPTATION: usize = Self::LENGTH_WITHOUT_PROFILES - 4 * 4;

    /// Parses settings; `None` if a value is out of range. Settings that are not in the bytes have their defaults.
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        let mut words = Self::default().to_words();
        for (word, bytes) in words.iter_mut().zip(bytes.as_chunks::<4>().0) {
            *word = u32::from_le_bytes(*bytes);
        }
        Self::from_words(&words)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::dictionary;

    #[test]
    fn parse_of_emitted_settings_returns_them_and_refuses_illegal_values() {
        let settings = DriveSettings {
            quick_stop_option: -1,
            fault_option: 2,
            quick_deceleration: u32::MAX,
            ..DriveSettings::default()
        };
        let mut bytes: Vec<u8> = settings.to_words().map(u32::to_le_bytes).concat();
        assert_eq!(DriveSettings::parse(&bytes), Some(settings));
        let place = (index::QUICK_STOP_OPTION, 0);
        let place =
            DriveSettings::PLACES.iter().position(|known| *known == place).expect("a setting");
        bytes[4 * place..4 * place + 4].copy_from_slice(&[3, 0, 0, 0]);
        assert_eq!(DriveSettings::parse(&bytes), None, "605Ah = 3");
    }

    #[test]
    fn every_setting_is_a_writable_object() {
        for (index, sub_index) in DriveSettings::PLACES {
            let entry = dictionary::find(index, sub_index).expect("an object");
            assert_eq!(entry.access, dictionary::Access::ReadWrite, "{index:04X}");
        }
    }

    #[test]
    fn set_with_illegal_value_names_the_setting_and_changes_nothing() {
        let mut settings = DriveSettings::default();
        for (index, word) in [
            (index::QUICK_STOP_OPTION, 3),
            (index::FAULT_OPTION, u32::from(-2i16 as u16)),
            (index::ABORT_CONNECTION, 0),
            (index::DECELERATION, 0),
        ] {
            let refused = settings.set(index, 0, word).expect("a setting");
            assert!(refused.is_err(), "{index:04X}");
            assert_eq!(settings, DriveSettings::default());
        }
        assert_eq!(settings.set(index::CONTROLWORD, 0, 0), None);
    }
}
