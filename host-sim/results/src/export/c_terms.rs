//! The extension terms in C: the inputs a term reads, the state it keeps, and its statements.
//!
//! The statements are the same as in `compensator_core::term`. They stand before those of the law and change its
//! variables: `coulomb`, `static_level`, `level_scale`, `level_asymmetry`, `viscous_scale`, `carried_rate`, `torque`.

use compensator_core::term::TORQUE_RIPPLE_PARAMETERS;
use compensator_core::{ParameterId as Id, Parameters, TermKind as Kind};

/// The part of the header that a term adds.
#[derive(Default)]
pub(super) struct TermCode {
    /// Fields of the inputs that the term reads.
    pub inputs: Vec<&'static str>,
    /// Fields of the state that the term keeps.
    pub state: Vec<&'static str>,
    /// Statements before those of the law.
    pub code: Vec<String>,
}

impl TermCode {
    /// A term without state.
    fn stateless(inputs: &[&'static str], code: Vec<String>) -> Self {
        Self { inputs: inputs.to_vec(), code, ..Self::default() }
    }
}

/// Formats a number as a C literal.
pub(super) fn number(value: f32) -> String {
    format!("{value:?}f")
}

/// Input field of the campaign time.
const TIME: &str = "campaign_time_s";

/// Returns the C code of a term. Returns `None` for a term that needs a table or the memory of many samples.
pub(super) fn term_code(kind: Kind, model: &Parameters<f32>) -> Option<TermCode> {
    let n = |id: Id| number(model.get(id));
    Some(match kind {
        Kind::RadialForceCoulomb => {
            let excess = Some(Id::RadialForceStaticExcess);
            let code = load_on_levels(model, "in->radial_force_n", Id::RadialForceCoulomb, excess);
            TermCode::stateless(&["radial_force_n"], code)
        }
        Kind::RadialForceRate => radial_force_rate(model),
        Kind::PressureCoulomb => {
            let excess = Some(Id::PressureStaticExcess);
            let code = load_on_levels(model, "in->pressure_diff_pa", Id::PressureCoulomb, excess);
            TermCode::stateless(&["pressure_diff_pa"], code)
        }
        Kind::LoadTorqueCoulomb => {
            let code = load_on_levels(model, "fabsf(in->load_torque_nm)", Id::LoadCoulomb, None);
            TermCode::stateless(&["load_torque_nm"], code)
        }
        Kind::TemperatureViscous => temperature(model, "viscous_scale", Id::TemperatureViscosity),
        Kind::TemperatureCoulomb => temperature(model, "level_scale", Id::TemperatureCoulomb),
        Kind::PositionRipple => {
            let ripple = wave(n(Id::RippleOrder), n(Id::RippleSine), n(Id::RippleCosine));
            let code = vec![format!("level_scale *= 1.0f + {ripple};")];
            TermCode::stateless(&["position_rad"], code)
        }
        Kind::GravityImbalance => {
            let torque = wave(number(1.0), n(Id::GravitySine), n(Id::GravityCosine));
            TermCode::stateless(&["position_rad"], vec![format!("torque += {torque};")])
        }
        Kind::TorqueRipple => torque_ripple(model),
        Kind::DirectionAsymmetry => TermCode::stateless(
            &[],
            vec![
                format!("level_asymmetry += {};", n(Id::CoulombAsymmetry)),
                format!("viscous_scale *= 1.0f + {} * direction;", n(Id::ViscousAsymmetry)),
            ],
        ),
        Kind::TorqueOffset => {
            TermCode::stateless(&[], vec![format!("torque += {};", n(Id::TorqueOffset))])
        }
        Kind::QuadraticDrag => {
            let code = vec![format!("torque += {} * velocity * speed;", n(Id::QuadraticDrag))];
            TermCode::stateless(&[], code)
        }
        Kind::DwellTimeStatic => dwell_time_static(model),
        Kind::TimeDrift => time_drift(model),
        Kind::UnmodelledInertia => {
            let code = vec![format!("torque += {} * in->acceleration_rad_s2;", n(Id::Inertia))];
            TermCode::stateless(&["acceleration_rad_s2"], code)
        }
        Kind::LoadGain => {
            let code = vec![format!("torque += {} * in->load_torque_nm;", n(Id::LoadGain))];
            TermCode::stateless(&["load_torque_nm"], code)
        }
        // The code of the law reads the exponent.
        Kind::StribeckShape => TermCode::default(),
        Kind::Backlash | Kind::ChannelDelay | Kind::LookupTable | Kind::WarmUp => return None,
    })
}

/// A load that raises the Coulomb level, and the static level by `excess` more.
fn load_on_levels(
    model: &Parameters<f32>,
    load: &str,
    coulomb: Id,
    excess: Option<Id>,
) -> Vec<String> {
    let static_level = model.get(coulomb) + excess.map_or(0.0, |id| model.get(id));
    vec![
        format!("coulomb += {} * {load};", number(model.get(coulomb))),
        format!("static_level += {} * {load};", number(static_level)),
    ]
}

/// A wave over the position.
fn wave(order: String, sine: String, cosine: String) -> String {
    format!(
        "({sine} * sinf({order} * in->position_rad) + {cosine} * cosf({order} * in->position_rad))"
    )
}

fn radial_force_rate(model: &Parameters<f32>) -> TermCode {
    TermCode {
        inputs: vec!["radial_force_n"],
        state: vec!["radial_force_n", "has_radial_force"],
        code: vec![
            "if (state->has_radial_force != 0.0f)".to_owned(),
            format!(
                "    carried_rate += {} * (in->radial_force_n - state->radial_force_n) / dt_s;",
                number(model.get(Id::RadialForceRate))
            ),
            "state->radial_force_n = in->radial_force_n;".to_owned(),
            "state->has_radial_force = 1.0f;".to_owned(),
        ],
    }
}

/// An exponential decrease of `variable` with temperature.
fn temperature(model: &Parameters<f32>, variable: &str, rate: Id) -> TermCode {
    let [rate, reference] = [rate, Id::TemperatureReference].map(|id| number(model.get(id)));
    let code = format!("{variable} *= expf(-{rate} * (in->temperature_c - {reference}));");
    TermCode::stateless(&["temperature_c"], vec![code])
}

fn torque_ripple(model: &Parameters<f32>) -> TermCode {
    let waves = TORQUE_RIPPLE_PARAMETERS.iter().filter(|ids| model.get(ids[0]) > 0.0);
    let torque = |ids: &[Id; 3]| {
        let [order, sine, cosine] = ids.map(|id| number(model.get(id)));
        format!("torque += {};", wave(order, sine, cosine))
    };
    TermCode::stateless(&["position_rad"], waves.map(torque).collect())
}

fn dwell_time_static(model: &Parameters<f32>) -> TermCode {
    let n = |id: Id| number(model.get(id));
    TermCode {
        state: vec!["contact_age_s"],
        code: vec![
            "state->contact_age_s = fminf(state->contact_age_s + dt_s, 1000.0f)".to_owned(),
            format!("    / (1.0f + dt_s / {} * speed);", n(Id::DwellTravel)),
            format!(
                "static_level += {} * logf(1.0f + state->contact_age_s / {});",
                n(Id::DwellGain),
                n(Id::DwellTime)
            ),
        ],
        ..TermCode::default()
    }
}

fn time_drift(model: &Parameters<f32>) -> TermCode {
    let n = |id: Id| number(model.get(id));
    let code = vec![
        format!(
            "level_scale *= 1.0f + {} * expf(-in->{TIME} / {})",
            n(Id::DriftAmplitude),
            n(Id::DriftTime)
        ),
        format!("    + {} * in->{TIME};", n(Id::DriftRate)),
    ];
    TermCode::stateless(&[TIME], code)
}
