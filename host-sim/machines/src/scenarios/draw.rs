//! Draws a scenario: a campaign, what is hidden in it, and how large that must be to show.

use super::Scenario;
use super::arrange::{Arrangement, confounded, correlation_over_rows, with_decoy};
use super::drawn_cause::DrawnCause;
use super::hidden_cause::HiddenCause;
use super::joint::Joint;
use super::kind::Kind;
use super::logger;
use super::outside::Flavour;
use super::sampler::Sampler;
use super::setting::{Options, Setting};
use super::surroundings::{Condition, Extra, Signal};
use super::truth::{Decoy, Hidden, ScenarioTruth};

/// An effect's visible RMS over the noise.
const OVER_NOISE: (f64, f64) = (0.3, 3.0);

/// An effect's visible RMS over the Coulomb level.
const OVER_LEVEL: (f64, f64) = (0.01, 0.4);

/// Standard deviation of a torque sensor, Nm.
const NOISE_NM: (f64, f64) = (0.02, 0.2);

/// Worlds drawn before one is taken that does not quite show what it should.
const ATTEMPTS: u64 = 8;

type Torques = Vec<Vec<f64>>;

/// What a kind of scenario is made of.
struct Recipe {
    effects: Vec<HiddenCause>,
    arrangement: Arrangement,
}

fn recipe(sampler: &mut Sampler, kind: Kind) -> Recipe {
    let independent = |effects| Recipe { effects, arrangement: Arrangement::Independent };
    match kind {
        Kind::None => independent(Vec::new()),
        Kind::One(effect) => independent(vec![effect]),
        Kind::Two(first, second) if first == second => independent(vec![first]),
        Kind::Two(first, second) => independent(vec![first, second]),
        Kind::Outside => independent(vec![HiddenCause::OutsideCatalogue]),
        Kind::Confounded => {
            let (effect, arrangement) = confounded(sampler);
            Recipe { effects: vec![effect], arrangement }
        }
        Kind::Decoy => {
            let (effect, arrangement) = with_decoy(sampler);
            Recipe { effects: vec![effect], arrangement }
        }
    }
}

/// Draws scenarios until one shows what it hides.
pub(super) fn draw(kind: Kind, sizes: &[Option<f64>], seed: u64, options: &Options) -> Scenario {
    let trial = |number| {
        let mut trial = Trial::draw(kind, seed, number, options);
        trial.size(sizes, options.noise_nm);
        trial
    };
    let mut last = trial(0);
    for number in 1..ATTEMPTS {
        // A size given by hand is what it is.
        if sizes.iter().any(Option::is_some) || last.shows() {
            break;
        }
        last = trial(number);
    }
    last.scenario(kind, seed, options)
}

/// A scenario on its way.
struct Trial {
    setting: Setting,
    arrangement: Arrangement,
    hidden: Vec<DrawnCause>,
    noise_nm: f64,
    /// Visible RMS over the noise that is aimed at.
    shown: f64,
    /// Visible RMS of the second effect over that of the first that is aimed at.
    second: f64,
    torques: Torques,
    /// Visible RMS of each effect, Nm.
    visible: Vec<f64>,
}

