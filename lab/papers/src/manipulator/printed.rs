//! Values that the paper prints in tables 3 to 10.

use ParameterId as Id;
use compensator_core::{LawKind, ParameterId};

/// A model of the paper.
#[derive(Clone, Copy, Debug)]
pub struct PrintedModel {
    /// Name in the paper.
    pub name: &'static str,
    /// The equivalent law of the core.
    pub law: LawKind,
    /// Number of the table with its errors; the table before it has its coefficients.
    pub table: u32,
    /// Root mean square error of joints 1, 2 and 3, deg.
    pub rmse_deg: [f64; 3],
    /// Sum of squared errors.
    pub sse: [f64; 3],
    /// Coefficients.
    pub coefficients: &'static [PrintedCoefficient],
}

/// A coefficient of a model.
#[derive(Clone, Copy, Debug)]
pub struct PrintedCoefficient {
    /// Symbol in the paper.
    pub symbol: &'static str,
    /// Parameter of the core; `None` for the initial deflection of the bristle.
    pub id: Option<Id>,
    /// Printed unit.
    pub unit: &'static str,
    /// Values in joints 1, 2 and 3.
    pub values: [f64; 3],
}

const fn is(
    symbol: &'static str,
    id: Id,
    unit: &'static str,
    values: [f64; 3],
) -> PrintedCoefficient {
    PrintedCoefficient { symbol, id: Some(id), unit, values }
}

/// The four models, in the order of the paper.
pub const MODELS: [PrintedModel; 4] = [
    PrintedModel {
        name: "linear",
        law: LawKind::Linear,
        table: 4,
        rmse_deg: [3.0610, 1.2341, 1.8602],
        sse: [1.0306e6, 1.6754e5, 3.8063e5],
        coefficients: &[
            is("f_c", Id::CoulombTorque, "N m s/rad", [0.0376, 0.1446, 0.0512]),
            is("f_v", Id::ViscousFriction, "N m", [1.5473, 3.3254, 0.1537]),
        ],
    },
    PrintedModel {
        name: "extended",
        law: LawKind::Extended,
        table: 6,
        rmse_deg: [1.7812, 1.1192, 1.7403],
        sse: [3.4900e5, 1.3778e5, 3.3114e5],
        coefficients: &[
            is("f_c", Id::CoulombTorque, "N m s/rad", [0.2195, 0.0824, 0.0233]),
            is("f_v", Id::ViscousFriction, "N m", [0.0800, 3.2338, 0.0101]),
            is("f_1", Id::QuadraticFriction, "N m s/rad", [0.9084, 3.1062, 0.2301]),
            is("f_2", Id::CubicFriction, "N m", [6.3584, 0.1126, 0.0538]),
        ],
    },
    PrintedModel {
        name: "atan",
        law: LawKind::Atan,
        table: 8,
        rmse_deg: [2.2694, 1.1368, 1.8252],
        sse: [5.6654e5, 1.4216e5, 3.6646e5],
        coefficients: &[
            is("f_0", Id::TorqueOffset, "N m", [0.0025, 0.2391, 0.0649]),
            is("f_c", Id::CoulombTorque, "N m s/rad", [0.0034, 0.0045, 0.0338]),
            is("f_v", Id::ViscousFriction, "N m", [1.5019, 3.0809, 0.0078]),
            is("f_a", Id::AtanTorque, "N m s/rad", [1.2325, 1.8990, 0.0523]),
            is("f_b", Id::AtanSlope, "N m", [0.1889, 1.1963, 0.8921]),
        ],
    },
    PrintedModel {
        name: "LuGre",
        law: LawKind::Lugre,
        table: 10,
        rmse_deg: [2.2930, 1.3597, 1.5891],
        sse: [5.7835e5, 2.0335e5, 2.7777e5],
        coefficients: &[
            is("F_C", Id::CoulombTorque, "N m s/rad", [1.5018, 0.0783, 0.4170]),
            is("F_S", Id::StaticTorque, "N m", [1.6532, 0.9187, 6.4911]),
            is("v_s", Id::StribeckVelocity, "m/s", [0.7524, 0.6895, 4.0947]),
            is("sigma_0", Id::BristleStiffness, "N/m", [0.0153, 0.0314, 0.0999]),
            is("sigma_1", Id::BristleDamping, "N s/m", [0.1000, 3.9920, 0.0077]),
            is("sigma_2", Id::ViscousFriction, "N s/m", [1.8068, 2.5832, 0.1072]),
            PrintedCoefficient {
                symbol: "z",
                id: None,
                unit: "m",
                values: [8.8e-6, 2.6e-6, 0.2e-6],
            },
        ],
    },
];

/// Number of samples behind each printed sum.
pub const SAMPLES: usize = 110_001;
