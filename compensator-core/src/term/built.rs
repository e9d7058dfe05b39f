//! Terms built for a sample period, what they remember, and what they do.
//!
//! Terms act in the order of the list, before the law: a delay must come first to be seen by the
//! others, and is put there by [`crate::parameters::Parameters::add_term`].

use super::{CONTACT_AGE_MAX_S, DELAY_LINE, Spline, TermKind};
use crate::effect::Effects;
use crate::model::Sample;
use crate::number::Real;
use crate::parameters::{Envelope, ParameterId, Parameters};
use ParameterId as Id;

/// A term built for a sample period.
#[derive(Clone, Copy, Debug)]
pub enum Term<T> {
    /// Nm per N on the Coulomb and on the static level.
    RadialForceCoulomb {
        /// On `F_C`, Nm/N.
        coulomb: T,
        /// On `F_S`, Nm/N.
        static_level: T,
    },
    /// Bristle rate for a change of 1 N within a sample, rad/s.
    RadialForceRate(T),
    /// Nm per MPa on the Coulomb and on the static level.
    PressureCoulomb {
        /// On `F_C`, Nm/MPa.
        coulomb: T,
        /// On `F_S`, Nm/MPa.
        static_level: T,
    },
    /// Viscosity falls by `rate` (1/K) from `reference` (deg C).
    TemperatureViscous {
        /// `b`, 1/K.
        rate: T,
        /// `T0`, deg C.
        reference: T,
    },
    /// Ripple of the level over the angle.
    PositionRipple {
        /// `n`, periods in one turn, 1/rad.
        order: T,
        /// Factor on the sine.
        sine: T,
        /// Factor on the cosine.
        cosine: T,
    },
    /// Torque over the angle, Nm.
    GravityImbalance {
        /// On the sine of the position, Nm.
        sine: T,
        /// On the cosine, Nm.
        cosine: T,
    },
    /// What forwards motion has more, and backwards motion less, as a share of the whole.
    DirectionAsymmetry {
        /// Of the level.
        coulomb: T,
        /// Of the viscous coefficient.
        viscous: T,
    },
    /// Nm.
    TorqueOffset(T),
    /// Nm s^2/rad^2.
    QuadraticDrag(T),
    /// Static level grows with contact age.
    DwellTimeStatic {
        /// `k`, Nm.
        gain: T,
        /// `1/t0`, 1/s.
        per_time: T,
        /// Sample period, s.
        period: T,
        /// Sample period over the travel that renews the contact, s/rad.
        renewal: T,
    },
    /// Level over the campaign.
    TimeDrift {
        /// `a`.
        amplitude: T,
        /// `-1/T`, 1/h.
        per_time: T,
        /// `r`, 1/h.
        rate: T,
    },
    /// Nm per Nm on both levels.
    LoadTorqueCoulomb(T),
    /// kg m^2.
    UnmodelledInertia(T),
    /// Play in the drive.
    Backlash {
        /// The share of the stiffness that is missing inside the play.
        missing: T,
        /// Share of half the play that is crossed in a sample, per speed, s/rad.
        per_velocity: T,
    },
    /// Half the Stribeck exponent.
    StribeckShape(T),
    /// Delay in samples: the whole ones, and the rest. Split when built, because taking a whole number
    /// out of a float pulls soft double arithmetic into every sample.
    ChannelDelay {
        /// Whole samples, at most [`DELAY_LINE`] - 2.
        whole: u8,
        /// What is left, 0..=1.
        fraction: T,
    },
    /// Factor on the load torque.
    LoadGain(T),
    /// The broken lines of the model's [`Spline`].
    Unknown,
}

/// What terms remember between samples.
#[derive(Clone, Copy, Debug)]
pub struct Memory<T> {
    /// How old the contact is, s: time at rest, forgotten with travel.
    contact_age_s: T,
    /// Position within the play, from its middle at 0 to its ends at -1 and 1.
    play: T,
    /// Past velocities; `newest` is the index of the last.
    velocities: [T; DELAY_LINE],
    newest: u8,
    filled: bool,
}

impl<T: Real> Default for Memory<T> {
    fn default() -> Self {
        Self {
            contact_age_s: T::zero(),
            play: T::zero(),
            velocities: [T::zero(); DELAY_LINE],
            newest: 0,
            filled: false,
        }
    }
}

impl<T: Real> Memory<T> {
    /// The velocity `delay` samples ago, between samples by a straight line. Before the line has
    /// filled, the first velocity stands for all earlier ones.
    fn delayed(&mut self, velocity: T, whole: u8, fraction: T) -> T {
        if !self.filled {
            self.velocities = [velocity; DELAY_LINE];
            self.filled = true;
        }
        self.newest = (self.newest + 1) % DELAY_LINE as u8;
        self.velocities[usize::from(self.newest) % DELAY_LINE] = velocity;
        let whole = usize::from(whole).min(DELAY_LINE - 2);
        let back = |samples: usize| {
            self.velocities[(usize::from(self.newest) + DELAY_LINE - samples) % DELAY_LINE]
        };
        back(whole) + (back(whole + 1) - back(whole)) * fraction
    }
}

