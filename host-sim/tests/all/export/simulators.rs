//! The lines for simulators, which have less than the model.

use super::{file, joint};
use crate::snapshot;
use compensator_core::{LawKind, ParameterId as Id, TermKind};
use friction_fit::params::{ParameterFile, emit_model};
use friction_results::export::{ExportFormat, export};
use host_sim::driver_file;
use joint_log::JointKind;

fn attribute(text: &str, name: &str) -> f64 {
    let at = text.find(&format!("{name}=\"")).expect(name) + name.len() + 2;
    text[at..].split('"').next().unwrap_or_default().parse().expect("a number")
}

#[test]
fn export_to_simulators_matches_steady_sliding() {
    let linear = file(&joint(LawKind::Linear, &[]));
    for (format, dry) in [(ExportFormat::Mujoco, "frictionloss"), (ExportFormat::Urdf, "friction")]
    {
        let written = export(&linear, format, "params.toml").expect("exported");
        let text = String::from_utf8(written.content).expect("text");
        assert!((attribute(&text, dry) - 1.5).abs() < 1e-6, "{text}");
        assert!((attribute(&text, "damping") - 0.8).abs() < 1e-6, "{text}");
        assert!(written.notes.is_empty(), "{:?}", written.notes);
    }
    let lugre = joint(LawKind::Lugre, &[TermKind::PressureCoulomb]);
    let text =
        export(&file(&lugre), ExportFormat::Mujoco, "params.toml").expect("exported").content;
    let text = String::from_utf8(text).expect("text");
    assert!(
        text.contains("bristles") && text.contains("left out") && text.contains("pressure-coulomb")
    );
    // Well above the Stribeck velocity, the line agrees with the law within a few percent.
    let line = attribute(&text, "frictionloss") + 6.0 * attribute(&text, "damping");
    assert!((line - (1.5 + 0.8 * 6.0)).abs() < 0.03 * line, "{line}");
}

#[test]
fn export_to_mujoco_writes_inertia_as_armature() {
    let model = joint(LawKind::Linear, &[TermKind::UnmodelledInertia]);
    let text = |inertia: f32, format| {
        let model = model.clone().with(Id::Inertia, inertia);
        let written = export(&file(&model), format, "params.toml").expect("exported");
        String::from_utf8(written.content).expect("text")
    };
    let written = text(0.25, ExportFormat::Mujoco);
    assert!((attribute(&written, "armature") - 0.25).abs() < 1e-6, "{written}");
    assert!((attribute(&written, "frictionloss") - 1.5).abs() < 1e-6, "{written}");
    assert!(written.contains("kg m^2") && !written.contains("left out"), "{written}");
    // A negative one is no inertia, and a URDF joint has no attribute for it.
    for left_out in [text(-0.1, ExportFormat::Mujoco), text(0.25, ExportFormat::Urdf)] {
        assert!(!left_out.contains("armature") && left_out.contains("unmodelled-inertia"));
    }
}

#[test]
fn export_to_simulator_takes_covariates_at_the_means_of_the_log() {
    let model = joint(LawKind::Stribeck, &[TermKind::PressureCoulomb, TermKind::TorqueOffset]);
    let text = emit_model(&model, JointKind::Revolute) + "\n[log_means]\npressure_diff_pa = 2e5\n";
    let with_means = driver_file::parse(&text).expect("a legal model");
    let mujoco = |file: &ParameterFile| {
        let written = export(file, ExportFormat::Mujoco, "params.toml").expect("exported");
        String::from_utf8(written.content).expect("text")
    };
    let (with, without) = (mujoco(&with_means), mujoco(&file(&model)));
    let added = attribute(&with, "frictionloss") - attribute(&without, "frictionloss");
    assert!((added - 2.4e-6 * 2e5).abs() < 1e-3, "{added}");
    assert!(
        with.contains("pressure_diff_pa = 2.00e5") || with.contains("pressure_diff_pa = 2"),
        "{with}"
    );
    assert!(
        !without.contains("pressure_diff_pa =") && without.contains("pressure-coulomb"),
        "{without}"
    );
    assert!(with.contains("torque-offset"), "{with}");
    snapshot::check("export", "to MuJoCo with means", &with);
    snapshot::check("export", "to MuJoCo without means", &without);
}
