//! Loop gains from a measured frequency response.
//!
//! ```text
//! G(f) = velocity / current        measured on a slide with a superposed multisine, observer included
//! L(f) = C(f) G(f) exp(-j 2 pi f T)    C = gain (1 + 1 / (j 2 pi f Ti)), T the delay of the loop
//! ```
//! The response is measured in closed loop. The demanded velocity is the instrument: `G = S_vr / S_ir`, the ratio of the cross
//! spectra with the demand, has no bias by noise in the loop (Ljung, System Identification, 13.5). On a slide the friction keeps
//! its sign, so that the response is that of the mechanics.
//!
//! [`design`] chooses the largest gain with a phase margin of 50 degrees at every crossover, a gain margin of 8 dB and a peak of
//! the sensitivity of 1.8. A resonance may cross over again; what the joint follows ends at the first crossover. The gain of the
//! position loop is the largest one up to 0.35 of it whose own loop has a sensitivity of at most 1.6.

use crate::motion::{Motion, MotionBuilder, MotionLimits, TARGET_PERIOD_S};
use crate::recording::Recording;
use friction_results::tune::TuneLoop;
use std::f64::consts::{PI, TAU};

/// Length of a window with whole periods of all lines, s.
const WINDOW_S: f64 = 0.5;
/// Lines of the multisine, Hz: multiples of 2 Hz, about equally spaced on a logarithmic axis.
const LINES_HZ: [f64; 12] = [2.0, 4.0, 6.0, 8.0, 12.0, 16.0, 22.0, 30.0, 40.0, 52.0, 66.0, 80.0];
/// Delay from a report to the torque that answers it, s: the step of the velocity loop, and half of its hold.
const LOOP_DELAY_S: f64 = 1.5e-3;
/// Required phase margin, degrees, gain margin, dB, and peak of the sensitivity.
const PHASE_MARGIN_DEG: f64 = 50.0;
const GAIN_MARGIN_DB: f64 = 8.0;
const SENSITIVITY_PEAK: f64 = 1.8;
/// Peak of the sensitivity of the position loop.
const POSITION_SENSITIVITY_PEAK: f64 = 1.6;
/// Largest change of the velocity gain in one session, as a ratio.
const MAX_CHANGE: f64 = 10.0;
/// Steps of the gain within this change.
const GAIN_STEPS: i32 = 40;
/// Largest share of the first crossover, rad/s, that the position gain has.
const POSITION_SHARE: f64 = 0.35;
/// Fewest lines of a response from which gains are designed: half of them.
const LEAST_LINES: usize = 6;
/// Largest relative standard error of a line that is used.
const MAX_LINE_ERROR: f64 = 0.3;

type Complex = nalgebra::Complex<f64>;

/// Name of the motion of the measurement.
pub const NAME: &str = "slides with a multisine";

/// Returns the motion of the measurement: slides both ways with a superposed multisine that never reverses them. `None` if the
/// range is too small for a window at a useful speed.
pub fn motion(limits: &MotionLimits) -> Option<Motion> {
    let range = 0.95 * limits.range_rad;
    // A slide has its ramps, a window in which the joint settles, and two that are evaluated.
    let speed = (0.35 * limits.speed_rad_s).min(2.0 * range / (3.0 * WINDOW_S + 0.4));
    if speed < 0.05 {
        return None;
    }
    let mut builder =
        MotionBuilder::new(*limits).stroke(-range, 0.5 * limits.speed_rad_s).rest(0.1);
    let multisine = multisine_rad(0.6 * speed);
    for slide in 0..SLIDES {
        let to = if slide % 2 == 0 { range } else { -range };
        let from = builder.positions().len();
        builder = builder.stroke(to, speed);
        let count = builder.positions().len() - from;
        let windows = (count.saturating_sub(20)) / multisine.len();
        let start = from + (count - windows * multisine.len()) / 2;
        for window in 0..windows {
            builder = builder.superpose(start + window * multisine.len(), &multisine);
        }
    }
    Some(builder.finish(NAME))
}

/// Number of slides.
const SLIDES: usize = 4;

