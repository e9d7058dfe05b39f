//! The plant: a motor, its bridge and a joint with a friction seal, in double precision.
//!
//! The winding has dq equations with back-EMF and cross-coupling. A rigid gear drives one inertia. The seal consists of
//! Maxwell slip elements: springs that slip at their share of a Stribeck level. This friction law has presliding and
//! stiction, but no bristle equation, so it is independent of LuGre.
//!
//! The closed bridge applies each phase's mean voltage minus the dead-time loss. The diodes of the open bridge drive
//! the currents to zero. Integration is fourth-order Runge-Kutta with 20 steps per period.

use std::f64::consts::TAU;

/// Integration steps in a period.
const STEPS: usize = 20;

/// Slip elements of the seal.
const ELEMENTS: usize = 8;

/// Constants of motor, bridge and joint.
#[derive(Clone, Copy, Debug)]
pub struct Machine {
    pub pole_pairs: f64,
    pub gear: f64,
    /// Phase resistance, ohm.
    pub resistance: f64,
    /// Inductances, H.
    pub inductance_d: f64,
    pub inductance_q: f64,
    /// Flux linkage of the magnet, V s.
    pub flux: f64,
    /// Inertia at the joint, kg m^2.
    pub inertia: f64,
    /// Bus voltage, V.
    pub bus: f64,
    /// Dead time of the bridge, s.
    pub dead_time: f64,
    /// Coulomb friction of the seal, Nm.
    pub coulomb: f64,
    /// Static friction of the seal, Nm.
    pub static_level: f64,
    /// Stribeck velocity of the seal, rad/s.
    pub stribeck_velocity: f64,
    /// Presliding stiffness of the seal, Nm/rad.
    pub stiffness: f64,
    /// Viscous friction, Nm s/rad.
    pub viscous: f64,
    /// True if the joint is fixed.
    pub clamped: bool,
    /// Joint velocity if it is imposed, rad/s.
    pub driven: Option<f64>,
}

impl Default for Machine {
    /// Differs from the loop's default motor by 2 % in its constants, and by 15 % in resistance (a warm winding).
    fn default() -> Self {
        Self {
            pole_pairs: 7.0,
            gear: 51.0,
            resistance: 0.12 * 1.15,
            inductance_d: 90e-6 * 0.98,
            inductance_q: 90e-6 * 1.02,
            flux: 0.0196 / (1.5 * 7.0) * 0.98,
            inertia: 0.25,
            bus: 48.0,
            dead_time: 0.3e-6,
            coulomb: 1.5,
            static_level: 2.2,
            stribeck_velocity: 0.1,
            stiffness: 1e4,
            viscous: 0.08,
            clamped: false,
            driven: None,
        }
    }
}

/// State of the integration, or its rate of change.
#[derive(Clone, Copy, Debug, Default)]
struct State {
    /// Current on the magnet's axis, A.
    d: f64,
    /// Current across the magnet's axis, A.
    q: f64,
    /// Joint position, rad.
    position: f64,
    /// Joint velocity, rad/s.
    velocity: f64,
}

impl State {
    fn advanced(self, rate: Self, dt: f64) -> Self {
        Self {
            d: self.d + rate.d * dt,
            q: self.q + rate.q * dt,
            position: self.position + rate.position * dt,
            velocity: self.velocity + rate.velocity * dt,
        }
    }
}

/// A machine and its state.
#[derive(Clone, Debug)]
pub struct Plant {
    pub machine: Machine,
    state: State,
    /// Fixed ends of the seal's springs, rad.
    anchors: [f64; ELEMENTS],
    /// Load torque, Nm. Positive values oppose positive motion.
    pub load: f64,
}

impl Plant {
    pub fn new(machine: Machine) -> Self {
        let velocity = machine.driven.unwrap_or(0.0);
        let state = State { velocity, ..State::default() };
        Self { machine, state, anchors: [0.0; ELEMENTS], load: 0.0 }
    }

    pub fn position(&self) -> f64 {
        self.state.position
    }

    pub fn velocity(&self) -> f64 {
        self.state.velocity
    }

    /// Returns the currents on the plant's d and q axes, A.
    pub fn current(&self) -> [f64; 2] {
        [self.state.d, self.state.q]
    }

    /// Returns the angle of the motor, rad.
    pub fn motor_angle(&self) -> f64 {
        self.state.position * self.machine.gear
    }

    /// Returns the phase currents, A.
    pub fn phase_currents(&self) -> [f64; 3] {
        phase_currents(&self.state, self.electrical_angle(&self.state))
    }

    /// Returns the electrical angle, rad.
    fn electrical_angle(&self, state: &State) -> f64 {
        state.position * self.machine.gear * self.machine.pole_pairs
    }

