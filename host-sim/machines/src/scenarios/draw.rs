//! Draws a scenario: a campaign, its hidden effects, and their sizes.

use super::Scenario;
use super::drawn_cause::DrawnCause;
use super::hidden_cause::HiddenCause;
use super::setting::{Options, Setting};
use super::truth::{Hidden, ScenarioTruth};
use crate::conditions::{Condition, Extra, Signal};
use crate::joint::Joint;
use crate::outside::Flavour;
use crate::sampler::Sampler;

/// Range of an effect's visible RMS, as a multiple of the noise.
const EFFECT_TO_NOISE: (f64, f64) = (0.3, 3.0);

/// Range of an effect's visible RMS, as a share of the Coulomb level.
const EFFECT_TO_LEVEL: (f64, f64) = (0.01, 0.4);

/// Range of the standard deviation of the torque noise, Nm.
const NOISE_NM: (f64, f64) = (0.02, 0.2);

/// Maximum number of trials. The last one is used even if its effects miss the visibility range.
const MAX_TRIALS: u64 = 8;

/// Torque of each row of each run, Nm.
type Torques = Vec<Vec<f64>>;

/// A relation between the columns of a campaign. Benchmarks have such relations; the columns of other campaigns are
/// independent.
pub trait ColumnRelation {
    /// Returns the kind of the scenario, in one word.
    fn kind(&self) -> &'static str;

    /// Returns the extra column that the relation needs.
    fn extra(&self) -> Option<Extra>;

    /// Relates the columns of a campaign, and adds them to the log.
    fn relate(&self, sampler: &mut Sampler, setting: &mut Setting);

    /// Adapts an effect to the relation.
    fn adapt(&self, effect: &mut DrawnCause);

    /// Adds the relation to the ground truth.
    fn describe(&self, setting: &Setting, truth: &mut ScenarioTruth);
}

/// What a scenario hides.
#[derive(Default)]
pub struct Plan {
    /// The hidden effects.
    pub effects: Vec<HiddenCause>,
    /// Relation between the columns. `None` if all are independent.
    pub relation: Option<Box<dyn ColumnRelation>>,
}

impl Plan {
    /// Returns the kind of the scenario, in one word.
    fn kind(&self) -> &'static str {
        if let Some(relation) = &self.relation {
            return relation.kind();
        }
        match *self.effects {
            [] => "none",
            [HiddenCause::OutsideCatalogue] => "outside",
            [_] => "one",
            _ => "two",
        }
    }
}

/// Draws scenarios of a plan, which may be drawn itself, until the hidden effects of one are visible as required. `sizes` are
/// those of its effects, in their order.
pub fn draw_planned(
    plan: &dyn Fn(&mut Sampler) -> Plan,
    sizes: &[Option<f64>],
    seed: u64,
    options: &Options,
) -> Scenario {
    let trial = |number| {
        let mut trial = Trial::draw(plan, seed, number, options);
        trial.set_sizes(sizes, options.noise_nm);
        trial
    };
    let mut last = trial(0);
    for number in 1..MAX_TRIALS {
        // A size given by the user is not changed.
        if sizes.iter().any(Option::is_some) || last.is_visible() {
            break;
        }
        last = trial(number);
    }
    last.scenario(seed, options)
}

/// A drawn scenario before its log is created.
struct Trial {
    setting: Setting,
    plan: Plan,
    hidden: Vec<DrawnCause>,
    noise_nm: f64,
    /// Target of the visible RMS, as a multiple of the noise.
    target_ratio: f64,
    /// Target of the visible RMS of the second effect, relative to that of the first.
    second_ratio: f64,
    torques: Torques,
    /// Visible RMS of each effect, Nm.
    visible: Vec<f64>,
}

impl Trial {
    /// Draws a campaign and its hidden effects, with initial sizes.
    fn draw(
        plan: &dyn Fn(&mut Sampler) -> Plan,
        seed: u64,
        number: u64,
        options: &Options,
    ) -> Self {
        let mut sampler = Sampler::new(seed, 100 + number);
        let plan = plan(&mut sampler);
        let Plan { effects, relation } = &plan;
        let outside = effects.contains(&HiddenCause::OutsideCatalogue);
        let flavour = outside.then(|| Flavour::draw(&mut sampler));
        let related = relation.as_ref().and_then(|relation| relation.extra());
        let needed = flavour.as_ref().and_then(Flavour::extra).or(related);
        let extras: Vec<Extra> = needed.into_iter().collect();
        let mut setting = Setting::draw(sampler.seed(), effects, &extras, options);
        if let Some(relation) = relation {
            relation.relate(&mut sampler, &mut setting);
        }
        if effects.contains(&HiddenCause::WarmUp) {
            // Without a temperature column, the heat must be estimated from the motion.
            setting.columns.retain(|column| *column != "temperature_c");
        }
        let flavour = flavour.map(|flavour| fit_to_campaign(flavour, &mut sampler, &setting));
        if let Some(flavour) = &flavour {
            setting.log_column(flavour.column());
        }
        let drawn_noise = sampler.log_between(NOISE_NM.0, NOISE_NM.1);
        let hidden = effects.iter().map(|&effect| {
            let flavour = flavour.filter(|_| effect == HiddenCause::OutsideCatalogue);
            let mut hidden = DrawnCause::draw(&mut sampler, effect, &setting, flavour);
            if let Some(relation) = relation {
                relation.adapt(&mut hidden);
            }
            hidden
        });
        let hidden = hidden.collect();
        Self {
            setting,
            plan,
            hidden,
            noise_nm: options.noise_nm.unwrap_or(drawn_noise),
            target_ratio: sampler.log_between(1.25 * EFFECT_TO_NOISE.0, 0.8 * EFFECT_TO_NOISE.1),
            second_ratio: sampler.between(0.65, 1.4),
            torques: Torques::new(),
            visible: Vec::new(),
        }
    }

