//! Random parameter vectors around the fitted one (Ding et al., eq. 4 and 9), with relative deviations.
//!
//! ```text
//! xi_i = mean_i exp(s_i z_i)        z normal, truncated to its central 95 % as in the paper
//! CV_i = sqrt(exp(s_i^2) - 1)       of the log-normal distribution; about s_i if it is small
//! ```
//!
//! All comparisons use common random numbers: each vector's `z` is the same for every speed class, every tested set of
//! variances, and a model before and after its extension. Differences are then caused by the model.
//!
//! Load coefficients vary with the level that they add to. The paper compares its improved model's
//! `F_C + k_C1 dP + k_C2 F_L`, as one `F_composite`, with the plain model's `F_C`.

use ParameterId as Id;
use compensator_core::{ParameterId, Parameters};
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;

/// Limit of the central 95 % of the normal distribution, in standard deviations.
pub const TRUNCATION_SIGMAS: f64 = 1.96;

/// Magnitude below which a parameter counts as 0 and has no relative spread.
const MIN_MAGNITUDE: f64 = 1e-12;

/// Pairs of levels: the core rejects a static level below its Coulomb level.
const LEVELS: [(Id, Id); 2] =
    [(Id::CoulombTorque, Id::StaticTorque), (Id::CoulombTorqueNegative, Id::StaticTorqueNegative)];

/// Coefficients of terms that add to the Coulomb level.
const LOADS: [Id; 3] = [Id::RadialForceCoulomb, Id::PressureCoulomb, Id::LoadCoulomb];

/// Parameters that are choices, positions or reference values, for which a spread has no meaning.
const CHOICES: [Id; 5] = [
    Id::TemperatureReference,
    Id::LookupColumn,
    Id::LookupLower,
    Id::LookupUpper,
    Id::BacklashStiffnessRatio,
];

/// Reason why a parameter is not in a certificate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExclusionReason {
    /// The model does not have it.
    NotInModel,
    /// Its value is 0, so that it has no relative spread.
    Zero,
    /// It varies with the Coulomb level that it adds to.
    Composite,
    /// It is a choice, not a magnitude.
    Choice,
}

impl ExclusionReason {
    /// Returns the end of a sentence that begins with the parameter's name.
    pub fn in_words(self) -> &'static str {
        match self {
            Self::NotInModel => "is not a parameter of this model",
            Self::Zero => "is 0 and has no relative spread",
            Self::Composite => "varies with the Coulomb level that it adds to",
            Self::Choice => "is a choice, not a magnitude",
        }
    }
}

/// Checks whether a parameter can be certified.
///
/// # Errors
/// The reason why it cannot.
pub fn certifiable(parameters: &Parameters<f64>, id: ParameterId) -> Result<(), ExclusionReason> {
    if !parameters.active().any(|active| active == id) {
        Err(ExclusionReason::NotInModel)
    } else if CHOICES.contains(&id) {
        Err(ExclusionReason::Choice)
    } else if LOADS.contains(&id) {
        Err(ExclusionReason::Composite)
    } else if parameters.get(id).abs() <= MIN_MAGNITUDE {
        Err(ExclusionReason::Zero)
    } else {
        Ok(())
    }
}

/// Returns the parameters, some of them multiplied by `exp` of the given logarithm. The result is legal: a Coulomb level above
/// its static level raises the latter.
pub fn varied(parameters: &Parameters<f64>, logarithms: &[(ParameterId, f64)]) -> Parameters<f32> {
    let mut varied = parameters.clone();
    let scale = |varied: &mut Parameters<f64>, id: Id, factor: f64| {
        let info = id.info();
        let value = parameters.get(id) * factor;
        varied.set(id, value.max(info.lower).min(info.upper));
    };
    for (id, logarithm) in logarithms {
        let factor = logarithm.exp();
        scale(&mut varied, *id, factor);
        if *id == Id::CoulombTorque {
            LOADS.into_iter().for_each(|load| scale(&mut varied, load, factor));
        }
    }
    for (coulomb, static_torque) in LEVELS {
        let is_varied = |id| logarithms.iter().any(|(other, _)| *other == id);
        if is_varied(coulomb) || is_varied(static_torque) {
            let least = varied.get(coulomb);
            varied.set(static_torque, varied.get(static_torque).max(least));
        }
    }
    varied.convert()
}

/// Truncated normal random numbers, one row per sampled vector.
#[derive(Clone, Debug)]
pub struct Draws {
    /// One row per sampled vector, with a number per parameter.
    pub vectors: Vec<Vec<f64>>,
    /// One number per vector, for a parameter that varies alone. All parameters use the same numbers, so that they are
    /// comparable.
    pub alone: Vec<f64>,
}

