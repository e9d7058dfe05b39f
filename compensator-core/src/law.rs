//! The friction laws.
//!
//! A static law ([`steady`]) computes a torque from the velocity. A bristle law ([`bristle`]) has a state: the
//! torque `y = sigma0 z` of the deflected bristles. It therefore models presliding, hysteresis and stick-slip.
//! Load, pressure and the extension terms act on every law through [`crate::effect::Effect`].
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
//! Each law is one file that implements the trait in `interface`: parameters, coefficients, memory, step, and
//! the products that a fixed-point number must represent. To add a law, add its file, its row in the table
//! below, and rows for its parameters at the end of [`crate::parameter`].

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
pub(crate) use written::{LawParameters, LawRange};

/// Options of a law that are not numeric parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Choices {
    /// Bristle damping decreases along the Stribeck curve instead of staying constant; see
    /// [`ParameterId::BristleDamping`].
    pub damping_fades: bool,
    /// Use the extended law exactly as printed in the manipulator paper, eq. 5.
    pub printed_extended: bool,
    /// Accept a law that is not passive, that is, one that can generate energy.
    pub allow_active: bool,
}

impl Choices {
    /// Names of the options in files, in the order of [`Choices::to_array`].
    pub const NAMES: [&str; 3] = ["damping_fades", "printed_extended", "allow_active"];

    /// Returns the options in the order of [`Choices::NAMES`].
    pub const fn to_array(self) -> [bool; 3] {
        [self.damping_fades, self.printed_extended, self.allow_active]
    }

    /// Creates the options from the array of [`Choices::to_array`].
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
            /// Every law, ordered by number.
            pub const ALL: &'static [LawKind] = &by_number([$(LawKind::$kind),*]);

            /// Returns the name used in model names and files.
            pub const fn name(self) -> &'static str {
                match self { $(LawKind::$kind => $name),* }
            }

            /// Returns the parameters of this law.
            #[inline(never)]
            pub const fn parameters(self) -> &'static [ParameterId] {
                match self {
                    $(LawKind::$kind => <$file::$kind<f32> as FrictionLaw<f32>>::PARAMETERS),*
                }
            }

            /// Returns true if the law itself models side load and pressure.
            pub const fn has_seal_load(self) -> bool {
                match self {
                    $(LawKind::$kind => <$file::$kind<f32> as FrictionLaw<f32>>::HAS_SEAL_LOAD),*
                }
            }

            /// Returns an error if the number type `N` cannot represent a product; see [`FrictionLaw::check`].
            pub(crate) fn check<N: Real, S: Real>(
                self,
                written: &LawParameters<S>,
                range: &LawRange,
            ) -> Result<f32, ParameterError> {
                match self {
                    $(LawKind::$kind => $file::$kind::<f32>::check::<N, S>(written, range)),*
                }
            }
        }

        /// A friction law built for one sample period.
        #[derive(Clone, Copy, Debug)]
        pub enum Law<T> { $($(#[$doc])* $kind($file::$kind<T>)),* }

        /// Memory of the laws between samples, apart from the bristle torque.
        #[derive(Clone, Copy, Debug, Default)]
        pub(crate) struct Memory<T: Real> {
            $(pub(crate) $file: <$file::$kind<T> as FrictionLaw<T>>::Memory,)*
        }

        impl<T: Real> Law<T> {
            /// Builds a law for a sample period in s.
            pub(crate) fn build(
                kind: LawKind,
                written: &LawParameters<T::Setting>,
                period_s: T::Setting,
            ) -> Self {
                match kind {
                    $(LawKind::$kind => Self::$kind(FrictionLaw::build(written, period_s))),*
                }
            }

            /// Sets the coefficients that depend on the sample period to those of `of` for a period `ratio` times as long.
            pub(crate) fn rescale_period(&mut self, of: &Self, ratio: T) {
                match (self, of) {
                    $((Self::$kind(law), Self::$kind(of)) => law.rescale_period(of, ratio),)*
                    (law, of) => *law = *of,
                }
            }

            /// Sets the levels and viscous coefficients to those of `of`, times these gains.
            pub(crate) fn set_gains(&mut self, of: &Self, level: T, viscous: T) {
                *self = *of;
                match self { $(Self::$kind(law) => law.scale_levels(level, viscous)),* }
            }

            /// Returns the largest speed that the law evaluates, rad/s. A larger velocity is limited to it.
            #[inline(always)]
            pub fn velocity_limit(&self) -> T {
                match self { $(Self::$kind(law) => law.velocity_limit()),* }
            }

            /// Returns the bristle torque in fast sliding, Nm; 0 for a static law.
            pub fn sliding_torque(&self) -> T {
                match self { $(Self::$kind(law) => law.sliding_torque()),* }
            }

            /// Evaluates one sample in a model without terms. Returns the friction torque, Nm.
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
                    // The copy keeps the sample of the other arms in registers.
                    _ => return self.step_other(held, memory, &{ *sample }),
                };
                step.finish(held, sample.velocity_rad_s, &NoEffect)
            }

            /// Evaluates the laws that are not marked `tuned`.
            ///
            /// The function is out of line. Inlined, the call to the arc tangent alone would make the
            /// tuned laws save and restore registers in every step.
            #[cold]
            #[inline(never)]
            #[allow(unreachable_patterns)]
            fn step_other(&self, held: &mut T, memory: &mut Memory<T>, sample: &Sample<T>) -> T {
                let step = match self {
                    // `step_alone` handles these laws itself.
                    $($(Self::$kind(_) => {
                        let $tuned = Step::Done(T::zero());
                        $tuned
                    })?)*
                    $(Self::$kind(law) => law.step_alone(held, &mut memory.$file, sample),)*
                };
                step.finish(held, sample.velocity_rad_s, &NoEffect)
            }

            /// Evaluates one sample under an effect. Returns the friction torque, Nm.
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

            /// Writes the effect of the law's own load into `effects`. Terms add to it.
            #[inline(always)]
            pub(crate) fn load(&self, sample: &Sample<T>, effects: &mut Effects<T>) {
                match self { $(Self::$kind(law) => law.load(sample, effects)),* }
            }
        }
    };
}