impl<T: Real> Term<T> {
    /// Builds a term for `period_s` from validated parameters.
    pub(crate) fn build(
        kind: TermKind,
        parameters: &Parameters<T::Setting>,
        period_s: T::Setting,
    ) -> Self {
        let setting = |id| parameters.get(id);
        let number = |id| T::from_setting(setting(id));
        let constant = T::Setting::from_f64;
        let per_mega = |id| T::from_setting(setting(id) * constant(1e6));
        match kind {
            TermKind::RadialForceCoulomb => Term::RadialForceCoulomb {
                coulomb: number(Id::RadialForceCoulomb),
                static_level: T::from_setting(
                    setting(Id::RadialForceCoulomb) + setting(Id::RadialForceStaticExcess),
                ),
            },
            TermKind::RadialForceRate => {
                Term::RadialForceRate(T::from_setting(setting(Id::RadialForceRate) / period_s))
            }
            TermKind::PressureCoulomb => Term::PressureCoulomb {
                coulomb: per_mega(Id::PressureCoulomb),
                static_level: T::from_setting(
                    (setting(Id::PressureCoulomb) + setting(Id::PressureStaticExcess))
                        * constant(1e6),
                ),
            },
            TermKind::TemperatureViscous => Term::TemperatureViscous {
                rate: number(Id::TemperatureViscosity),
                reference: number(Id::TemperatureReference),
            },
            TermKind::PositionRipple => Term::PositionRipple {
                order: number(Id::RippleOrder),
                sine: number(Id::RippleSine),
                cosine: number(Id::RippleCosine),
            },
            TermKind::GravityImbalance => Term::GravityImbalance {
                sine: number(Id::GravitySine),
                cosine: number(Id::GravityCosine),
            },
            TermKind::DirectionAsymmetry => Term::DirectionAsymmetry {
                coulomb: number(Id::CoulombAsymmetry),
                viscous: number(Id::ViscousAsymmetry),
            },
            TermKind::TorqueOffset => Term::TorqueOffset(number(Id::TorqueOffset)),
            TermKind::QuadraticDrag => Term::QuadraticDrag(number(Id::QuadraticDrag)),
            TermKind::DwellTimeStatic => Term::DwellTimeStatic {
                gain: number(Id::DwellGain),
                per_time: T::from_setting(constant(1.0) / setting(Id::DwellTime)),
                period: T::from_setting(period_s),
                renewal: T::from_setting(period_s / setting(Id::DwellTravel)),
            },
            TermKind::TimeDrift => Term::TimeDrift {
                amplitude: number(Id::DriftAmplitude),
                per_time: T::from_setting(constant(-3600.0) / setting(Id::DriftTime)),
                rate: T::from_setting(setting(Id::DriftRate) * constant(3600.0)),
            },
            TermKind::LoadTorqueCoulomb => Term::LoadTorqueCoulomb(number(Id::LoadCoulomb)),
            TermKind::UnmodelledInertia => Term::UnmodelledInertia(number(Id::Inertia)),
            TermKind::Backlash => {
                let half_travel = setting(Id::BacklashTravel) * constant(0.5);
                if half_travel > constant(0.0) {
                    Term::Backlash {
                        missing: T::from_setting(
                            constant(1.0) - setting(Id::BacklashStiffnessRatio),
                        ),
                        per_velocity: T::from_setting(period_s / half_travel),
                    }
                } else {
                    Term::Backlash { missing: T::zero(), per_velocity: T::zero() }
                }
            }
            TermKind::StribeckShape => {
                Term::StribeckShape(T::from_setting(setting(Id::StribeckExponent) * constant(0.5)))
            }
            TermKind::ChannelDelay => {
                delay_of(T::from_setting(setting(Id::ChannelDelay) / period_s))
            }
            TermKind::LoadGain => Term::LoadGain(number(Id::LoadGain)),
            TermKind::Unknown => Term::Unknown,
        }
    }

    /// Becomes `of` for a sample period `ratio` times as long; most terms know no period.
    pub(crate) fn stretch(&mut self, of: &Self, ratio: T) {
        match *of {
            Term::RadialForceRate(per_newton) => *self = Term::RadialForceRate(per_newton / ratio),
            Term::DwellTimeStatic { gain, per_time, period, renewal } => {
                let (period, renewal) = (period * ratio, renewal * ratio);
                *self = Term::DwellTimeStatic { gain, per_time, period, renewal };
            }
            Term::Backlash { missing, per_velocity } => {
                *self = Term::Backlash { missing, per_velocity: per_velocity * ratio };
            }
            Term::ChannelDelay { whole, fraction } => {
                *self = delay_of((fraction + T::from_f64(f64::from(whole))) / ratio);
            }
            _ => {}
        }
    }