impl Trial {
    /// Draws a campaign and what is hidden in it, at a size to begin with.
    fn draw(kind: Kind, seed: u64, number: u64, options: &Options) -> Self {
        let mut sampler = Sampler::new(seed, 100 + number);
        let Recipe { effects, arrangement } = recipe(&mut sampler, kind);
        let outside = effects.contains(&HiddenCause::OutsideCatalogue);
        let flavour = outside.then(|| Flavour::draw(&mut sampler));
        let needed = flavour.as_ref().and_then(Flavour::extra).or(arrangement.extra());
        let extras: Vec<Extra> = needed.into_iter().collect();
        let mut setting = Setting::draw(sampler.seed(), &effects, &extras, options);
        arrangement.impose(&mut sampler, &mut setting);
        if effects.contains(&HiddenCause::WarmUp) {
            // Only where nobody measures it does anyone have to guess the heat.
            setting.columns.retain(|column| *column != "temperature_c");
        }
        let flavour = flavour.map(|flavour| placed(flavour, &mut sampler, &setting));
        if let Some(flavour) = &flavour {
            setting.log_column(flavour.column());
        }
        let drawn_noise = sampler.log_between(NOISE_NM.0, NOISE_NM.1);
        let hidden = effects.iter().map(|&effect| {
            let own = flavour.filter(|_| effect == HiddenCause::OutsideCatalogue);
            let mut hidden = DrawnCause::draw(&mut sampler, effect, &setting, own);
            if matches!(arrangement, Arrangement::Exactly { .. }) {
                hidden.straighten();
            }
            hidden
        });
        let hidden = hidden.collect();
        Self {
            setting,
            arrangement,
            hidden,
            noise_nm: options.noise_nm.unwrap_or(drawn_noise),
            shown: sampler.log_between(1.25 * OVER_NOISE.0, 0.8 * OVER_NOISE.1),
            second: sampler.between(0.65, 1.4),
            torques: Torques::new(),
            visible: Vec::new(),
        }
    }

    /// Gives each effect its size, by hand or so that it shows, and simulates.
    fn size(&mut self, sizes: &[Option<f64>], noise_nm: Option<f64>) {
        let Self { setting, hidden, .. } = self;
        let plain = Joint::plain(setting.seal);
        let least_nm = 1.3 * OVER_LEVEL.0 * setting.seal.coulomb_nm;
        // Two strong effects at once would leave nothing of the law.
        let most_nm = 0.8 * OVER_LEVEL.1 * setting.seal.coulomb_nm / hidden.len().max(1) as f64;
        let wanted_nm = (self.shown * self.noise_nm).clamp(least_nm, most_nm);
        let without = setting.torques(&plain);
        let mut alone = None;
        for (at, hidden) in hidden.iter_mut().enumerate() {
            let wanted_nm = if at == 0 { wanted_nm } else { self.second * wanted_nm };
            if let Some(size) = sizes.get(at).copied().flatten() {
                hidden.size = size;
            } else {
                alone = Some(scaled(hidden, setting, &plain, &without, wanted_nm));
            }
        }
        match hidden.len() {
            0 => self.torques = without,
            1 => {
                let simulate = || setting.torques(&acting(plain.clone(), &hidden[0]));
                self.torques = alone.unwrap_or_else(simulate);
                self.visible = vec![rms_difference(&self.torques, &without)];
            }
            count => {
                self.torques = setting.torques(&hidden.iter().fold(plain.clone(), acting));
                let visible = (0..count).map(|left_out| {
                    let others = hidden.iter().enumerate().filter(|(at, _)| *at != left_out);
                    let others = others.map(|(_, hidden)| hidden).fold(plain.clone(), acting);
                    rms_difference(&self.torques, &setting.torques(&others))
                });
                self.visible = visible.collect();
            }
        }
        if noise_nm.is_none() && sizes.iter().all(Option::is_none) {
            self.noise_nm = fitting_noise(self.noise_nm, self.shown, &self.visible);
        }
    }

    /// Whether all effects show as they should.
    fn shows(&self) -> bool {
        let within = |(least, most): (f64, f64), value: f64| (least..=most).contains(&value);
        self.visible.iter().all(|rms| {
            within(OVER_NOISE, rms / self.noise_nm)
                && within(OVER_LEVEL, rms / self.setting.seal.coulomb_nm)
        })
    }