    /// Sets the size of each effect, as given or scaled to the target visibility, and simulates.
    fn set_sizes(&mut self, sizes: &[Option<f64>], noise_nm: Option<f64>) {
        let Self { setting, hidden, .. } = self;
        let plain = Joint::plain(setting.seal);
        let least_nm = 1.3 * EFFECT_TO_LEVEL.0 * setting.seal.coulomb_nm;
        // Limits the sum of the effects, so that the friction law stays dominant.
        let most_nm =
            0.8 * EFFECT_TO_LEVEL.1 * setting.seal.coulomb_nm / hidden.len().max(1) as f64;
        let target_nm = (self.target_ratio * self.noise_nm).clamp(least_nm, most_nm);
        let without = setting.torques(&plain);
        let mut alone = None;
        for (at, hidden) in hidden.iter_mut().enumerate() {
            let target_nm = if at == 0 { target_nm } else { self.second_ratio * target_nm };
            if let Some(size) = sizes.get(at).copied().flatten() {
                hidden.size = size;
            } else {
                alone = Some(scale_effect(hidden, setting, &plain, &without, target_nm));
            }
        }
        match hidden.len() {
            0 => self.torques = without,
            1 => {
                let simulate = || setting.torques(&with_effect(plain.clone(), &hidden[0]));
                self.torques = alone.unwrap_or_else(simulate);
                self.visible = vec![rms_difference(&self.torques, &without)];
            }
            count => {
                self.torques = setting.torques(&hidden.iter().fold(plain.clone(), with_effect));
                let visible = (0..count).map(|left_out| {
                    let others = hidden.iter().enumerate().filter(|(at, _)| *at != left_out);
                    let others = others.map(|(_, hidden)| hidden).fold(plain.clone(), with_effect);
                    rms_difference(&self.torques, &setting.torques(&others))
                });
                self.visible = visible.collect();
            }
        }
        if noise_nm.is_none() && sizes.iter().all(Option::is_none) {
            self.noise_nm = select_noise(self.noise_nm, self.target_ratio, &self.visible);
        }
    }

    /// Returns true if the visible RMS of all effects is within the required ranges.
    fn is_visible(&self) -> bool {
        let within = |(least, most): (f64, f64), value: f64| (least..=most).contains(&value);
        self.visible.iter().all(|rms| {
            within(EFFECT_TO_NOISE, rms / self.noise_nm)
                && within(EFFECT_TO_LEVEL, rms / self.setting.seal.coulomb_nm)
        })
    }

    /// Creates the log and the ground truth.
    fn scenario(mut self, seed: u64, options: &Options) -> Scenario {
        let causing: Vec<&str> = self.hidden.iter().flat_map(DrawnCause::columns).collect();
        let columns = &mut self.setting.columns;
        let mut missing_columns = Vec::new();
        if options.without_own_columns {
            missing_columns =
                columns.iter().copied().filter(|name| causing.contains(name)).collect();
            columns.retain(|name| !causing.contains(name));
        }
        let log = self.setting.log(&self.torques, self.noise_nm);
        Scenario { log, truth: ScenarioTruth { missing_columns, ..self.truth(seed) } }
    }

