//! The driver finds out by itself what motor it drives: at low current, a step at a time, every step bounded.
//!
//! ```text
//! offsets -> R: two currents along a field that stands -> L: a square wave on top, along and across it
//!         -> turn slowly there and back: pole pairs, direction, electrical zero -> turn faster: flux -> down
//! ```
//! Two currents, because the dead time takes a voltage that does not depend on the current: the slope is R. A field that is
//! ahead of the rotor by what friction takes is behind it on the way back: the mean of both is the zero, half of the
//! difference the friction. Over a whole turn of the motor, cogging and the magnet's eccentricity fall out. Flux is found
//! *across* the current, where neither resistance nor dead time is: `-v i_across = w L i^2 + w psi (i_d cos lag - i_q sin lag)`.
//!
//! It runs in the background, a step a millisecond, on what [`crate::control::probe`] gives. Nobody needs to be
//! trusted for it: current, voltage, travel, time and the master's sign of life are bounded, and whatever ends it opens the
//! bridge. What it finds is staged; it counts when it is committed, as any parameter, and somebody confirms it.

pub mod friction_run;
mod progress;
mod turning;

use crate::control::PERIOD_S;
use crate::control::probe::{BLOCK, HALF_WAVE, ProbeOrder, ProbeReport};
use crate::control::transform::RAD_PER_UNIT;
use core::f32::consts::{PI, TAU};
pub use progress::{Reason, Step};
use turning::{Gear, Turning, Window};

/// What a run may do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Current along the field, A.
    pub current_a: f32,
    /// How far the joint may go to either side, rad.
    pub travel_rad: f32,
    /// Turns of the motor in one of the joint.
    pub gear_ratio: f32,
    /// Bus voltage when it began, V.
    pub bus_v: f32,
}

/// What a run found. 0 where it has not come so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Found {
    /// Offsets taken off the currents of phases a and b, A.
    pub offset_a: [f32; 2],
    /// Resistance of a phase, ohm: winding, cable and switch.
    pub resistance_ohm: f32,
    /// Inductance along and across the magnet, H.
    pub inductance_h: [f32; 2],
    /// Pole pairs.
    pub pole_pairs: u8,
    /// 1, or -1 where the encoder counts down when phases a, b, c follow each other.
    pub encoder_direction: i8,
    /// The encoder's angle where the magnet lies along phase a, rad of the motor.
    pub encoder_offset_rad: f32,
    /// How far friction holds the rotor behind a slow field, rad (electrical).
    pub lag_rad: f32,
    /// Flux of the magnet through a phase, Vs.
    pub flux_vs: f32,
}

impl Found {
    /// The motor's torque per current, Nm/A.
    pub fn torque_constant_nm_per_a(&self) -> f32 {
        1.5 * f32::from(self.pole_pairs) * self.flux_vs
    }
}

/// Half of the current is all of it by so much.
const HALF: f32 = 0.5;
/// The voltage begins here, V, and grows by this share a block: twentyfold in 0.75 s, and 1 % while an answer is on its way.
const VOLTAGE_BEGIN_V: f32 = 0.02;
const VOLTAGE_GROWS: f32 = 1.004;
/// Share of the bus that is tried, of the 0.58 of the circle.
const VOLTAGE_SHARE: f32 = 0.23;
/// Blocks a level is held: until the rotor has come to rest on it, and to take the mean.
const SETTLE: u32 = 300;
const MEAN: u32 = 300;
/// The square wave's share of the current: phases b and c carry half of it, and none may come to 0.
const SQUARE_SHARE: f32 = 0.15;
/// Least share that is a measurement, where the bus does not give more.
const SQUARE_LEAST: f32 = 0.02;
const SQUARE_GROWS: f32 = 1.01;
/// Blocks in which the current goes down.
const DOWN: u32 = 100;
/// Blocks until a bridge that is ordered on has to give its first, with its amplifiers' waking and offsets.
const ANSWER: u32 = 400;
/// Blocks a run may take, a minute.
const LONGEST: u32 = 60_000;
/// The field's speeds, turns (electrical) per second. The faster one is less where the voltage it induces would be more
/// than a quarter of what drives the current.
const SLOW_HZ: f32 = 4.0;
const FAST_HZ: f32 = 24.0;
const INDUCED_SHARE: f32 = 0.35;
/// Shares of the current that are seen while the field turns: least along it, most across it.
const ALONG_LEAST: f32 = 0.4;
const ACROSS_MOST: f32 = 0.6;
/// Turns of the field in one of the encoder are a whole number within this.
const WHOLE_WITHIN: f32 = 0.15;
/// Farthest friction may hold the rotor behind.
const LAG_MAX_RAD: f32 = PI / 3.0;

/// Sums over blocks.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    blocks: u32,
    voltage_v: f32,
    along_a: f32,
    across_a: f32,
    response_a: f32,
}