/// Returns the positions of a window of the multisine with this largest speed, rad/s; 0 at its ends. All lines have the same
/// velocity, with Schroeder's phases.
fn multisine_rad(peak_rad_s: f64) -> Vec<f64> {
    let count = (WINDOW_S / TARGET_PERIOD_S).round() as usize;
    let lines = LINES_HZ.len() as f64;
    let at = |step: usize| {
        let time = step as f64 * TARGET_PERIOD_S;
        let wave = |(place, hz): (usize, &f64)| {
            let phase = -PI * place as f64 * (place as f64 + 1.0) / lines;
            [(TAU * hz * time + phase).sin() / (TAU * hz), (TAU * hz * time + phase).cos()]
        };
        LINES_HZ.iter().enumerate().map(wave).fold([0.0, 0.0], |a, b| [a[0] + b[0], a[1] + b[1]])
    };
    let waves: Vec<[f64; 2]> = (0..count).map(at).collect();
    let peak = waves.iter().fold(0.0f64, |most, [_, speed]| most.max(speed.abs()));
    let first = waves.first().map_or(0.0, |wave| wave[0]);
    waves.iter().map(|[position, _]| (position - first) * peak_rad_s / peak).collect()
}

/// A line of a frequency response.
#[derive(Clone, Copy, Debug)]
struct Line {
    hz: f64,
    value: Complex,
}

/// Returns the response from current to velocity at the lines whose error is small, in rad/s per A.
fn response(recording: &Recording, nm_per_a: f64) -> Vec<Line> {
    let rows = &recording.rows;
    let period_s = recording.seconds() / (rows.len().max(2) - 1) as f64;
    let count = (WINDOW_S / period_s).round() as usize;
    let demand: Vec<f64> = rows.iter().map(|row| row.demand_rad()).collect();
    let windows = steady_windows(&demand, count);
    let line = |hz: f64| {
        // A window has whole periods of every line, so that no line leaks into another without a taper.
        let of = |from: usize, value: &dyn Fn(usize) -> f64| {
            let mean = (from..from + count).map(value).sum::<f64>() / count as f64;
            let wave = |step: usize| {
                let angle = -TAU * hz * step as f64 * period_s;
                Complex::from_polar(1.0, angle) * (value(from + step) - mean)
            };
            (0..count).map(wave).sum::<Complex>()
        };
        let cross: Vec<[Complex; 2]> = windows
            .iter()
            .map(|from| {
                let slope = (demand[from + count] - demand[*from]) / count as f64;
                let instrument = of(*from, &|at| demand[at] - slope * (at - from) as f64);
                let velocity = of(*from, &|at| rows[at].velocity_rad_s);
                let current = of(*from, &|at| rows[at].torque_nm / nm_per_a);
                [velocity * instrument.conj(), current * instrument.conj()]
            })
            .collect();
        let sum = |place: usize, without: Option<usize>| {
            let used = cross.iter().enumerate().filter(|(at, _)| Some(*at) != without);
            used.fold(Complex::default(), |sum, (_, pair)| sum + pair[place])
        };
        let value = sum(0, None) / sum(1, None);
        // Jackknife over the windows.
        let jackknife = (0..cross.len()).map(|left_out| {
            let without = sum(0, Some(left_out)) / sum(1, Some(left_out));
            (without - value).norm_sqr()
        });
        let error = jackknife.sum::<f64>().sqrt();
        (value.norm().is_finite() && error < MAX_LINE_ERROR * value.norm())
            .then_some(Line { hz, value })
    };
    if windows.len() < 3 {
        return Vec::new();
    }
    LINES_HZ.iter().filter_map(|hz| line(*hz)).collect()
}

/// Returns the starts of windows, without overlap, in which the demand repeats the window before up to the slide: the joint
/// has settled to the multisine there.
fn steady_windows(demand: &[f64], count: usize) -> Vec<usize> {
    /// Rounding of the demand, and the least deviation of a multisine from a straight line, rad.
    const ROUNDING_RAD: f64 = 2e-5;
    const WAVE_RAD: f64 = 1e-4;
    let mut windows = Vec::new();
    let mut at = count;
    while at + count < demand.len() {
        let way = demand[at + count] - demand[at];
        let repeats = (0..count)
            .all(|step| (demand[at + step] - demand[at + step - count] - way).abs() < ROUNDING_RAD);
        let wave = |step: usize| demand[at + step] - demand[at] - way * step as f64 / count as f64;
        if repeats && way.abs() > 1e-3 && (0..count).any(|step| wave(step).abs() > WAVE_RAD) {
            windows.push(at);
            at += count;
        } else {
            at += 1;
        }
    }
    windows
}

/// Gains of the velocity loop and of the position loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopGains {
    /// Gain of the velocity loop, A s/rad.
    pub velocity_gain: f64,
    /// Integral time of the velocity loop, s.
    pub integral_s: f64,
    /// Gain of the position loop, 1/s.
    pub position_gain: f64,
}