    /// Each built coefficient; unused places are 0.
    pub(crate) fn coefficients(&self) -> [T; 4] {
        let zero = T::zero();
        match *self {
            Term::RadialForceRate(a)
            | Term::TorqueOffset(a)
            | Term::QuadraticDrag(a)
            | Term::LoadTorqueCoulomb(a)
            | Term::UnmodelledInertia(a)
            | Term::StribeckShape(a)
            | Term::ChannelDelay { fraction: a, .. }
            | Term::LoadGain(a) => [a, zero, zero, zero],
            // The spline has its own.
            Term::Unknown => [zero; 4],
            Term::RadialForceCoulomb { coulomb: a, static_level: b }
            | Term::PressureCoulomb { coulomb: a, static_level: b }
            | Term::TemperatureViscous { rate: a, reference: b }
            | Term::GravityImbalance { sine: a, cosine: b }
            | Term::DirectionAsymmetry { coulomb: a, viscous: b }
            | Term::Backlash { missing: a, per_velocity: b } => [a, b, zero, zero],
            Term::PositionRipple { order: a, sine: b, cosine: c }
            | Term::TimeDrift { amplitude: a, per_time: b, rate: c } => [a, b, c, zero],
            // The period of the dwell may be held coarsely: a percent of an age is a percent of
            // the gain.
            Term::DwellTimeStatic { gain: a, per_time: b, renewal: c, .. } => [a, b, c, zero],
        }
    }

    /// The largest magnitude any product of [`Term::act`] can reach within the envelope.
    pub(crate) fn largest_product(&self, envelope: &Envelope) -> f64 {
        let e = envelope;
        let speed = f64::from(e.velocity_max_rad_s);
        let size = |coefficient: T| coefficient.value().abs();
        match *self {
            Term::RadialForceCoulomb { coulomb: a, static_level: b } => {
                size(a).max(size(b)) * f64::from(e.radial_force_max_n)
            }
            Term::RadialForceRate(a) => size(a) * f64::from(e.radial_force_max_n),
            Term::PressureCoulomb { coulomb: a, static_level: b } => {
                size(a).max(size(b)) * f64::from(e.pressure_diff_max_pa) * 1e-6
            }
            // The exponent; what it makes of the viscous torque is checked with that torque.
            Term::TemperatureViscous { rate, .. } => size(rate) * 200.0,
            Term::PositionRipple { order, .. } => size(order) * f64::from(e.position_max_rad),
            Term::GravityImbalance { sine, cosine } => size(sine) + size(cosine),
            Term::DirectionAsymmetry { coulomb, viscous } => size(coulomb).max(size(viscous)),
            Term::TorqueOffset(a) | Term::StribeckShape(a) => size(a),
            Term::ChannelDelay { .. } => 1.0,
            Term::QuadraticDrag(a) => (size(a) * speed).max(1.0) * speed,
            Term::DwellTimeStatic { gain, per_time, renewal, .. } => {
                let aged = size(per_time) * CONTACT_AGE_MAX_S;
                (size(gain) * libm::log(1.0 + aged)).max(size(renewal) * speed).max(aged)
            }
            Term::TimeDrift { per_time, rate, .. } => {
                size(per_time).max(size(rate)) * f64::from(e.campaign_max_h)
            }
            Term::LoadTorqueCoulomb(a) | Term::LoadGain(a) => {
                size(a) * f64::from(e.load_torque_max_nm)
            }
            Term::UnmodelledInertia(a) => size(a) * f64::from(e.acceleration_max_rad_s2),
            Term::Backlash { per_velocity, .. } => size(per_velocity) * speed,
            Term::Unknown => 0.0,
        }
    }