impl Sums {
    fn add(&mut self, block: &ProbeReport, axis: usize) {
        self.blocks += 1;
        self.voltage_v += block.along_v;
        self.along_a += block.along_a;
        self.across_a += block.across_a;
        self.response_a += block.response_a.get(axis).copied().unwrap_or(0.0);
    }

    fn mean(&self) -> Self {
        let share = 1.0 / self.blocks.max(1) as f32;
        Self {
            blocks: self.blocks,
            voltage_v: self.voltage_v * share,
            along_a: self.along_a * share,
            across_a: self.across_a * share,
            response_a: self.response_a * share,
        }
    }
}

/// A run, and what the last one found.
#[derive(Clone, Copy, Debug)]
pub struct Commissioning {
    step: Step,
    reason: Reason,
    bounds: Bounds,
    found: Found,
    order: ProbeOrder,
    /// Number of the last block.
    seen: u32,
    /// Blocks in the step, in all, and those in a row that did not come.
    blocks: u32,
    all: u32,
    missing: u32,
    /// The level is reached, and held.
    holds: bool,
    sums: Sums,
    half: Sums,
    turning: Turning,
    gear: Gear,
    /// The window of the slow way there, and the flux of the fast one, Vs.
    there: Window,
    flux_there_vs: f32,
    /// The encoder's last angle, and how far it has turned since the run began, 2^-32 turns.
    encoder: (u32, i64),
}

impl Default for Commissioning {
    fn default() -> Self {
        Self {
            step: Step::Idle,
            reason: Reason::None,
            bounds: Bounds { current_a: 0.0, travel_rad: 0.0, gear_ratio: 1.0, bus_v: 0.0 },
            found: Found::default(),
            order: ProbeOrder {
                run: 0,
                along_v: 0.0,
                square_v: [0.0; 2],
                turn: 0,
                dead_v: 0.0,
                trip_a: 0.0,
            },
            seen: 0,
            blocks: 0,
            all: 0,
            missing: 0,
            holds: false,
            sums: Sums::default(),
            half: Sums::default(),
            turning: Turning::default(),
            gear: Gear::default(),
            there: Window::default(),
            flux_there_vs: 0.0,
            encoder: (0, 0),
        }
    }
}

impl Commissioning {
    /// Begins a run.
    pub fn begin(&mut self, bounds: Bounds) {
        let run = self.order.run.wrapping_add(1);
        *self = Self { step: Step::Offsets, bounds, ..Self::default() };
        self.order.run = run;
        self.order.trip_a = 1.5 * bounds.current_a + 0.5;
    }

    /// Ends a run; one that has ended stays as it is.
    pub fn end(&mut self, reason: Reason) {
        if self.is_running() {
            (self.step, self.reason) = (Step::Aborted, reason);
        }
    }

    /// Whether it needs the bridge.
    pub fn is_running(&self) -> bool {
        !matches!(self.step, Step::Idle | Step::Done | Step::Aborted)
    }

    /// What it may do.
    pub const fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// Where it is.
    pub const fn step(&self) -> Step {
        self.step
    }

    /// Why it ended.
    pub const fn reason(&self) -> Reason {
        self.reason
    }

    /// What was found.
    pub const fn found(&self) -> &Found {
        &self.found
    }

    /// What the interrupt is to do, while it runs.
    pub fn order(&self) -> Option<ProbeOrder> {
        self.is_running().then_some(self.order)
    }

    /// Once a millisecond: the last block. Gives whether the run has just found everything.
    pub fn take(&mut self, block: &ProbeReport) -> bool {
        if !self.is_running() {
            return false;
        }
        self.all += 1;
        self.blocks += 1;
        if self.all > LONGEST {
            self.end(Reason::Time);
            return false;
        }
        let fresh = block.run == self.order.run && block.number != self.seen;
        if !fresh {
            self.missing += 1;
            if self.missing > ANSWER {
                self.end(Reason::NoAnswer);
            }
            return false;
        }
        (self.seen, self.missing) = (block.number, 0);
        if block.tripped {
            self.end(Reason::Overcurrent);
            return false;
        }
        if self.step == Step::Offsets {
            self.encoder = (block.encoder, 0);
            self.found.offset_a = block.offset_a;
            self.order.along_v = VOLTAGE_BEGIN_V;
            self.enter(Step::HalfCurrent);
            return false;
        }
        let moved = block.encoder.wrapping_sub(self.encoder.0) as i32;
        self.encoder = (block.encoder, self.encoder.1 + i64::from(moved));
        let joint_rad = self.encoder.1 as f32 * (TAU / 4_294_967_296.0) / self.bounds.gear_ratio;
        if joint_rad.abs() > self.bounds.travel_rad {
            self.end(Reason::Travel);
            return false;
        }
        if let Err(reason) = self.go_on(block) {
            self.end(reason);
        }
        self.step == Step::Done
    }

