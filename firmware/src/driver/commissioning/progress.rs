//! Steps of a run and reasons for its end: their numbers on the bus and their names.

/// Step of a run, by its number on the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd)]
#[repr(u8)]
pub enum CommissioningStep {
    /// Not started.
    #[default]
    Idle = 0,
    /// Offsets of the current sensors.
    Offsets = 1,
    /// Half the current along a field at rest.
    HalfCurrent = 2,
    /// Full current along a field at rest.
    FullCurrent = 3,
    /// Inductance along the field.
    InductanceAlong = 4,
    /// Inductance across the field.
    InductanceAcross = 5,
    /// The field turns slowly, in the phase sequence a, b, c.
    SlowForward = 6,
    /// The field turns slowly in the opposite direction.
    SlowBack = 7,
    /// The field turns fast, in the phase sequence a, b, c.
    FastForward = 8,
    /// The field turns fast in the opposite direction.
    FastBack = 9,
    /// The current is reduced to 0.
    Down = 10,
    /// Completed.
    Done = 11,
    /// Aborted: see [`AbortReason`].
    Aborted = 12,
    /// Friction run: the joint moves back and forth.
    Rubbing = 13,
}

macro_rules! reasons {
    ($($number:literal $reason:ident $name:literal $words:literal;)*) => {
        /// Reason why a run ended early.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        #[repr(u8)]
        pub enum AbortReason {
            /// It did not end early.
            #[default]
            None = 0,
            $(#[doc = $words] $reason = $number,)*
        }

        impl AbortReason {
            /// Returns name and meaning of a reason by its number.
            pub fn describe(number: u8) -> Option<(&'static str, &'static str)> {
                match number {
                    $($number => Some(($name, $words)),)*
                    _ => None,
                }
            }
        }
    };
}

reasons! {
    1 Stopped "stopped" "a stop was commanded, or the joint was disarmed";
    2 Fault "fault" "the supervisor stopped it: see the faults";
    3 NoAnswer "no-answer" "the current loop gives no measurement: the bridge does not close";
    4 NoCurrent "no-current" "no current flows at a quarter of the bus voltage: a phase is open, or the commanded current is too high for this voltage";
    5 Overcurrent "overcurrent" "the current exceeded 1.5 times the commanded current";
    6 NotAlong "current-not-along-voltage" "the current does not point where the voltage does: a phase is open, or shunts and phases are not in the same order";
    7 RotorStands "rotor-does-not-follow" "the encoder does not turn with the field: the joint is held, the current is too low, or the encoder is on another shaft";
    8 PolePairsUnclear "pole-pairs-unclear" "the turns of the field per encoder turn are not a whole number: the rotor slips";
    9 LagTooGreat "lag-too-great" "friction holds the rotor more than 60 degrees behind the field: more current is needed";
    10 Travel "travel" "the joint would leave its permitted travel";
    11 InductanceUnclear "inductance-unclear" "the current response to the square wave is too small";
    12 Time "time" "it took longer than a minute";
    13 OutOfRange "out-of-range" "a measured value is outside the range of its parameter";
    14 TooFast "too-fast" "the joint moved faster than 1.5 times the commanded speed";
    15 JointHeld "joint-held" "the joint does not follow its speed at the permitted current: it is held or at a stop, or the current is too low";
}
