//! A law as statements, for back ends in other packages.

pub use super::effects::BRISTLE_TORQUE;
pub use super::law::{MEASURED_TORQUE, start, step, unsupported_term};
pub use super::program::{Action, Binary, Expr, Node, Program, Statement, Unary};