// A row holds: a description; the kind, which is also the name of its type; its number in records, which must
// never change; its name in model names and files; its file. `tuned` marks the laws that joint drivers use most:
// their step is inlined into the loop. A step tests the laws in the order of the rows.
define_laws! {
    /// LuGre under side load and pressure.
    ImprovedLugre = 7, "improved-lugre" in improved_lugre, tuned;
    /// Bristles with the Stribeck curve.
    Lugre = 5, "lugre" in lugre, tuned;
    /// LuGre with separate levels for each direction.
    LugreAsymmetric = 6, "lugre-asymmetric" in lugre_asymmetric;
    /// Bristles with one level, and viscous friction.
    Dahl = 4, "dahl" in dahl;
    /// Coulomb and viscous friction with the Stribeck curve.
    Stribeck = 3, "stribeck" in stribeck;
    /// Coulomb and viscous friction with an arc tangent and an offset.
    Atan = 2, "atan" in atan;
    /// Coulomb and viscous friction with a quadratic and a cubic part.
    Extended = 1, "extended" in extended;
    /// Coulomb and viscous friction.
    Linear = 0, "linear" in linear;
}

/// Sorts the laws by number. The numbers must be contiguous from 0.
const fn by_number<const N: usize>(kinds: [LawKind; N]) -> [LawKind; N] {
    let mut sorted = kinds;
    let mut index = 0;
    while index < N {
        sorted[kinds[index] as usize] = kinds[index];
        index += 1;
    }
    sorted
}

/// Parameters that scale with the levels of a law. `static_level - coulomb` scales with both.
const LEVELS: [Id; 9] = [
    Id::CoulombTorque,
    Id::StaticTorque,
    Id::CoulombTorqueNegative,
    Id::StaticTorqueNegative,
    Id::AtanTorque,
    Id::RadialForceCoulomb,
    Id::RadialForceStaticExcess,
    Id::PressureCoulomb,
    Id::PressureStaticExcess,
];

/// Parameters that scale with the viscous friction of a law.
const VISCOUS: [Id; 3] = [Id::ViscousFriction, Id::QuadraticFriction, Id::CubicFriction];

impl LawKind {
    /// Returns the parameters of this law that scale with its levels.
    pub fn levels(self) -> impl Iterator<Item = ParameterId> {
        LEVELS.iter().copied().filter(move |id| self.parameters().contains(id))
    }

    /// Returns the parameters of this law that scale with its viscous friction.
    pub fn viscous(self) -> impl Iterator<Item = ParameterId> {
        VISCOUS.iter().copied().filter(move |id| self.parameters().contains(id))
    }

    /// Returns the law with this name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|kind| kind.name() == name)
    }

    /// Returns the law with this number, which is its position in [`LawKind::ALL`].
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL.get(usize::from(number)).copied()
    }

    /// Returns true if the law itself models the effect of this term.
    pub fn includes(self, kind: TermKind) -> bool {
        kind.parameters().iter().all(|id| self.parameters().contains(id))
    }

    /// Returns true if the law has a bristle state.
    #[inline(never)]
    pub fn has_bristles(self) -> bool {
        self.parameters().contains(&Id::BristleStiffness)
    }

    /// Returns true if the level of the law follows a Stribeck curve.
    #[inline(never)]
    pub fn has_stribeck_curve(self) -> bool {
        self.parameters().contains(&Id::StribeckVelocity)
    }
}

impl<T: Real> Law<T> {
    /// Returns the bristles of a law that has no other part (dahl, lugre).
    ///
    /// A caller that steps many models can then select the law once, outside the loop.
    pub fn plain_bristles(&self) -> Option<&Bristles<T>> {
        match self {
            Self::Lugre(Lugre(bristles)) | Self::Dahl(Dahl(bristles)) => Some(bristles),
            _ => None,
        }
    }
}