impl LoopGains {
    /// Returns the gains of a loop that is slower by this share, 0 to 1.
    #[must_use]
    pub fn softened(self, share: f64) -> Self {
        Self {
            velocity_gain: share * self.velocity_gain,
            integral_s: self.integral_s / share,
            position_gain: share * self.position_gain,
        }
    }
}

/// Margins of a loop.
#[derive(Clone, Copy, Debug)]
struct Margins {
    crossover_hz: f64,
    phase_deg: f64,
    gain_db: f64,
    sensitivity: f64,
}

/// Returns gains for the measured response, and what they are based on. `None` if too few lines are certain.
pub fn design(
    recording: &Recording,
    nm_per_a: f64,
    former: &LoopGains,
) -> Option<(LoopGains, TuneLoop)> {
    let lines = response(recording, nm_per_a);
    if lines.len() < LEAST_LINES {
        return None;
    }
    let fine = interpolated(&lines);
    let meets = |margins: &Margins| {
        margins.phase_deg >= PHASE_MARGIN_DEG
            && margins.gain_db >= GAIN_MARGIN_DB
            && margins.sensitivity <= SENSITIVITY_PEAK
    };
    let mut best: Option<(LoopGains, Margins)> = None;
    for step in -GAIN_STEPS..=GAIN_STEPS {
        let velocity_gain =
            former.velocity_gain * MAX_CHANGE.powf(f64::from(step) / f64::from(GAIN_STEPS));
        let Some(rough) = margins(&fine, velocity_gain, f64::INFINITY) else { continue };
        // The corner of the integral is at a sixth of the crossover, where it costs 10 degrees.
        let integral_s = (6.0 / (TAU * rough.crossover_hz)).clamp(0.02, 1.0);
        let Some(found) = margins(&fine, velocity_gain, integral_s) else { continue };
        if meets(&found) {
            let position_gain = position_gain(&fine, velocity_gain, integral_s, found.crossover_hz);
            best = Some((LoopGains { velocity_gain, integral_s, position_gain }, found));
        }
    }
    let (gains, margins) = best?;
    Some((gains, report(recording, nm_per_a, &lines, margins)))
}

/// Returns what the measured response shows of a loop with these gains; `None` as [`design`], or if it has no crossover.
pub fn assess(recording: &Recording, nm_per_a: f64, gains: &LoopGains) -> Option<TuneLoop> {
    let lines = response(recording, nm_per_a);
    if lines.len() < LEAST_LINES {
        return None;
    }
    let margins = margins(&interpolated(&lines), gains.velocity_gain, gains.integral_s)?;
    Some(report(recording, nm_per_a, &lines, margins))
}

fn report(recording: &Recording, nm_per_a: f64, lines: &[Line], margins: Margins) -> TuneLoop {
    TuneLoop {
        inertia_kg_m2: inertia_kg_m2(lines, nm_per_a),
        delay_s: delay_s(lines) + LOOP_DELAY_S,
        resonance_hz: resonance_hz(lines),
        velocity_noise_rad_s: noise_rad_s(recording),
        crossover_hz: margins.crossover_hz,
        phase_margin_deg: margins.phase_deg,
        gain_margin_db: margins.gain_db,
        response: lines
            .iter()
            .map(|line| [line.hz, line.value.norm(), line.value.arg().to_degrees()])
            .collect(),
    }
}

/// Returns the response on a fine grid: linear in the logarithm of frequency and magnitude, with a continuous phase. Beyond the
/// last line the magnitude is taken as constant, because a resonance may follow.
fn interpolated(lines: &[Line]) -> Vec<Line> {
    let mut phase = lines[0].value.arg();
    let unwrapped: Vec<[f64; 3]> = lines
        .iter()
        .map(|line| {
            let turns = ((line.value.arg() - phase) / TAU).round();
            phase = line.value.arg() - turns * TAU;
            [line.hz.ln(), line.value.norm().ln(), phase]
        })
        .collect();
    let mut fine = Vec::new();
    for pair in unwrapped.windows(2) {
        for step in 0..20 {
            let share = f64::from(step) / 20.0;
            let [hz, magnitude, phase] =
                [0, 1, 2].map(|place| pair[0][place] + share * (pair[1][place] - pair[0][place]));
            fine.push(Line { hz: hz.exp(), value: Complex::from_polar(magnitude.exp(), phase) });
        }
    }
    fine.extend(lines.last());
    fine
}

