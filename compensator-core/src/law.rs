//! The friction laws, each once.
//!
//! Static laws ([`steady`]) give a torque for a velocity. Bristle laws ([`bristle`]) carry a state,
//! the torque `y = sigma0 z` held by the bent bristles, and so know presliding, hysteresis and
//! stick-slip. All see load, pressure and the extension terms through [`crate::effect::Effect`].
//!
//! | law | torque | source |
//! |---|---|---|
//! | linear | `F_C sgn v + sigma2 v` | paper 2, eq. 2-4 |
//! | extended | `F_C sgn v + sigma2 v + f1 v abs(v) + f2 v^3` | paper 2, eq. 5 (printed `f1 v sgn v`: an option) |
//! | atan | `f0 + F_C sgn v + sigma2 v + fa atan(fb v)` | paper 2, eq. 6 |
//! | stribeck | `g(v) sgn v + sigma2 v` | steady LuGre |
//! | dahl | bristles with `F_S = F_C`, `sigma1 = 0` | Dahl 1968 |
//! | lugre | bristles | paper 0, eq. 1; paper 1, eq. 12-13 |
//! | lugre-asymmetric | bristles, levels by the sign of the held torque | paper 1, eq. 4 |
//! | improved-lugre | bristles under side load and pressure | paper 0, eq. 16 |

pub mod bristle;
pub mod steady;