/// Draws normal numbers from the central 95 %.
fn normals(seed: u64, count: usize) -> Vec<f64> {
    let mut random = Pcg64::seed_from_u64(seed);
    let normal = Normal::new(0.0, 1.0).unwrap_or_else(|_| unreachable!("a size"));
    (0..count)
        .map(|_| {
            loop {
                let z: f64 = normal.sample(&mut random);
                if z.abs() <= TRUNCATION_SIGMAS {
                    break z;
                }
            }
        })
        .collect()
}

impl Draws {
    /// Draws numbers for `vectors` vectors of these parameters. The numbers of a parameter depend only on the seed and on the
    /// parameter itself.
    pub fn new(seed: u64, parameters: &[ParameterId], vectors: usize) -> Self {
        let own_seed = |number: u64| seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(number);
        let columns: Vec<Vec<f64>> =
            parameters.iter().map(|id| normals(own_seed(1 + *id as u64), vectors)).collect();
        Self {
            vectors: (0..vectors)
                .map(|i| columns.iter().map(|column| column[i]).collect())
                .collect(),
            alone: normals(own_seed(0), vectors),
        }
    }
}

/// Returns the coefficient of variation of a parameter whose logarithm has this standard deviation.
pub fn coefficient_of_variation(spread: f64) -> f64 {
    (spread * spread).exp_m1().sqrt()
}

/// Returns the standard deviation of the logarithm at a coefficient of variation.
pub fn spread_at(coefficient_of_variation: f64) -> f64 {
    coefficient_of_variation.powi(2).ln_1p().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::{LawKind, TermKind};

    fn lugre() -> Parameters<f64> {
        Parameters::new(LawKind::Lugre)
            .with(Id::CoulombTorque, 1.5)
            .with(Id::StaticTorque, 2.0)
            .with(Id::ViscousFriction, -0.05)
    }

    #[test]
    fn varied_with_negative_parameter_keeps_sign() {
        let varied = varied(&lugre(), &[(Id::ViscousFriction, 2f64.ln())]);
        assert!((f64::from(varied.get(Id::ViscousFriction)) + 0.1).abs() < 1e-6);
        assert_eq!(varied.get(Id::CoulombTorque), 1.5);
    }

    #[test]
    fn varied_keeps_static_level_above_coulomb_level() {
        for logarithms in [[(Id::CoulombTorque, 1.0)], [(Id::StaticTorque, -1.0)]] {
            let varied = varied(&lugre(), &logarithms);
            assert!(varied.get(Id::StaticTorque) >= varied.get(Id::CoulombTorque));
        }
    }

    #[test]
    fn varied_scales_load_coefficients_with_coulomb_level() {
        let mut parameters = lugre().with(Id::PressureCoulomb, 2e-6);
        assert!(parameters.add_term(TermKind::PressureCoulomb));
        let varied = varied(&parameters, &[(Id::CoulombTorque, 3f64.ln())]);
        assert!((f64::from(varied.get(Id::PressureCoulomb)) - 6e-6).abs() < 1e-12);
        assert_eq!(certifiable(&parameters, Id::PressureCoulomb), Err(ExclusionReason::Composite));
        assert_eq!(certifiable(&parameters, Id::BristleDamping), Err(ExclusionReason::Zero));
        assert_eq!(certifiable(&parameters, Id::AtanSlope), Err(ExclusionReason::NotInModel));
        assert_eq!(certifiable(&parameters, Id::CoulombTorque), Ok(()));
    }

    #[test]
    fn draws_depend_on_own_parameter_and_are_truncated() {
        let few = Draws::new(7, &[Id::ViscousFriction], 1000);
        let many = Draws::new(7, &[Id::CoulombTorque, Id::ViscousFriction], 1000);
        for (few, many) in few.vectors.iter().zip(&many.vectors) {
            assert_eq!(few[0], many[1]);
            assert!(many.iter().all(|z| z.abs() <= TRUNCATION_SIGMAS));
        }
        assert_eq!(few.alone, many.alone);
        let mean: f64 = few.alone.iter().sum::<f64>() / 1000.0;
        let square: f64 = few.alone.iter().map(|z| z * z).sum::<f64>() / 1000.0;
        // The variance of a normal number truncated at 1.96 is 0.76.
        assert!(mean.abs() < 0.1 && (0.68..0.84).contains(&square), "{mean} {square}");
    }

    #[test]
    fn spread_at_inverts_coefficient_of_variation() {
        assert!((coefficient_of_variation(0.01) - 0.01).abs() < 1e-6);
        for cv in [1e-6, 0.3, 41.56, 100.0] {
            assert!((coefficient_of_variation(spread_at(cv)) / cv - 1.0).abs() < 1e-9);
        }
    }
}