    /// Lets the term act on one sample; `spline` is what [`Term::Unknown`] stands for.
    #[inline]
    pub(crate) fn act(
        &self,
        sample: &Sample<T>,
        spline: &Spline<T>,
        memory: &mut Memory<T>,
        effects: &mut Effects<T>,
    ) {
        let one = T::one();
        match *self {
            Term::RadialForceCoulomb { coulomb, static_level } => {
                effects.seal.coulomb = effects.seal.coulomb + coulomb * sample.radial_force_n;
                effects.seal.static_level =
                    effects.seal.static_level + static_level * sample.radial_force_n;
            }
            Term::RadialForceRate(per_newton) => {
                effects.seal.bristle_rate =
                    effects.seal.bristle_rate + per_newton * sample.radial_force_change_n;
            }
            Term::PressureCoulomb { coulomb, static_level } => {
                effects.seal.coulomb = effects.seal.coulomb + coulomb * sample.pressure_diff_mpa;
                effects.seal.static_level =
                    effects.seal.static_level + static_level * sample.pressure_diff_mpa;
            }
            Term::TemperatureViscous { rate, reference } => {
                let factor = (-(rate * (sample.temperature_c - reference))).exp();
                effects.viscous_scale = effects.viscous_scale * factor;
            }
            Term::PositionRipple { order, sine, cosine } => {
                let ripple = over_angle(order * sample.position_rad, sine, cosine);
                let ripple = ripple * sample.position_trust;
                effects.level_scale = effects.level_scale * (one + ripple);
            }
            Term::GravityImbalance { sine, cosine } => {
                let torque = over_angle(sample.position_rad, sine, cosine);
                effects.torque = effects.torque + torque * sample.position_trust;
            }
            Term::DirectionAsymmetry { coulomb, viscous } => {
                effects.level_asymmetry = effects.level_asymmetry + coulomb;
                effects.viscous_asymmetry = effects.viscous_asymmetry + viscous;
            }
            Term::TorqueOffset(offset) => effects.torque = effects.torque + offset,
            Term::QuadraticDrag(coefficient) => {
                let velocity = effects.velocity;
                effects.torque = effects.torque + coefficient * velocity * velocity.abs();
            }
            Term::DwellTimeStatic { gain, per_time, period, renewal } => {
                // Contact age after Dieterich (1979): d(age)/dt = 1 - |v| age / travel, stepped
                // implicitly, so it stays positive and forgets within one travel.
                let oldest = T::from_f64(CONTACT_AGE_MAX_S);
                let aged = (memory.contact_age_s + period).at_most(oldest);
                // The full division: `ratio` of fixed point would lose more of an old age in each
                // sample than the sample adds to it.
                memory.contact_age_s = aged / (one + renewal * effects.velocity.abs());
                effects.seal.static_level =
                    effects.seal.static_level + gain * (one + memory.contact_age_s * per_time).ln();
            }
            Term::TimeDrift { amplitude, per_time, rate } => {
                let run_in = amplitude * (per_time * sample.campaign_time_h).exp();
                let wear = rate * sample.campaign_time_h;
                effects.level_scale = effects.level_scale * (one + run_in + wear);
            }
            Term::LoadTorqueCoulomb(coefficient) => {
                let added = coefficient * sample.load_torque_nm.abs();
                effects.seal.coulomb = effects.seal.coulomb + added;
                effects.seal.static_level = effects.seal.static_level + added;
            }
            Term::UnmodelledInertia(inertia) => {
                effects.torque = effects.torque + inertia * sample.acceleration_rad_s2;
            }
            Term::Backlash { missing, per_velocity } => {
                let velocity = effects.velocity;
                let travel = velocity.abs() * per_velocity;
                let room = one - memory.play * velocity.sign();
                let crossed = travel.at_most(room);
                memory.play = (memory.play + crossed.copy_sign(velocity)).within(one);
                // The share of this sample's travel made without contact: 1 inside the play, 0 at
                // its end, to the last bit. The full division, for these may be the last few bits
                // of a fixed-point number.
                let free = if travel < room {
                    one
                } else if room > T::zero() {
                    room / travel
                } else {
                    T::zero()
                };
                effects.stiffness_scale = effects.stiffness_scale * (one - missing * free);
            }
            Term::StribeckShape(half_exponent) => effects.half_exponent = Some(half_exponent),
            Term::ChannelDelay { whole, fraction } => {
                effects.velocity = memory.delayed(effects.velocity, whole, fraction);
            }
            Term::LoadGain(gain) => effects.torque = effects.torque + gain * sample.load_torque_nm,
            Term::Unknown => spline.act(sample, effects),
        }
    }
}

/// A delay of so many samples, split; a longer one than the line holds is the longest.
fn delay_of<T: Real>(samples: T) -> Term<T> {
    let whole = (samples.value() as usize).min(DELAY_LINE - 2);
    Term::ChannelDelay { whole: whole as u8, fraction: samples - T::from_f64(whole as f64) }
}

/// `sine sin(angle) + cosine cos(angle)`. Out of line: the angle being the same for all terms of a
/// sample, the compiler would take its sines before the loop, for models that need none as well.
#[inline(never)]
fn over_angle<T: Real>(angle: T, sine: T, cosine: T) -> T {
    let quarter_ahead = angle + T::from_f64(core::f64::consts::FRAC_PI_2);
    sine * angle.sin() + cosine * quarter_ahead.sin()
}