    fn enter(&mut self, step: Step) {
        self.step = step;
        self.blocks = 0;
        self.holds = false;
        self.sums = Sums::default();
        self.order.square_v = [0.0; 2];
        let hz = match step {
            Step::SlowForward => SLOW_HZ,
            Step::SlowBack => -SLOW_HZ,
            Step::FastForward => self.fast_hz(),
            Step::FastBack => -self.fast_hz(),
            _ => return,
        };
        let Bounds { travel_rad, gear_ratio, .. } = self.bounds;
        self.turning = Turning::begin(hz, travel_rad * gear_ratio, self.gear);
    }

    fn go_on(&mut self, block: &ProbeReport) -> Result<(), Reason> {
        match self.step {
            Step::HalfCurrent => {
                if let Some(mean) = self.level(block, HALF)? {
                    self.half = mean;
                    self.enter(Step::FullCurrent);
                }
            }
            Step::FullCurrent => {
                if let Some(mean) = self.level(block, 1.0)? {
                    let ohm =
                        (mean.voltage_v - self.half.voltage_v) / (mean.along_a - self.half.along_a);
                    self.found.resistance_ohm = within(ohm, 1e-4, 1e3)?;
                    // Phase a takes it one way, b and c the other: four thirds of a phase's along the field.
                    // No `clamp`: bounds that are no constants bring the formatting of floats for its panic, 15 KB.
                    let taken_v =
                        (mean.voltage_v - ohm * mean.along_a).max(0.0).min(mean.voltage_v);
                    self.order.dead_v = 0.75 * taken_v;
                    self.order.along_v -= taken_v;
                    self.enter(Step::InductanceAlong);
                }
            }
            Step::InductanceAlong => self.inductance(block, 0, Step::InductanceAcross)?,
            Step::InductanceAcross => self.inductance(block, 1, Step::SlowForward)?,
            Step::SlowForward | Step::SlowBack | Step::FastForward | Step::FastBack => {
                self.turn(block)?;
            }
            Step::Down => {
                let left = (DOWN + 1).saturating_sub(self.blocks).max(1);
                self.order.along_v -= self.order.along_v / left as f32;
                if self.blocks >= DOWN {
                    self.step = Step::Done;
                }
            }
            Step::Idle | Step::Offsets | Step::Done | Step::Aborted | Step::Rubbing => {}
        }
        Ok(())
    }

    /// Raises the voltage until this share of the current flows; gives the mean after it was held.
    fn level(&mut self, block: &ProbeReport, share: f32) -> Result<Option<Sums>, Reason> {
        if !self.holds {
            if block.along_a >= share * self.bounds.current_a {
                self.holds = true;
                self.blocks = 0;
            } else if self.order.along_v > VOLTAGE_SHARE * self.bounds.bus_v {
                return Err(Reason::NoCurrent);
            } else {
                self.order.along_v *= VOLTAGE_GROWS;
            }
            return Ok(None);
        }
        if self.blocks <= SETTLE {
            return Ok(None);
        }
        self.sums.add(block, 0);
        if self.blocks < SETTLE + MEAN {
            return Ok(None);
        }
        let mean = self.sums.mean();
        if mean.across_a.abs() > 0.25 * mean.along_a {
            return Err(Reason::NotAlong);
        }
        Ok(Some(mean))
    }

    /// Raises the square wave until it is seen; `x = v/R tanh(R n T / 2L)` of its response gives L.
    fn inductance(&mut self, block: &ProbeReport, axis: usize, next: Step) -> Result<(), Reason> {
        let Some(square_v) = self.order.square_v.get_mut(axis) else { return Ok(()) };
        let most_v = VOLTAGE_SHARE * self.bounds.bus_v;
        let response_a = block.response_a.get(axis).copied().unwrap_or(0.0);
        if !self.holds {
            if response_a >= SQUARE_SHARE * self.bounds.current_a || *square_v > most_v {
                self.holds = true;
                self.blocks = 0;
            } else {
                *square_v = (*square_v * SQUARE_GROWS).max(VOLTAGE_BEGIN_V);
            }
            return Ok(());
        }
        if self.blocks <= SETTLE / 3 {
            return Ok(());
        }
        self.sums.add(block, axis);
        if self.blocks < SETTLE / 3 + MEAN {
            return Ok(());
        }
        let square_v = *square_v;
        let mean = self.sums.mean();
        let ratio = mean.response_a * self.found.resistance_ohm / square_v;
        let clear = mean.response_a >= SQUARE_LEAST * self.bounds.current_a && ratio < 0.95;
        if !clear {
            return Err(Reason::InductanceUnclear);
        }
        let doubled = libm::logf((1.0 + ratio) / (1.0 - ratio));
        let half_wave_s = HALF_WAVE as f32 * PERIOD_S;
        let henry = within(self.found.resistance_ohm * half_wave_s / doubled, 1e-7, 1.0)?;
        if let Some(place) = self.found.inductance_h.get_mut(axis) {
            *place = henry;
        }
        self.enter(next);
        Ok(())
    }