    /// Returns the torque at which all elements slip, Nm.
    fn slip_torque(&self, velocity: f64) -> f64 {
        let m = &self.machine;
        let share = (-(velocity / m.stribeck_velocity).powi(2)).exp();
        m.coulomb + (m.static_level - m.coulomb) * share
    }

    /// Returns the friction torque for the present anchors, Nm.
    fn friction(&self, state: &State) -> f64 {
        let slip_torque = self.slip_torque(state.velocity);
        let element_torques = self.anchors.iter().enumerate().map(|(index, anchor)| {
            let (share, stiffness) = self.element(index);
            let bound = share * slip_torque;
            (stiffness * (state.position - anchor)).clamp(-bound, bound)
        });
        element_torques.sum::<f64>() + self.machine.viscous * state.velocity
    }

    /// Returns an element's share of the slip torque and its stiffness, Nm/rad. Elements with a small share slip first.
    fn element(&self, index: usize) -> (f64, f64) {
        let count = ELEMENTS as f64;
        let share = (index as f64 + 1.0) / (count * (count + 1.0) / 2.0);
        (share, self.machine.stiffness / count)
    }

    /// Returns the rate of change of the state. `voltage` gives the phase voltages for phase currents.
    fn rate(&self, state: &State, voltage: impl Fn(&[f64; 3]) -> [f64; 3]) -> State {
        let m = &self.machine;
        let angle = self.electrical_angle(state);
        let [a, b, c] = voltage(&phase_currents(state, angle));
        // Projections of the phase voltages on the axes. The common-mode voltage cancels.
        let third = TAU / 3.0;
        let project = |angle: f64| {
            2.0 / 3.0 * (a * angle.cos() + b * (angle - third).cos() + c * (angle + third).cos())
        };
        let (v_d, v_q) = (project(angle), project(angle + TAU / 4.0));
        let electrical_rad_s = state.velocity * m.gear * m.pole_pairs;
        let torque = 1.5
            * m.pole_pairs
            * (m.flux + (m.inductance_d - m.inductance_q) * state.d)
            * state.q
            * m.gear;
        let is_free = !m.clamped && m.driven.is_none();
        let acceleration = (torque - self.friction(state) - self.load) / m.inertia;
        State {
            d: (v_d - m.resistance * state.d + electrical_rad_s * m.inductance_q * state.q)
                / m.inductance_d,
            q: (v_q
                - m.resistance * state.q
                - electrical_rad_s * (m.inductance_d * state.d + m.flux))
                / m.inductance_q,
            position: if m.clamped { 0.0 } else { state.velocity },
            velocity: if is_free { acceleration } else { 0.0 },
        }
    }

    /// Simulates one period, s, with the given duties. `None` is an open bridge.
    pub fn advance(&mut self, period: f64, duty: Option<[f64; 3]>) {
        let (bus, dead_time_v) =
            (self.machine.bus, self.machine.bus * self.machine.dead_time / period);
        // The transition at zero current is smooth, because the integration needs a continuous voltage.
        let voltage = |current: &[f64; 3]| -> [f64; 3] {
            std::array::from_fn(|i| match duty {
                Some(duty) => duty[i] * bus - dead_time_v * (current[i] / 0.1).tanh(),
                None => -0.5 * bus * (current[i] / 0.5).tanh(),
            })
        };
        let dt = period / STEPS as f64;
        for _ in 0..STEPS {
            let s = self.state;
            let k1 = self.rate(&s, voltage);
            let k2 = self.rate(&s.advanced(k1, dt / 2.0), voltage);
            let k3 = self.rate(&s.advanced(k2, dt / 2.0), voltage);
            let k4 = self.rate(&s.advanced(k3, dt), voltage);
            for (k, weight) in [(k1, 1.0), (k2, 2.0), (k3, 2.0), (k4, 1.0)] {
                self.state = self.state.advanced(k, dt * weight / 6.0);
            }
            self.slip();
        }
    }

    /// Moves the anchors of elements whose springs exceed their slip torque.
    fn slip(&mut self) {
        let slip_torque = self.slip_torque(self.state.velocity);
        for index in 0..ELEMENTS {
            let (share, stiffness) = self.element(index);
            let max_stretch = share * slip_torque / stiffness;
            let position = self.state.position;
            self.anchors[index] =
                self.anchors[index].clamp(position - max_stretch, position + max_stretch);
        }
    }
}

/// Returns the phase currents at an electrical angle, A.
fn phase_currents(state: &State, angle: f64) -> [f64; 3] {
    let third = TAU / 3.0;
    [0.0, third, -third]
        .map(|shift| state.d * (angle - shift).cos() - state.q * (angle - shift).sin())
}
