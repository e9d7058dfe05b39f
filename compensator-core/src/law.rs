//! The friction laws, each once.
//!
//! Static laws ([`steady`]) give a torque for a velocity. Bristle laws ([`bristle`]) carry a state,
//! the torque `y = sigma0 z` held by the bent bristles, and so know presliding, hysteresis and
//! stick-slip. All see load, pressure and the extension terms through [`crate::effect::Effect`].
//!
//! | law | torque | source |
//! |---|---|---|
//! | linear | `F_C sgn v + sigma2 v` | the manipulator paper, eq. 2-4 |
//! | extended | `F_C sgn v + sigma2 v + f1 v abs(v) + f2 v^3` | the manipulator paper, eq. 5 (printed `f1 v sgn v`: an option) |
//! | atan | `f0 + F_C sgn v + sigma2 v + fa atan(fb v)` | the manipulator paper, eq. 6 |
//! | stribeck | `g(v) sgn v + sigma2 v` | steady LuGre |
//! | dahl | bristles with `F_S = F_C`, `sigma1 = 0` | Dahl 1968 |
//! | lugre | bristles | Ding et al., eq. 1; the damper paper, eq. 12-13 |
//! | lugre-asymmetric | bristles, levels by the sign of the held torque | the damper paper, eq. 4 |
//! | improved-lugre | bristles under side load and pressure | Ding et al., eq. 16 |
//!
//! Each law is one file, which answers the questions of `interface`: its parameters, what it is built of, what
//! it remembers, its step, and the products a fixed-point number must hold. To add one: its file, its row in
//! the table below, and rows for its parameters at the end of [`crate::parameter`].

mod atan;
pub mod bristle;
mod dahl;
mod extended;
mod improved_lugre;
mod interface;
mod linear;
mod lugre;
mod lugre_asymmetric;
pub mod steady;
mod stribeck;
mod written;

pub use atan::Atan;
pub use dahl::Dahl;
pub use extended::Extended;
pub use improved_lugre::{ImprovedLugre, SealLoad};
pub use linear::Linear;
pub use lugre::Lugre;
pub use lugre_asymmetric::LugreAsymmetric;
pub use stribeck::Stribeck;

use crate::effect::{Effect, Effects, NoEffect};
use crate::number::Real;
use crate::parameter::ParameterId;
use crate::quantity::Sample;
use crate::refusal::ParameterError;
use crate::term::TermKind;
use ParameterId as Id;
use bristle::Bristles;
use interface::{FrictionLaw, Step};
pub(crate) use written::{Range, Written};

/// Choices about a law that are not numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Choices {
    /// Bristle damping fades along the Stribeck curve instead of staying constant; see
    /// [`ParameterId::BristleDamping`].
    pub damping_fades: bool,
    /// Take the extended law as the manipulator paper prints it.
    pub printed_extended: bool,
    /// Accept a law that can give out more energy than it takes in.
    pub allow_active: bool,
}

impl Choices {
    /// Their names in files, in the order of [`Choices::to_array`].
    pub const NAMES: [&str; 3] = ["damping_fades", "printed_extended", "allow_active"];

    /// The choices in the order of their names.
    pub const fn to_array(self) -> [bool; 3] {
        [self.damping_fades, self.printed_extended, self.allow_active]
    }

    /// The choices of [`Choices::to_array`].
    pub const fn from_array([damping_fades, printed_extended, allow_active]: [bool; 3]) -> Self {
        Self { damping_fades, printed_extended, allow_active }
    }
}