/// Returns the open velocity loop.
fn open_loop(fine: &[Line], gain: f64, integral_s: f64) -> Vec<Line> {
    let open = fine.iter().map(|line| {
        let rate = TAU * line.hz;
        let controller = Complex::new(gain, -gain / (rate * integral_s));
        let delayed = Complex::from_polar(1.0, -rate * LOOP_DELAY_S);
        Line { hz: line.hz, value: controller * line.value * delayed }
    });
    open.collect()
}

/// Returns the largest position gain, 1/s, whose loop is well damped.
fn position_gain(fine: &[Line], gain: f64, integral_s: f64, crossover_hz: f64) -> f64 {
    let one = Complex::new(1.0, 0.0);
    let most = POSITION_SHARE * TAU * crossover_hz;
    let open = open_loop(fine, gain, integral_s);
    let sensitivity = |position_gain: f64| {
        let peaks = open.iter().map(|line| {
            let closed = line.value / (one + line.value);
            let outer = closed * position_gain / Complex::new(0.0, TAU * line.hz);
            1.0 / (one + outer).norm()
        });
        peaks.fold(0.0, f64::max)
    };
    let shares = (0..20).map(|step| most * 0.9f64.powi(step));
    let mut last = most;
    for gain in shares {
        last = gain;
        if sensitivity(gain) <= POSITION_SENSITIVITY_PEAK {
            break;
        }
    }
    last
}

/// Returns the margins of a velocity loop; `None` if it does not cross over within the response.
fn margins(fine: &[Line], gain: f64, integral_s: f64) -> Option<Margins> {
    let open = open_loop(fine, gain, integral_s);
    let falls = |pair: &[Line]| pair[0].value.norm() >= 1.0 && pair[1].value.norm() < 1.0;
    let crossings: Vec<&Line> =
        open.windows(2).filter(|pair| falls(pair)).map(|pair| &pair[0]).collect();
    let first = crossings.first()?;
    let phases = crossings.iter().map(|line| 180.0 + wrapped_deg(line.value.arg().to_degrees()));
    let above = open.iter().filter(|line| line.hz > first.hz);
    // Beyond the last line, nothing is known: the margin there counts too.
    let late = above.filter(|line| {
        let angle = wrapped_deg(line.value.arg().to_degrees());
        !(-150.0..=0.0).contains(&angle)
    });
    let largest = late.chain(open.last()).map(|line| line.value.norm()).fold(0.0, f64::max);
    let one = Complex::new(1.0, 0.0);
    let sensitivity = open.iter().map(|line| 1.0 / (one + line.value).norm()).fold(0.0, f64::max);
    Some(Margins {
        crossover_hz: first.hz,
        phase_deg: phases.fold(f64::INFINITY, f64::min),
        gain_db: -20.0 * largest.log10(),
        sensitivity,
    })
}

/// Returns an angle between -360 and 0 degrees.
fn wrapped_deg(angle: f64) -> f64 {
    let wrapped = angle.rem_euclid(360.0) - 360.0;
    if wrapped <= -360.0 { 0.0 } else { wrapped }
}

/// Returns the first frequency at which the response rises by half of its value over the trend of an inertia.
fn resonance_hz(lines: &[Line]) -> Option<f64> {
    let scaled: Vec<f64> = lines.iter().map(|line| line.hz * line.value.norm()).collect();
    let least = scaled.iter().copied().fold(f64::INFINITY, f64::min);
    let rises = (1..scaled.len())
        .find(|at| scaled[*at] > 1.5 * scaled[at - 1] && scaled[*at] > 1.5 * least);
    rises.map(|at| lines[at].hz)
}

/// Returns the inertia of the slowest lines, where coupled parts move as one, kg m^2.
fn inertia_kg_m2(lines: &[Line], nm_per_a: f64) -> f64 {
    let slow: Vec<f64> =
        lines.iter().take(4).map(|line| nm_per_a / (TAU * line.hz * line.value.norm())).collect();
    slow.iter().sum::<f64>() / slow.len().max(1) as f64
}

/// Returns the delay of the velocity behind that of an inertia, s: a fit of the phase beyond -90 degrees, proportional to the
/// frequency.
fn delay_s(lines: &[Line]) -> f64 {
    let beyond =
        |line: &Line| -(wrapped_deg(line.value.arg().to_degrees()).to_radians() + PI / 2.0);
    let rates =
        || lines.iter().filter(|line| line.hz >= 10.0).map(|line| (TAU * line.hz, beyond(line)));
    let square: f64 = rates().map(|(rate, _)| rate * rate).sum();
    rates().map(|(rate, phase)| rate * phase).sum::<f64>() / square.max(f64::MIN_POSITIVE)
}

