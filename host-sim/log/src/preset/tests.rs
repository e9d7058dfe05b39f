use super::*;
use crate::message;

fn columns(
    preset: Preset,
    header: &str,
    given: &str,
    rated: Option<f64>,
) -> Result<Vec<String>, String> {
    let names: Vec<String> = header.split(',').map(str::to_owned).collect();
    let pair = |text: &str| text.split_once('=').map(|(a, b)| (a.to_owned(), b.to_owned()));
    let options = ReadOptions {
        columns: given.split(',').filter_map(pair).collect(),
        rated_torque_nm: rated,
        ..ReadOptions::default()
    };
    let found = preset.columns(Path::new("f.csv"), &names.into(), &options);
    let found = found.map_err(|error| error.to_string())?;
    Ok(found.pairs.into_iter().map(|pair| pair.to_string()).collect())
}

#[test]
fn columns_of_each_preset_have_names_and_units() {
    for (preset, header, expected) in [
        (
            Preset::PlotJuggler,
            "__time,/js/elbow/velocity,/js/elbow/effort,/js/elbow/position,/cpu/time",
            "time_s=__time,velocity_rad_s=/js/elbow/velocity,position_rad=/js/elbow/position,torque_nm=/js/elbow/effort",
        ),
        (
            Preset::Moteus,
            "timestamp,position,torque_Nm,velocity,velocity_filt",
            "time_s=timestamp,velocity_rad_s=velocity:turns/s,position_rad=position:turns,torque_nm=torque_Nm:Nm",
        ),
        (
            Preset::ODrive,
            "time,axis0.encoder.vel_estimate,axis0.encoder.pos_estimate,axis0.motor.torque_estimate",
            "time_s=time,velocity_rad_s=axis0.encoder.vel_estimate:turns/s,\
             position_rad=axis0.encoder.pos_estimate:turns,torque_nm=axis0.motor.torque_estimate",
        ),
        (
            Preset::Dynamixel,
            "time [ms],Present Velocity(128),Present Position(132),Present Load(126)",
            "time_s=time [ms]:ms,velocity_rad_s=Present Velocity(128):0.229rpm,\
             position_rad=Present Position(132):4096counts,torque_nm=Present Load(126):0.002Nm",
        ),
    ] {
        let found = columns(preset, header, "", Some(2.0)).unwrap();
        assert_eq!(found.join(","), expected, "{}", preset.name());
    }
}

#[test]
fn columns_with_given_pairs_leave_them_out() {
    let found = columns(
        Preset::Moteus,
        "timestamp,position,torque_Nm,velocity",
        "torque_nm=torque_Nm:mNm",
        None,
    );
    assert!(!found.unwrap().iter().any(|pair| pair.starts_with("torque_nm")));
}

#[test]
fn columns_of_several_joints_are_asked_for() {
    let header = "__time,/js/a/velocity,/js/a/effort,/js/b/velocity,/js/b/effort";
    let error = columns(Preset::PlotJuggler, header, "", None).unwrap_err();
    let pairs = "columns velocity_rad_s=/js/a/velocity,torque_nm=/js/a/effort";
    let two = "/js/a/velocity, /js/b/velocity";
    let parts = ["f.csv", "preset plotjuggler", "2 columns", "velocity_rad_s", two, pairs];
    message::check("presets", "several joints", &error, &parts);
    let chosen =
        columns(Preset::PlotJuggler, header, "velocity_rad_s=/js/b/velocity", None).unwrap();
    assert_eq!(chosen, ["time_s=__time", "torque_nm=/js/b/effort"]);
    let commanded = "__time,/js/a/velocity,/js/a/effort,/cmd/a/velocity";
    let found = columns(Preset::PlotJuggler, commanded, "", None).unwrap();
    assert_eq!(found[1], "velocity_rad_s=/js/a/velocity", "only it has an effort");
}

#[test]
fn columns_with_unknown_unit_are_asked_for() {
    let drive = "time,0x6064:00,0x606C:00,0x6077:00";
    let unit = columns(Preset::EtherCat, drive, "", Some(1.0)).unwrap_err();
    let pair = "columns velocity_rad_s=0x606C:00:UNIT";
    let parts = ["f.csv", "ethercat", "velocity_rad_s", "0x606C:00", pair, "4096counts/s", "60A9h"];
    message::check("presets", "velocity in unknown units", &unit, &parts);
    let given = "velocity_rad_s=0x606C:00:rpm";
    let share = columns(Preset::EtherCat, drive, given, None).unwrap_err();
    let parts = ["f.csv", "ethercat", "torque_nm", "0x6077:00", "0.1 %", "rated torque 1.2Nm"];
    message::check("presets", "torque as a share", &share, &parts);
    let found = columns(Preset::EtherCat, drive, given, Some(2.0)).unwrap();
    assert_eq!(found, ["time_s=time", "torque_nm=0x6077:00:0.002Nm"]);
    let current = columns(Preset::ODrive, "t,vel_estimate,iq_measured", "", None).unwrap_err();
    let by_constant = "columns torque_nm=iq_measured:A with torque constant 0.105Nm/A";
    let by_unit = "columns torque_nm=iq_measured:0.105Nm";
    let parts = ["f.csv", "odrive", "torque_nm", "iq_measured", by_constant, by_unit];
    message::check("presets", "torque as a current", &current, &parts);
}

#[test]
fn columns_without_a_required_one_name_an_example() {
    let error = columns(Preset::Moteus, "timestamp,velocity", "", None).unwrap_err();
    let parts = ["f.csv", "moteus", "torque_nm", "columns torque_nm=NAME"];
    message::check("presets", "no torque", &error, &parts);
}

#[test]
fn recognise_with_names_of_a_tool_returns_its_preset() {
    let recognise = |header: &str| {
        let names: Vec<String> = header.split(',').map(str::to_owned).collect();
        Preset::recognise(&names.into())
    };
    assert_eq!(recognise("__time,/a"), Some(Preset::PlotJuggler));
    assert_eq!(recognise("t,servo_stats.velocity"), Some(Preset::Moteus));
    assert_eq!(recognise("timestamp,velocity,torque_Nm"), Some(Preset::Moteus));
    assert_eq!(recognise("t,axis0.encoder.vel_estimate"), Some(Preset::ODrive));
    assert_eq!(recognise("t,Present Velocity"), Some(Preset::Dynamixel));
    assert_eq!(recognise("t,0x6077:00"), Some(Preset::EtherCat));
    assert_eq!(recognise("time_s,velocity,torque"), None);
}

#[test]
fn parse_with_name_returns_preset() {
    assert!(Preset::ALL.iter().all(|preset| Preset::parse(preset.name()) == Some(*preset)));
    assert_eq!(Preset::parse("excel"), None);
}
