//! How far a run is, and why it ended: numbers on the bus, and their names.

/// Where a run is, by its number on the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd)]
#[repr(u8)]
pub enum Step {
    /// Nothing was begun.
    #[default]
    Idle = 0,
    /// Offsets of the current sensors.
    Offsets = 1,
    /// Half the current along a field that stands.
    HalfCurrent = 2,
    /// All of it.
    FullCurrent = 3,
    /// Inductance along the field.
    InductanceAlong = 4,
    /// Inductance across it.
    InductanceAcross = 5,
    /// The field turns slowly, phases a, b, c following each other.
    SlowForward = 6,
    /// And back.
    SlowBack = 7,
    /// The same, faster.
    FastForward = 8,
    /// And back.
    FastBack = 9,
    /// The current goes down.
    Down = 10,
    /// All was found.
    Done = 11,
    /// It was ended: see [`Reason`].
    Aborted = 12,
    /// The joint moves to and fro, for its friction to be seen.
    Rubbing = 13,
}

macro_rules! reasons {
    ($($number:literal $reason:ident $name:literal $words:literal;)*) => {
        /// Why a run ended before its end.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        #[repr(u8)]
        pub enum Reason {
            /// It did not.
            #[default]
            None = 0,
            $(#[doc = $words] $reason = $number,)*
        }

        impl Reason {
            /// The reason of a number, its name and what it means.
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
    1 Stopped "stopped" "somebody ordered it to stop, or disarmed the joint";
    2 Fault "fault" "the supervisor stopped it: see the faults";
    3 NoAnswer "no-answer" "the current loop gives no measurement: the bridge does not close";
    4 NoCurrent "no-current" "no current comes at two fifths of the bus voltage: a phase is open, or the current asked for is too much for it";
    5 Overcurrent "overcurrent" "the current went beyond half as much again as was asked for";
    6 NotAlong "current-not-along-voltage" "the current does not point where the voltage does: a phase is open, or shunts and phases are not in the same order";
    7 RotorStands "rotor-does-not-follow" "the encoder does not turn with the field: the joint is held, the current too little, or the encoder is on another shaft";
    8 PolePairsUnclear "pole-pairs-unclear" "turns of the field in one of the encoder are no whole number: the rotor slips";
    9 LagTooGreat "lag-too-great" "friction holds the rotor more than 60 degrees behind the field: more current is needed";
    10 Travel "travel" "the joint would leave the range it was given";
    11 InductanceUnclear "inductance-unclear" "the square wave makes no current to measure by";
    12 Time "time" "it took longer than a minute";
    13 OutOfRange "out-of-range" "what was found is no motor: a value is outside the range of its parameter";
    14 TooFast "too-fast" "the joint moved faster than it was told to by half as much again";
    15 JointHeld "joint-held" "the joint does not follow its speed at the current it was given: it is held or at a stop, or the current is too little";
}