    /// The field turns, at its speed over a whole turn of the motor.
    fn turn(&mut self, block: &ProbeReport) -> Result<(), Reason> {
        // A rotor that runs away from the field takes the current's direction with it; so does a phase that is open.
        let current_a = self.bounds.current_a;
        let along = block.along_a >= ALONG_LEAST * current_a;
        if !along || block.across_a.abs() > ACROSS_MOST * current_a {
            return Err(Reason::NotAlong);
        }
        let had = self.turning.window.blocks;
        self.turning.step(block, self.encoder.1, &mut self.order.turn)?;
        let window = self.turning.window;
        if window.blocks > had {
            self.sums.add(block, 0);
        }
        if !self.turning.is_over() {
            return Ok(());
        }
        match self.step {
            Step::SlowForward => {
                self.there = window;
                self.enter(Step::SlowBack);
            }
            Step::SlowBack => {
                self.zero(&window)?;
                // Roughly: how far the rotor is behind at which block is not known yet.
                self.found.flux_vs = self.flux(-SLOW_HZ, (1.0, 0.0));
                self.enter(Step::FastForward);
            }
            Step::FastForward => {
                self.flux_there_vs = self.flux(self.fast_hz(), window.behind());
                self.enter(Step::FastBack);
            }
            _ => {
                let back_vs = self.flux(-self.fast_hz(), window.behind());
                self.found.flux_vs = within(0.5 * (self.flux_there_vs + back_vs), 1e-7, 1e2)?;
                self.enter(Step::Down);
            }
        }
        Ok(())
    }

    /// Pole pairs, direction and zero, from the ways there and back.
    fn zero(&mut self, back: &Window) -> Result<(), Reason> {
        let turns = [self.there.turns_of_field(), back.turns_of_field()];
        let pole_pairs = (turns[0].abs() + 0.5) as u8 as f32;
        let sound = |turns: f32| (turns.abs() - pole_pairs).abs() < WHOLE_WITHIN;
        let alike = (turns[0] > 0.0) == (turns[1] > 0.0);
        if !(1.0..=64.0).contains(&pole_pairs) || !alike || !turns.into_iter().all(sound) {
            return Err(Reason::PolePairsUnclear);
        }
        let direction = if turns[0] > 0.0 { 1 } else { -1 };
        let signed = direction * pole_pairs as i64;
        let (there, back) = (self.there.apart(signed), back.apart(signed));
        let lag = there.wrapping_sub(back) as i32 / 2;
        let zero = back.wrapping_add(lag as u32);
        self.found.lag_rad = lag as f32 * RAD_PER_UNIT;
        if self.found.lag_rad.abs() > LAG_MAX_RAD {
            return Err(Reason::LagTooGreat);
        }
        self.gear = Gear { zero, signed };
        self.found.pole_pairs = pole_pairs as u8;
        self.found.encoder_direction = direction as i8;
        self.found.encoder_offset_rad = -(zero as i32 as f32) * RAD_PER_UNIT / signed as f32;
        Ok(())
    }

    /// The faster speed, turns (electrical) per second: by the flux that the slower one has shown.
    fn fast_hz(&self) -> f32 {
        let driving_v = self.found.resistance_ohm * self.bounds.current_a;
        let bound_hz = INDUCED_SHARE * driving_v / (TAU * self.found.flux_vs.max(1e-7));
        bound_hz.clamp(SLOW_HZ, FAST_HZ)
    }

    /// Flux by the mean current of the step at a speed, and cosine and sine of how far the rotor is behind.
    fn flux(&self, hz: f32, (cosine, sine): (f32, f32)) -> f32 {
        let Sums { voltage_v, along_a, across_a, .. } = self.sums.mean();
        let speed = TAU * hz;
        let [inductance_h, _] = self.found.inductance_h;
        let stored = speed * inductance_h * (along_a * along_a + across_a * across_a);
        (-voltage_v * across_a - stored) / (speed * (along_a * cosine - across_a * sine))
    }
}

/// A value within its parameter's range.
fn within(value: f32, least: f32, most: f32) -> Result<f32, Reason> {
    if value >= least && value <= most { Ok(value) } else { Err(Reason::OutOfRange) }
}

/// Reports of the loop come once a block.
const _: () = assert!((BLOCK as f32 * PERIOD_S - crate::driver::REPORT_PERIOD_S).abs() < 1e-9);
