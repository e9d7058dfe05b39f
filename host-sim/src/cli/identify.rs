//! `identify`: fits one model to measured data.

use super::each_joint::{JointResult, each_joint};
use super::error::{Result, found, unfit};
use super::input::DataArguments;
use super::network::{self, NetworkArguments};
use super::output::OutputArguments;
use super::table;
use crate::driver_file;
use compensator_core::parameters::Choices;
use compensator_core::{ParameterId, Parameters};
use friction_diagnose::hand_over::BesidePlain;
use friction_diagnose::prepare::Prepared;
use friction_fit::spec::Spec;
use friction_fit::{FitOptions, identify_robustly};
use friction_results::fits::fit_files;
use joint_log::SplitRule;
use joint_log::work;
use std::path::PathBuf;

/// Machines with known dynamics, for `--inside`, which needs the feature `papers`.
#[derive(clap::ValueEnum, Clone, Copy, Debug)]
pub enum KnownMachine {
    /// The arm with three joints and fluidic muscles of `simulate manipulator`.
    Manipulator,
}

/// Arguments of `identify`.
#[derive(clap::Args)]
pub struct IdentifyArguments {
    /// Law, with terms as in `lugre+pressure-coulomb`: linear, extended, atan, stribeck, dahl, lugre, ..
    ///
    /// Laws: linear, extended, atan, stribeck, dahl, lugre, lugre-asymmetric, improved-lugre; or lugre-lstm, where a network
    /// scales the friction levels and the stiffness.
    #[arg(long, value_name = "MODEL", default_value = "", hide_default_value = true)]
    model: String,
    /// Start the fit from the parameters of this file only
    #[arg(long, value_name = "PARAMS.TOML")]
    start: Option<PathBuf>,
    /// Parameters to keep at their start values
    #[arg(long, value_name = "NAME,..", value_delimiter = ',')]
    keep: Vec<String>,
    /// Parameters to fit that are otherwise constant (static excesses, references)
    #[arg(long, value_name = "NAME,..", value_delimiter = ',')]
    free: Vec<String>,
    /// Options of the law: damping_fades, printed_extended, allow_active (permits a law that is not passive)
    #[arg(long, value_name = "NAME,..", value_delimiter = ',', hide_short_help = true)]
    choices: Vec<String>,
    /// Number of starting points that are optimised to convergence
    #[arg(long, value_name = "N", default_value_t = 3, hide_short_help = true)]
    starts: usize,
    /// Fit within the known dynamics of this machine
    ///
    /// The fit is to the angles of all joints at once, with exact gradients (models linear, extended, atan, lugre).
    #[arg(long, value_name = "MACHINE", value_enum, hide_short_help = true, conflicts_with_all = ["start", "keep", "free", "choices", "substeps"])]
    inside: Option<KnownMachine>,
    /// Simulation steps per sample; by default chosen by the fit
    #[arg(long, value_name = "N", hide_short_help = true)]
    substeps: Option<usize>,
    #[command(flatten)]
    network: NetworkArguments,
    #[command(flatten)]
    pub(super) data: DataArguments,
    #[command(flatten)]
    output: OutputArguments,
}

fn parse_parameter_names(option: &str, names: &[String]) -> Result<Vec<ParameterId>> {
    let id = |name: &String| {
        ParameterId::parse(name).ok_or_else(|| unfit(option, format!("unknown parameter {name:?}")))
    };
    names.iter().map(id).collect()
}

/// Returns the given choices with the named ones switched on.
pub(super) fn choices(given: Choices, names: &[String]) -> Result<Choices> {
    let mut choices = given.to_array();
    for name in names {
        let place = Choices::NAMES.iter().position(|known| known == name);
        let place = place.ok_or_else(|| {
            let known = Choices::NAMES.join(", ");
            unfit("--choices", format!("unknown choice {name:?}, expected one of {known}"))
        })?;
        choices[place] = true;
    }
    Ok(Choices::from_array(choices))
}

/// Returns `base` with the values of `other` for every parameter that both models use.
fn merged(base: &Parameters<f64>, other: &Parameters<f64>) -> Parameters<f64> {
    let shared = base.active().filter(|id| other.active().any(|theirs| theirs == *id));
    let mut base = base.clone();
    base.choices = other.choices;
    shared.fold(base.clone(), |merged, id| merged.with(id, other.get(id)))
}

/// Runs the command.
pub fn run(arguments: &IdentifyArguments) -> Result {
    if arguments.model.is_empty() {
        return Err(found("--model", "no model", "one, such as --model lugre"));
    }
    let IdentifyArguments { data, output, .. } = arguments;
    if let Some(KnownMachine::Manipulator) = arguments.inside {
        #[cfg(not(feature = "papers"))]
        return Err(super::missing_feature::refusal("--inside", "papers").into());
        #[cfg(feature = "papers")]
        return super::inside::run(
            data,
            &output.of_run("identify", &data.log.data),
            std::slice::from_ref(&arguments.model),
            arguments.starts,
            "fit.json",
        );
    }
    if arguments.model == network::MODEL {
        #[cfg(not(feature = "network"))]
        return Err(network::refusal());
        #[cfg(feature = "network")]
        return each_joint("identify", data, output, &SplitRule::default(), |input| {
            network::identify(&arguments.network, &data.fit, arguments.starts, input)
        });
    }
    let input_spec = Spec::parse(&arguments.model)?;
    let fixed = parse_parameter_names("--keep", &arguments.keep)?;
    let freed = parse_parameter_names("--free", &arguments.free)?;
    each_joint("identify", data, output, &SplitRule::default(), |input| {
        fit_joint(arguments, input, input_spec.clone(), fixed.clone(), freed.clone())
    })
}

/// Fits the model to the log of one joint.
fn fit_joint(
    arguments: &IdentifyArguments,
    input: &Prepared,
    input_spec: Spec,
    fixed: Vec<ParameterId>,
    freed: Vec<ParameterId>,
) -> Result<JointResult> {
    let spec = input_spec.on(&input.rigid_body);
    let mut base = spec.parameters()?;
    if let Some(path) = &arguments.start {
        base = merged(&base, &driver_file::read(path)?.parameters);
    }
    base.choices = choices(base.choices, &arguments.choices)?;
    let options = FitOptions {
        substeps: arguments.substeps,
        starts: arguments.starts.max(1),
        start: arguments.start.is_some().then(|| base.clone()),
        fixed,
        freed,
        passive: true,
        ..FitOptions::default()
    };
    work::report_stage(&format!("fitting {spec} to {} rows", input.data.rows));
    let (train, test) = (input.train_rows(), input.test_rows());
    let fit = identify_robustly(input.loss, &spec, &base, train, test, &options);
    work::report_stage("writing the report");
    let beside = BesidePlain::of(&fit, input)?;
    let files = fit_files(&fit, &beside, input)?;
    let models = table::models(std::slice::from_ref(&fit), &input.data);
    let handed_over = beside.in_words(&fit, input.data.joint.torque_unit());
    let mut text = format!("{handed_over}\n\n{}\n{models}\n", table::parameters(&fit, &input.data));
    fit.verdicts.iter().for_each(|verdict| text += &format!("- {verdict}\n"));
    Ok(JointResult { files, text })
}
