//! A motor, its bridge and a joint with a rubbing seal: own equations, double precision.
//!
//! dq equations of the winding with back-EMF and cross-coupling, one inertia behind a rigid gear, and a
//! seal of Maxwell slip elements (springs that slip at their share of a Stribeck level): a friction law
//! with presliding and stiction that is not LuGre and has no bristle equation. Runge-Kutta of fourth
//! order, 20 steps a period. The bridge gives each phase its mean voltage less what the dead time takes;
//! open, its diodes drive the currents to 0.

use std::f64::consts::TAU;

/// Integration steps in a period.
const STEPS: usize = 20;

/// Slip elements of the seal.
const ELEMENTS: usize = 8;

/// The machine's constants.
#[derive(Clone, Copy, Debug)]
pub struct Machine {
    pub pole_pairs: f64,
    pub gear: f64,
    pub resistance: f64,
    pub inductance_d: f64,
    pub inductance_q: f64,
    /// Flux of the magnet, Vs.
    pub flux: f64,
    /// At the joint, kg m^2.
    pub inertia: f64,
    pub bus: f64,
    pub dead_time: f64,
    /// Seal: Coulomb and static level Nm, Stribeck velocity rad/s, stiffness Nm/rad, viscous Nm s/rad.
    pub coulomb: f64,
    pub static_level: f64,
    pub stribeck_velocity: f64,
    pub stiffness: f64,
    pub viscous: f64,
    /// The joint does not turn.
    pub clamped: bool,
    /// The joint turns at this speed whatever the torque, rad/s.
    pub driven: Option<f64>,
}

impl Default for Machine {
    /// The motor of the loop's defaults, 2 % off in every constant and 15 % in resistance (warm).
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

/// What is integrated.
#[derive(Clone, Copy, Debug, Default)]
struct State {
    d: f64,
    q: f64,
    /// Joint, rad and rad/s.
    position: f64,
    velocity: f64,
}

impl State {
    fn moved(self, rate: Self, dt: f64) -> Self {
        Self {
            d: self.d + rate.d * dt,
            q: self.q + rate.q * dt,
            position: self.position + rate.position * dt,
            velocity: self.velocity + rate.velocity * dt,
        }
    }
}

/// A machine in motion.
#[derive(Clone, Debug)]
pub struct Plant {
    pub machine: Machine,
    state: State,
    anchors: [f64; ELEMENTS],
    /// Load torque against positive motion, Nm.
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

    /// Current along and across the true magnet, A.
    pub fn current(&self) -> [f64; 2] {
        [self.state.d, self.state.q]
    }

    /// The motor's angle, rad.
    pub fn motor_angle(&self) -> f64 {
        self.state.position * self.machine.gear
    }

    /// Phase currents, A.
    pub fn phases(&self) -> [f64; 3] {
        phases(&self.state, self.electrical(&self.state))
    }

    fn electrical(&self, state: &State) -> f64 {
        state.position * self.machine.gear * self.machine.pole_pairs
    }

    /// Level of all elements together, Nm.
    fn level(&self, velocity: f64) -> f64 {
        let m = &self.machine;
        let share = (-(velocity / m.stribeck_velocity).powi(2)).exp();
        m.coulomb + (m.static_level - m.coulomb) * share
    }

    /// Torque of the elements, where their anchors are, Nm.
    fn friction(&self, state: &State) -> f64 {
        let level = self.level(state.velocity);
        let held = self.anchors.iter().enumerate().map(|(index, anchor)| {
            let (share, stiffness) = self.element(index);
            let bound = share * level;
            (stiffness * (state.position - anchor)).clamp(-bound, bound)
        });
        held.sum::<f64>() + self.machine.viscous * state.velocity
    }

    /// Share of the level, and stiffness, of an element: the weak slip first.
    fn element(&self, index: usize) -> (f64, f64) {
        let count = ELEMENTS as f64;
        let share = (index as f64 + 1.0) / (count * (count + 1.0) / 2.0);
        (share, self.machine.stiffness / count)
    }

    fn rate(&self, state: &State, voltage: impl Fn(&[f64; 3]) -> [f64; 3]) -> State {
        let m = &self.machine;
        let angle = self.electrical(state);
        let [a, b, c] = voltage(&phases(state, angle));
        // Projections on the axes; a voltage common to all three drops out.
        let third = TAU / 3.0;
        let along = |angle: f64| {
            2.0 / 3.0 * (a * angle.cos() + b * (angle - third).cos() + c * (angle + third).cos())
        };
        let (v_d, v_q) = (along(angle), along(angle + TAU / 4.0));
        let turning = state.velocity * m.gear * m.pole_pairs;
        let torque = 1.5
            * m.pole_pairs
            * (m.flux + (m.inductance_d - m.inductance_q) * state.d)
            * state.q
            * m.gear;
        let moves = !m.clamped && m.driven.is_none();
        let acceleration = (torque - self.friction(state) - self.load) / m.inertia;
        State {
            d: (v_d - m.resistance * state.d + turning * m.inductance_q * state.q) / m.inductance_d,
            q: (v_q - m.resistance * state.q - turning * (m.inductance_d * state.d + m.flux))
                / m.inductance_q,
            position: if m.clamped { 0.0 } else { state.velocity },
            velocity: if moves { acceleration } else { 0.0 },
        }
    }

    /// One period with these duties, or with the bridge open.
    pub fn period(&mut self, period: f64, duty: Option<[f64; 3]>) {
        let (bus, lost) = (self.machine.bus, self.machine.bus * self.machine.dead_time / period);
        // Smooth within 0.1 A, so that the integrator sees no jump.
        let voltage = |current: &[f64; 3]| -> [f64; 3] {
            std::array::from_fn(|i| match duty {
                Some(duty) => duty[i] * bus - lost * (current[i] / 0.1).tanh(),
                None => -0.5 * bus * (current[i] / 0.5).tanh(),
            })
        };
        let dt = period / STEPS as f64;
        for _ in 0..STEPS {
            let s = self.state;
            let k1 = self.rate(&s, voltage);
            let k2 = self.rate(&s.moved(k1, dt / 2.0), voltage);
            let k3 = self.rate(&s.moved(k2, dt / 2.0), voltage);
            let k4 = self.rate(&s.moved(k3, dt), voltage);
            for (k, weight) in [(k1, 1.0), (k2, 2.0), (k3, 2.0), (k4, 1.0)] {
                self.state = self.state.moved(k, dt * weight / 6.0);
            }
            self.slip();
        }
    }

    /// Anchors follow where their springs are stretched beyond their level.
    fn slip(&mut self) {
        let level = self.level(self.state.velocity);
        for index in 0..ELEMENTS {
            let (share, stiffness) = self.element(index);
            let reach = share * level / stiffness;
            let position = self.state.position;
            self.anchors[index] = self.anchors[index].clamp(position - reach, position + reach);
        }
    }
}

fn phases(state: &State, angle: f64) -> [f64; 3] {
    let third = TAU / 3.0;
    [0.0, third, -third]
        .map(|shift| state.d * (angle - shift).cos() - state.q * (angle - shift).sin())
}