    /// The log and the truth.
    fn scenario(mut self, kind: Kind, seed: u64, options: &Options) -> Scenario {
        let own: Vec<&str> = self.hidden.iter().flat_map(DrawnCause::columns).collect();
        let columns = &mut self.setting.columns;
        let mut missing_columns = Vec::new();
        if options.without_own_columns {
            missing_columns = columns.iter().copied().filter(|name| own.contains(name)).collect();
            columns.retain(|name| !own.contains(name));
        }
        let log = logger::log(&self.setting, &self.torques, self.noise_nm);
        Scenario { log, truth: ScenarioTruth { missing_columns, ..self.truth(kind, seed) } }
    }

    fn truth(&self, kind: Kind, seed: u64) -> ScenarioTruth {
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
        let mut description = match hidden.as_slice() {
            [] => "plain LuGre, nothing hidden".to_owned(),
            all => all.iter().map(|one| one.in_words.as_str()).collect::<Vec<_>>().join("; "),
        };
        let (mut confusable_with, mut decoys) = (Vec::new(), Vec::new());
        match self.arrangement {
            Arrangement::Independent => {}
            Arrangement::Exactly { leader, follower, twin } => {
                confusable_with.push(twin.name());
                description += &format!("; {follower} always goes with {leader}");
            }
            Arrangement::Nearly { follows, decoy } => {
                let correlation = correlation_over_rows(setting, follows, decoy);
                description += &format!("; {decoy} goes nearly with {follows} and does nothing");
                decoys.push(Decoy { column: decoy, follows, correlation });
            }
        }
        ScenarioTruth {
            seed,
            kind,
            hidden,
            confusable_with,
            decoys,
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
        }
    }
}

/// A structure over the range its column really has in a campaign.
fn placed(flavour: Flavour, sampler: &mut Sampler, setting: &Setting) -> Flavour {
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
            // Above the Stribeck velocity, or the law would take the bump for its own curve.
            let most = 0.7 * setting.top_rad_s;
            let least = (4.0 * setting.seal.stribeck_rad_s).min(0.7 * most);
            let speed = sampler.log_between(least, most);
            Flavour::Band { speed, width: speed * sampler.between(0.15, 0.3) }
        }
        other => other,
    }
}

fn acting(mut joint: Joint, hidden: &DrawnCause) -> Joint {
    hidden.act_on(&mut joint);
    joint
}

/// Scales an effect until it shows as wanted, alone; returns the torques it then makes.
fn scaled(
    hidden: &mut DrawnCause,
    setting: &Setting,
    plain: &Joint,
    without: &Torques,
    wanted_nm: f64,
) -> Torques {
    /// Relative miss at which a size is taken.
    const CLOSE: f64 = 0.1;
    let (least, most) = hidden.limits(setting);
    let mut torques = setting.torques(&acting(plain.clone(), hidden));
    for _ in 0..3 {
        let seen_nm = rms_difference(&torques, without);
        let close = (seen_nm / wanted_nm - 1.0).abs() < CLOSE;
        if close || seen_nm <= 0.0 || !hidden.scales() {
            break;
        }
        let next = (hidden.size.abs() * wanted_nm / seen_nm).clamp(least, most);
        let next = next.copysign(hidden.size);
        if next == hidden.size {
            break;
        }
        hidden.size = next;
        torques = setting.torques(&acting(plain.clone(), hidden));
    }
    torques
}

/// The noise under which all effects show: that which was drawn if it does, else that of a sensor
/// under which the weakest shows as well as was wanted.
fn fitting_noise(noise_nm: f64, shown: f64, visible: &[f64]) -> f64 {
    let weakest = visible.iter().copied().fold(f64::INFINITY, f64::min);
    let strongest = visible.iter().copied().fold(0.0, f64::max);
    let does =
        weakest > 1.1 * OVER_NOISE.0 * noise_nm && strongest < 0.95 * OVER_NOISE.1 * noise_nm;
    if visible.is_empty() || does {
        return noise_nm;
    }
    (weakest / shown).max(strongest / (0.95 * OVER_NOISE.1)).clamp(NOISE_NM.0, NOISE_NM.1)
}

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