/// Returns the noise of the velocity: its second differences, which the motion does not have.
fn noise_rad_s(recording: &Recording) -> f64 {
    let rows = &recording.rows;
    let second = rows.windows(3).map(|three| {
        three[0].velocity_rad_s - 2.0 * three[1].velocity_rad_s + three[2].velocity_rad_s
    });
    let count = rows.len().saturating_sub(2).max(1) as f64;
    (second.map(|difference| difference * difference).sum::<f64>() / count / 6.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Row;

    const LIMITS: MotionLimits =
        MotionLimits { range_rad: 0.4, speed_rad_s: 1.5, acceleration_rad_s2: 20.0 };

    #[test]
    fn motion_keeps_its_limits_and_never_reverses_in_a_slide() {
        let motion = motion(&LIMITS).unwrap();
        motion.validate(&LIMITS).unwrap();
        let demand: Vec<f64> = motion.positions_rad.clone();
        let windows = steady_windows(&demand, 100);
        assert!(windows.len() >= 2 * SLIDES, "{}", windows.len());
    }

    /// A joint of inertia 0.1 kg m^2 whose velocity is measured through a low-pass of 30 Hz, in closed loop, with noise.
    fn measured() -> Recording {
        let (inertia, nm_per_a, gain) = (0.1, 1.0, 2.0);
        let motion = motion(&LIMITS).unwrap();
        let (mut position, mut velocity, mut seen) = (0.0f64, 0.0f64, 0.0f64);
        let mut state = 1u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 24) - 0.5
        };
        let rows = (0..motion.positions_rad.len() * 5 - 5).map(|at| {
            let (step, part) = (at / 5, (at % 5) as f64 / 5.0);
            let (from, to) = (motion.positions_rad[step], motion.positions_rad[step + 1]);
            let demand = from + part * (to - from);
            let demanded = (to - from) / TARGET_PERIOD_S;
            let current = gain * (demanded - seen) + 20.0 * (demand - position);
            let torque = current * nm_per_a + 0.01 * noise();
            let row = Row {
                time_s: 1e-3 * at as f64,
                position_rad: position,
                error_rad: demand - position,
                velocity_rad_s: seen + 0.002 * noise(),
                torque_nm: torque,
                ..Row::default()
            };
            for _ in 0..10 {
                let friction = 0.3 * (velocity / 0.01).tanh();
                velocity += 1e-4 * (torque - friction) / inertia;
                seen += 1e-4 * TAU * 30.0 * (velocity - seen);
                position += 1e-4 * velocity;
            }
            row
        });
        Recording { name: motion.name.clone(), rows: rows.collect() }
    }

    #[test]
    fn response_of_an_inertia_behind_a_low_pass_is_measured() {
        let lines = response(&measured(), 1.0);
        assert!(lines.len() >= 8, "{lines:?}");
        for line in &lines {
            let pole = Complex::new(1.0, line.hz / 30.0);
            // The current is held for a millisecond.
            let hold = Complex::from_polar(1.0, -TAU * line.hz * 0.5e-3);
            let truth = Complex::new(0.0, -1.0 / (TAU * line.hz * 0.1)) / pole * hold;
            let ratio = line.value / truth;
            assert!(
                (ratio.norm() - 1.0).abs() < 0.15 && ratio.arg().abs() < 0.2,
                "{} Hz {ratio:?}",
                line.hz
            );
        }
    }

    #[test]
    fn design_has_its_margins_on_the_true_plant() {
        let former = LoopGains { velocity_gain: 2.0, integral_s: 0.1, position_gain: 10.0 };
        let (gains, control) = design(&measured(), 1.0, &former).unwrap();
        assert!(control.phase_margin_deg >= PHASE_MARGIN_DEG);
        assert!((control.inertia_kg_m2 / 0.1 - 1.0).abs() < 0.1, "{}", control.inertia_kg_m2);
        // The true loop at the crossover.
        let rate = TAU * control.crossover_hz;
        let plant =
            Complex::new(0.0, -1.0 / (rate * 0.1)) / Complex::new(1.0, control.crossover_hz / 30.0);
        let controller =
            Complex::new(gains.velocity_gain, -gains.velocity_gain / (rate * gains.integral_s));
        let open = plant * controller * Complex::from_polar(1.0, -rate * LOOP_DELAY_S);
        assert!((open.norm() - 1.0).abs() < 0.15, "{open:?}");
        assert!(180.0 + wrapped_deg(open.arg().to_degrees()) > 45.0, "{open:?}");
    }
}
