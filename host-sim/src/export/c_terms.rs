//! The extension terms in C: what each reads, keeps and does, line by line as in `compensator_core::term`.

use compensator_core::term::TORQUE_RIPPLE_PARAMETERS;
use compensator_core::{ParameterId as Id, Parameters, TermKind as Kind};

/// What a term adds to the header.
#[derive(Default)]
pub(super) struct Lines {
    /// Fields of the inputs it reads.
    pub inputs: Vec<&'static str>,
    /// Fields of the state it keeps.
    pub state: Vec<&'static str>,
    /// Statements before the law's.
    pub code: Vec<String>,
}

/// A number as C writes it.
pub(super) fn number(value: f32) -> String {
    format!("{value:?}f")
}

/// The field of the inputs for campaign time.
pub(super) const TIME: &str = "campaign_time_s";

/// A term's lines; `None` of one that needs a memory of many rows, or a table.
pub(super) fn lines(kind: Kind, model: &Parameters<f32>) -> Option<Lines> {
    let n = |id: Id| number(model.get(id));
    let angle = |order: String, sine: String, cosine: String| {
        format!(
            "({sine} * sinf({order} * in->position_rad) + {cosine} * cosf({order} * in->position_rad))"
        )
    };
    let reads = |inputs: &[&'static str], code: Vec<String>| Lines {
        inputs: inputs.to_vec(),
        code,
        ..Lines::default()
    };
    // What presses the seal: so much on the Coulomb level, so much on the static one.
    let presses = |of: &str, coulomb: Id, excess: Option<Id>| {
        let static_level = model.get(coulomb) + excess.map_or(0.0, |id| model.get(id));
        vec![
            format!("coulomb += {} * {of};", n(coulomb)),
            format!("static_level += {} * {of};", number(static_level)),
        ]
    };
    Some(match kind {
        Kind::RadialForceCoulomb => reads(
            &["radial_force_n"],
            presses(
                "in->radial_force_n",
                Id::RadialForceCoulomb,
                Some(Id::RadialForceStaticExcess),
            ),
        ),
        Kind::RadialForceRate => Lines {
            inputs: vec!["radial_force_n"],
            state: vec!["radial_force_n", "has_radial_force"],
            code: vec![
                "if (state->has_radial_force != 0.0f)".to_owned(),
                format!(
                    "    carried_rate += {} * (in->radial_force_n - state->radial_force_n) / dt_s;",
                    n(Id::RadialForceRate)
                ),
                "state->radial_force_n = in->radial_force_n;".to_owned(),
                "state->has_radial_force = 1.0f;".to_owned(),
            ],
        },
        Kind::PressureCoulomb => reads(
            &["pressure_diff_pa"],
            presses("in->pressure_diff_pa", Id::PressureCoulomb, Some(Id::PressureStaticExcess)),
        ),
        Kind::LoadTorqueCoulomb => {
            reads(&["load_torque_nm"], presses("fabsf(in->load_torque_nm)", Id::LoadCoulomb, None))
        }
        Kind::TemperatureViscous | Kind::TemperatureCoulomb => {
            let (what, rate) = if kind == Kind::TemperatureViscous {
                ("viscous_scale", Id::TemperatureViscosity)
            } else {
                ("level_scale", Id::TemperatureCoulomb)
            };
            let reference = n(Id::TemperatureReference);
            let code = format!("{what} *= expf(-{} * (in->temperature_c - {reference}));", n(rate));
            reads(&["temperature_c"], vec![code])
        }
        Kind::PositionRipple => {
            let ripple = angle(n(Id::RippleOrder), n(Id::RippleSine), n(Id::RippleCosine));
            reads(&["position_rad"], vec![format!("level_scale *= 1.0f + {ripple};")])
        }
        Kind::GravityImbalance => {
            let torque = angle(number(1.0), n(Id::GravitySine), n(Id::GravityCosine));
            reads(&["position_rad"], vec![format!("torque += {torque};")])
        }
        Kind::TorqueRipple => {
            let waves = TORQUE_RIPPLE_PARAMETERS.iter().filter(|wave| model.get(wave[0]) > 0.0);
            let torque = |wave: &[Id; 3]| {
                let [order, sine, cosine] = wave.map(n);
                format!("torque += {};", angle(order, sine, cosine))
            };
            reads(&["position_rad"], waves.map(torque).collect())
        }
        Kind::DirectionAsymmetry => reads(
            &[],
            vec![
                format!("level_asymmetry += {};", n(Id::CoulombAsymmetry)),
                format!("viscous_scale *= 1.0f + {} * direction;", n(Id::ViscousAsymmetry)),
            ],
        ),
        Kind::TorqueOffset => reads(&[], vec![format!("torque += {};", n(Id::TorqueOffset))]),
        Kind::QuadraticDrag => {
            reads(&[], vec![format!("torque += {} * velocity * speed;", n(Id::QuadraticDrag))])
        }
        Kind::DwellTimeStatic => Lines {
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
            ..Lines::default()
        },
        Kind::TimeDrift => reads(
            &[TIME],
            vec![
                format!(
                    "level_scale *= 1.0f + {} * expf(-in->{TIME} / {})",
                    n(Id::DriftAmplitude),
                    n(Id::DriftTime)
                ),
                format!("    + {} * in->{TIME};", n(Id::DriftRate)),
            ],
        ),
        Kind::UnmodelledInertia => reads(
            &["acceleration_rad_s2"],
            vec![format!("torque += {} * in->acceleration_rad_s2;", n(Id::Inertia))],
        ),
        Kind::LoadGain => reads(
            &["load_torque_nm"],
            vec![format!("torque += {} * in->load_torque_nm;", n(Id::LoadGain))],
        ),
        // The law asks for the exponent itself.
        Kind::StribeckShape => Lines::default(),
        Kind::Backlash | Kind::ChannelDelay | Kind::LookupTable | Kind::WarmUp => return None,
    })
}