macro_rules! define_laws {
    ($($(#[$doc:meta])* $kind:ident = $number:literal, $name:literal in $file:ident $(, $tuned:ident)?;)*) => {
        /// The friction laws.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum LawKind { $($(#[$doc])* $kind = $number),* }

        impl LawKind {
            /// Every law, in the order of their numbers.
            pub const ALL: &'static [LawKind] = &by_number([$(LawKind::$kind),*]);

            /// The name used in model names and files.
            pub const fn name(self) -> &'static str {
                match self { $(LawKind::$kind => $name),* }
            }

            /// The parameters that belong to this law.
            #[inline(never)]
            pub const fn parameters(self) -> &'static [ParameterId] {
                match self {
                    $(LawKind::$kind => <$file::$kind<f64> as FrictionLaw<f64>>::PARAMETERS),*
                }
            }

            /// Whether side load and pressure already belong to the law.
            pub const fn has_seal_load(self) -> bool {
                match self {
                    $(LawKind::$kind => <$file::$kind<f64> as FrictionLaw<f64>>::HAS_SEAL_LOAD),*
                }
            }

            /// Refuses what the number `N` has no room for; see [`FrictionLaw::check`].
            pub(crate) fn check<N: Real, S: Real>(
                self,
                written: &Written<S>,
                range: &Range,
            ) -> Result<f64, ParameterError> {
                match self {
                    $(LawKind::$kind => $file::$kind::<f64>::check::<N, S>(written, range)),*
                }
            }
        }

        /// A built law.
        #[derive(Clone, Copy, Debug)]
        pub enum Law<T> { $($(#[$doc])* $kind($file::$kind<T>)),* }

        /// What laws remember besides the held torque.
        #[derive(Clone, Copy, Debug, Default)]
        pub(crate) struct Memory<T: Real> {
            $(pub(crate) $file: <$file::$kind<T> as FrictionLaw<T>>::Memory,)*
        }

        impl<T: Real> Law<T> {
            /// Builds a law for a sample period in s.
            pub(crate) fn build(
                kind: LawKind,
                written: &Written<T::Setting>,
                period_s: T::Setting,
            ) -> Self {
                match kind {
                    $(LawKind::$kind => Self::$kind(FrictionLaw::build(written, period_s))),*
                }
            }

            /// Becomes `of` for a sample period `ratio` times as long.
            pub(crate) fn rescale_period(&mut self, of: &Self, ratio: T) {
                match (self, of) {
                    $((Self::$kind(law), Self::$kind(of)) => law.rescale_period(of, ratio),)*
                    (law, of) => *law = *of,
                }
            }

            /// The speed velocity is limited to, rad/s.
            #[inline(always)]
            pub fn velocity_limit(&self) -> T {
                match self { $(Self::$kind(law) => law.velocity_limit()),* }
            }

            /// The held torque of a joint that slides fast, Nm; 0 of a law that holds none.
            pub fn sliding_torque(&self) -> T {
                match self { $(Self::$kind(law) => law.sliding_torque()),* }
            }

            /// One sample in a model without terms.
            #[inline(always)]
            pub(crate) fn step_alone(
                &self,
                held: &mut T,
                memory: &mut Memory<T>,
                sample: &Sample<T>,
            ) -> T {
                let step = match self {
                    $($(Self::$kind(law) => {
                        let $tuned = law.step_alone(held, &mut memory.$file, sample);
                        $tuned
                    })?)*
                    // A copy, so that the sample of the others stays in registers.
                    _ => return self.step_other(held, memory, &{ *sample }),
                };
                step.finish(held, sample.velocity_rad_s, &NoEffect)
            }

            /// The laws no joint driver is tuned for, out of line: the arc tangent's call alone would
            /// make the others save and restore registers on every step.
            #[cold]
            #[inline(never)]
            #[allow(unreachable_patterns)]
            fn step_other(&self, held: &mut T, memory: &mut Memory<T>, sample: &Sample<T>) -> T {
                let step = match self {
                    // These have been stepped where they were asked for.
                    $($(Self::$kind(_) => {
                        let $tuned = Step::Done(T::zero());
                        $tuned
                    })?)*
                    $(Self::$kind(law) => law.step_alone(held, &mut memory.$file, sample),)*
                };
                step.finish(held, sample.velocity_rad_s, &NoEffect)
            }

            /// One sample under effects.
            #[inline(always)]
            pub(crate) fn step<E: Effect<T>>(
                &self,
                held: &mut T,
                memory: &mut Memory<T>,
                velocity: T,
                effect: &E,
            ) -> T {
                let step = match self {
                    $(Self::$kind(law) => law.step(held, &mut memory.$file, velocity, effect)),*
                };
                step.finish(held, velocity, effect)
            }

            /// What the law's own load does in this sample, for terms to add to.
            #[inline(always)]
            pub(crate) fn load(&self, sample: &Sample<T>, effects: &mut Effects<T>) {
                match self { $(Self::$kind(law) => law.load(sample, effects)),* }
            }
        }
    };
}

// A row says what the law is, its kind (the name of its type as well), its number in records, which may never
// change, the name used in model names and files, and its file; and whether joint drivers are tuned for it, so
// that its step lies in the loop. The first is the one a step asks for first.
define_laws! {
    /// LuGre under side load and pressure.
    ImprovedLugre = 7, "improved-lugre" in improved_lugre, tuned;
    /// Bristles with the Stribeck curve.
    Lugre = 5, "lugre" in lugre, tuned;
    /// LuGre with levels of their own for each direction.
    LugreAsymmetric = 6, "lugre-asymmetric" in lugre_asymmetric;
    /// Bristles of one level, and a viscous part.
    Dahl = 4, "dahl" in dahl;
    /// With the Stribeck curve.
    Stribeck = 3, "stribeck" in stribeck;
    /// With an arc tangent and an offset.
    Atan = 2, "atan" in atan;
    /// With a quadratic and a cubic part.
    Extended = 1, "extended" in extended;
    /// Coulomb and viscous.
    Linear = 0, "linear" in linear;
}

/// The laws in the order of their numbers, which have no gap.
const fn by_number<const N: usize>(kinds: [LawKind; N]) -> [LawKind; N] {
    let mut sorted = kinds;
    let mut index = 0;
    while index < N {
        sorted[kinds[index] as usize] = kinds[index];
        index += 1;
    }
    sorted
}

impl LawKind {
    /// The law with this name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|kind| kind.name() == name)
    }

    /// The law with this number (its position in [`LawKind::ALL`]).
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL.get(usize::from(number)).copied()
    }

    /// Whether what this term does is part of the law already.
    pub fn includes(self, kind: TermKind) -> bool {
        kind.parameters().iter().all(|id| self.parameters().contains(id))
    }

    /// Whether the law carries a bristle state.
    pub fn has_bristles(self) -> bool {
        self.parameters().contains(&Id::BristleStiffness)
    }

    /// Whether the law's level falls along a Stribeck curve.
    pub fn has_stribeck_curve(self) -> bool {
        self.parameters().contains(&Id::StribeckVelocity)
    }
}

impl<T: Real> Law<T> {
    /// The bristles of a law that is nothing but bristles (dahl, lugre): whoever steps many models chooses
    /// the law once.
    pub fn plain_bristles(&self) -> Option<&Bristles<T>> {
        match self {
            Self::Lugre(Lugre(bristles)) | Self::Dahl(Dahl(bristles)) => Some(bristles),
            _ => None,
        }
    }
}
