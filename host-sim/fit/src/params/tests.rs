//! Parameter files, good and bad.

use super::*;
use crate::{message, snapshot};

const GOOD: &str = "schema = 1\njoint = \"revolute\"\nmodel = \"lugre+pressure-coulomb\"\n\
    [parameters]\ncoulomb_torque = { value = 1.5, unit = \"Nm\" }\nstatic_torque = 2\n\
    pressure_coulomb = 2.4e-6\n[envelope]\nvelocity_max_rad_s = 10.5\n\
    [compensator]\nscale = 0.8\n";

#[test]
fn parse_with_valid_file_returns_parameters() {
    let file = parse(GOOD, &[]).unwrap();
    assert_eq!(file.parameters.get(ParameterId::CoulombTorque), 1.5);
    assert_eq!(file.parameters.get(ParameterId::StaticTorque), 2.0);
    assert_eq!(file.parameters.envelope.velocity_max_rad_s, 10.5);
    assert_eq!(file.friction().compensator.scale, 0.8);
    assert_eq!(file.spec.to_string(), "lugre+pressure-coulomb");
}

#[test]
fn parse_with_further_section_returns_its_values() {
    let text = format!("{GOOD}[motor]\ngear_ratio = 20\n");
    let motor = Section { name: "motor", fields: &["pole_pairs", "gear_ratio"] };
    let file = parse(&text, &[motor]).unwrap();
    assert!(file.sections[0][0].is_nan() && file.sections[0][1] == 20.0);
    message::require(&parse(&text, &[]).unwrap_err().to_string(), &["\"motor\""]);
    let error = parse(&text.replace("gear_ratio", "gear"), &[motor]).unwrap_err().to_string();
    message::require(&error, &["motor.gear"]);
}

#[test]
fn read_with_network_checks_file_and_checksum() {
    let folder = tempfile::tempdir().unwrap();
    let json = "{\"slew\": 0.5}";
    let law = Parameters::<f32>::new(LawKind::LugreAsymmetric)
        .with(ParameterId::CoulombTorque, 1.5)
        .with(ParameterId::StaticTorque, 2.2);
    let mut text = emit_model(&law, JointKind::Revolute);
    emit_network("network.json", json, &mut text);
    let (toml, beside) = (folder.path().join("params.toml"), folder.path().join("network.json"));
    let read = |text: &str| {
        std::fs::write(&toml, text).unwrap();
        super::read(&toml, &[]).map_err(|error| error.to_string())
    };
    let missing = read(&text).unwrap_err();
    let parts = ["network.file: ", "network.json: "];
    message::check("files", "parameters with a missing network", &missing, &parts);
    std::fs::write(&beside, json).unwrap();
    let file = read(&text).unwrap();
    assert_eq!(file.network.unwrap().text, json);
    let mut errors = format!("without a folder: {}\n", parse(&text, &[]).unwrap_err());
    for (from, to, part) in [
        ("lugre-asymmetric", "lugre", " lugre"),
        ("crc32 = \"", "crc32 = \"0", "network.crc32: "),
        ("crc32", "crc", "network.crc: "),
        ("file = \"", "file = \"/", "network.file: "),
    ] {
        let error = read(&text.replacen(from, to, 1)).unwrap_err();
        message::require(&error, &["params.toml", part]);
        assert_eq!(error.lines().count(), 1, "{error}");
        errors += &format!("{from} -> {to}: {error}\n");
    }
    std::fs::write(&beside, json.replace("0.5", "0.25")).unwrap();
    let changed = read(&text).unwrap_err();
    let crcs = [checksum(json.replace("0.5", "0.25").as_bytes()), checksum(json.as_bytes())];
    message::require(&changed, &["network.crc32: ", "network.json", &crcs[0], &crcs[1]]);
    errors += &format!("changed: {changed}\n");
    let errors = errors.replace(&crcs[0], "FOUND").replace(&crcs[1], "EXPECTED");
    snapshot::check("files", "parameters with a wrong network", &errors);
}

#[test]
fn parse_with_invalid_file_names_the_error() {
    let mut errors = String::new();
    for (from, to, parts) in [
        ("schema = 1", "schema = 2", &["schema"][..]),
        ("revolute", "round", &["revolute", "prismatic"]),
        ("lugre+", "luger+", &["luger"]),
        ("unit = \"Nm\"", "unit = \"mNm\"", &["\"Nm\""]),
        ("unit = \"Nm\"", "unit = 3", &["unit 3", "\"Nm\""]),
        ("unit = ", "units = ", &["parameters.coulomb_torque.units", "unit"]),
        ("schema = 1\n", "", &["schema"]),
        ("static_torque = 2", "static_torque = 1", &["static_torque = 1", " 1.5"]),
        ("static_torque = 2", "static_torque = nan", &["parameters.static_torque"]),
        ("pressure_coulomb", "radial_force_coulomb", &["radial_force", "lugre+pressure"]),
        ("scale = 0.8", "scale = 1.8", &["scale = 1.8", " 1"]),
        ("scale", "scael", &["compensator.scael"]),
        ("[envelope]", "[fit]\nsubsteps = 0\n[envelope]", &["fit.substeps"]),
        ("[envelope]", "[fit]\nsteps = 2\n[envelope]", &["fit.steps"]),
        ("[envelope]", "[log_means]\nmood = 2\n[envelope]", &["log_means.mood"]),
        ("[envelope]", "[envelop]", &["\"envelop\""]),
        ("= 1.5", "= ", &["TOML", "line"]),
        ("\"lugre+pressure-coulomb\"", "\"\"\"lu\ngre\"\"\"", &["lu"]),
        ("static_torque", "\"static\\ntorque\"", &["static", "lugre+pressure"]),
    ] {
        let error = parse(&GOOD.replacen(from, to, 1), &[]).unwrap_err().to_string();
        message::require(&error, parts);
        assert_eq!(error.lines().count(), 1, "{error}");
        errors += &format!("{from} -> {}: {error}\n", to.replace('\n', " "));
    }
    snapshot::check("files", "parameters", &errors);
}