    /// Creates the ground truth.
    fn truth(&self, seed: u64) -> ScenarioTruth {
        let setting = &self.setting;
        let hidden =
            self.hidden.iter().zip(&self.visible).map(|(hidden, &visible_rms_nm)| Hidden {
                cause: hidden.effect.name(),
                columns: hidden.columns(),
                size: hidden.size,
                unit: hidden.unit(),
                order: hidden.is_periodic().then_some(hidden.order),
                visible_rms_nm,
                details: hidden.details(),
                in_words: hidden.words(),
            });
        let mut hidden: Vec<Hidden> = hidden.collect();
        hidden.sort_by(|a, b| b.visible_rms_nm.total_cmp(&a.visible_rms_nm));
        let description = match hidden.as_slice() {
            [] => "plain LuGre, nothing hidden".to_owned(),
            all => all.iter().map(|one| one.in_words.as_str()).collect::<Vec<_>>().join("; "),
        };
        let mut truth = ScenarioTruth {
            seed,
            kind: self.plan.kind(),
            hidden,
            confusable_with: Vec::new(),
            decoys: Vec::new(),
            missing_columns: Vec::new(),
            seal: setting.seal,
            noise_nm: self.noise_nm,
            rate_hz: setting.rate_hz,
            runs: setting.runs.len(),
            seconds: setting.seconds,
            jitter: setting.sensors.jitter,
            gaps: setting.sensors.gaps,
            encoder: setting.sensors.encoder,
            description,
        };
        if let Some(relation) = &self.plan.relation {
            relation.describe(setting, &mut truth);
        }
        truth
    }
}

/// Sets the range of an effect outside the catalogue to that of its column in the campaign.
fn fit_to_campaign(flavour: Flavour, sampler: &mut Sampler, setting: &Setting) -> Flavour {
    let range = |signal: &dyn Fn(&Condition) -> Signal| {
        let ends = setting.runs.iter().flat_map(|run| {
            let signal = signal(&run.condition);
            [signal.at(0.0), signal.at(setting.seconds)]
        });
        ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, m), x| (l.min(x), m.max(x)))
    };
    match flavour {
        Flavour::Temperature { curve, .. } => {
            let (least, most) = range(&|condition| condition.temperature);
            Flavour::Temperature { from_c: least, range_k: (most - least).max(1.0), curve }
        }
        Flavour::Column { extra, curve, .. } => {
            let (least, most) = range(&|condition| condition.extra(extra));
            Flavour::Column { extra, from: least, range: (most - least).max(1e-3), curve }
        }
        Flavour::Band { .. } => {
            // Above the Stribeck velocity. Below it, the law would fit the bump as its own curve.
            let most = 0.7 * setting.top_rad_s;
            let least = (4.0 * setting.seal.stribeck_rad_s).min(0.7 * most);
            let speed = sampler.log_between(least, most);
            Flavour::Band { speed, width: speed * sampler.between(0.15, 0.3) }
        }
        other => other,
    }
}

/// Returns the joint with the effect.
fn with_effect(mut joint: Joint, hidden: &DrawnCause) -> Joint {
    hidden.apply_to(&mut joint);
    joint
}

/// Scales a single effect to the target visibility.
///
/// Returns the torques with that effect, Nm.
fn scale_effect(
    hidden: &mut DrawnCause,
    setting: &Setting,
    plain: &Joint,
    without: &Torques,
    target_nm: f64,
) -> Torques {
    /// Relative deviation from the target at which a size is accepted.
    const SCALE_TOLERANCE: f64 = 0.1;
    let (least, most) = hidden.limits(setting);
    let mut torques = setting.torques(&with_effect(plain.clone(), hidden));
    for _ in 0..3 {
        let seen_nm = rms_difference(&torques, without);
        let close = (seen_nm / target_nm - 1.0).abs() < SCALE_TOLERANCE;
        if close || seen_nm <= 0.0 || !hidden.is_scalable() {
            break;
        }
        let next = (hidden.size.abs() * target_nm / seen_nm).clamp(least, most);
        let next = next.copysign(hidden.size);
        if next == hidden.size {
            break;
        }
        hidden.size = next;
        torques = setting.torques(&with_effect(plain.clone(), hidden));
    }
    torques
}

/// Returns a noise level at which all effects are visible, Nm.
///
/// It is the drawn noise if possible. Otherwise it is the noise at which the weakest effect has the target visibility.
fn select_noise(noise_nm: f64, target_ratio: f64, visible: &[f64]) -> f64 {
    let weakest = visible.iter().copied().fold(f64::INFINITY, f64::min);
    let strongest = visible.iter().copied().fold(0.0, f64::max);
    let is_suitable = weakest > 1.1 * EFFECT_TO_NOISE.0 * noise_nm
        && strongest < 0.95 * EFFECT_TO_NOISE.1 * noise_nm;
    if visible.is_empty() || is_suitable {
        return noise_nm;
    }
    (weakest / target_ratio)
        .max(strongest / (0.95 * EFFECT_TO_NOISE.1))
        .clamp(NOISE_NM.0, NOISE_NM.1)
}

/// Returns the RMS difference over all rows, Nm.
fn rms_difference(a: &Torques, b: &Torques) -> f64 {
    let (mut sum, mut rows) = (0.0, 0);
    for (a, b) in a.iter().zip(b) {
        for (a, b) in a.iter().zip(b) {
            sum += (a - b) * (a - b);
            rows += 1;
        }
    }
    (sum / f64::from(rows.max(1))).sqrt()
}
