use super::*;
use crate::message;

fn read_header(header: &str, columns: &str) -> Result<Layout, DataError> {
    let names: Vec<String> = header.split(',').map(str::to_string).collect();
    let columns: Vec<(String, String)> = columns
        .split(',')
        .filter_map(|pair| pair.split_once('='))
        .map(|(a, b)| (a.to_string(), b.to_string()))
        .collect();
    let options = ReadOptions { columns, ..ReadOptions::default() };
    layout(Path::new("f.csv"), names, &options)
}

/// Returns the message of a refused header.
fn refused(header: &str, columns: &str) -> String {
    read_header(header, columns).unwrap_err().to_string()
}

fn required_indices(layout: &Layout) -> [usize; 3] {
    layout.required.map(|reading| reading.index)
}

#[test]
fn layout_with_either_target_sets_joint_kind() {
    let turns = read_header("time_s,velocity_rad_s,torque_nm,position_rad", "").unwrap();
    assert_eq!((turns.joint, required_indices(&turns)), (JointKind::Revolute, [0, 1, 2]));
    assert_eq!(turns.optional[0].quantity, Some(Quantity::Position));
    let slides = read_header("run,force_n,velocity_m_s,time_s,position_m", "").unwrap();
    assert_eq!((slides.joint, required_indices(&slides)), (JointKind::Prismatic, [3, 2, 1]));
    assert_eq!(slides.run, Some(0));
    assert_eq!(slides.optional[0].quantity, Some(Quantity::Position));
}

#[test]
fn layout_with_name_outside_contract_adds_extra_covariate() {
    let found = read_header("time_s,velocity_rad_s,torque_nm,flow,position_m", "").unwrap();
    let extras: Vec<(&str, Option<Quantity>)> =
        found.optional.iter().map(|c| (c.name.as_str(), c.quantity)).collect();
    assert_eq!(extras, [("flow", None), ("position_m", None)]);
}

#[test]
fn layout_with_demand_leaves_it_out() {
    let found = read_header("time_s,velocity_rad_s,torque_nm,demand_rad,flow", "").unwrap();
    let extras: Vec<&str> = found.optional.iter().map(|c| c.name.as_str()).collect();
    assert_eq!((extras, found.left_out[0].name.as_str()), (vec!["flow"], "demand_rad"));
    let sliding = read_header("time_s,velocity_m_s,force_n,demand_m", "").unwrap();
    assert_eq!((sliding.optional.len(), sliding.left_out[0].name.as_str()), (0, "demand_m"));
    let mapped = "time_s,velocity_rad_s,torque_nm,demand_rad";
    let found = read_header(mapped, "position_rad=demand_rad").unwrap();
    assert_eq!(found.optional[0].quantity, Some(Quantity::Position));
    assert!(found.left_out.is_empty());
}

#[test]
fn layout_with_position_on_either_side_of_the_gear_keeps_both() {
    let found =
        read_header("time_s,velocity_rad_s,torque_nm,joint_position_rad,position_rad", "").unwrap();
    let kept: Vec<(&str, Option<Quantity>)> =
        found.optional.iter().map(|c| (c.name.as_str(), c.quantity)).collect();
    let both = [("joint_position_rad", None), ("position_rad", Some(Quantity::Position))];
    assert_eq!((kept, found.notes.len()), (both.to_vec(), 0));
    let mapped = "time_s,velocity_rad_s,torque_nm,position_rad,second";
    let found = read_header(mapped, "joint_position_rad=second:deg").unwrap();
    let second = &found.optional[1];
    assert_eq!((second.name.as_str(), second.quantity), ("joint_position_rad", None));
    assert!(second.reading.conversion.is_some());
}

#[test]
fn layout_with_joint_position_alone_reads_it_as_the_position() {
    for (names, columns) in [
        ("time_s,velocity_rad_s,torque_nm,joint_position_rad", ""),
        ("time_s,velocity_rad_s,torque_nm,enc", "joint_position_rad=enc:deg"),
    ] {
        let found = read_header(names, columns).unwrap();
        assert_eq!(found.optional[0].quantity, Some(Quantity::Position), "{columns}");
        assert_eq!(found.optional[0].name, "position_rad");
        let note = found.notes.iter().find(|note| note.contains("joint_position_rad"));
        let note = note.expect("a note on the column");
        message::check("headers", "joint position alone", note, &["f.csv", " position_rad"]);
        assert!(found.left_out.is_empty(), "{:?}", found.left_out);
    }
    let without_velocity = read_header("time_s,torque_nm,joint_position_rad", "").unwrap();
    assert!(without_velocity.is_position);
}

#[test]
fn layout_with_missing_columns_lists_them_with_a_hint() {
    let error = read_header("time_s,dq,tau", "").unwrap_err();
    let DataError::MissingColumns { missing, count, .. } = &error else { panic!("{error}") };
    assert_eq!((&missing[..], *count), (&["velocity_rad_s", "torque_nm"][..], 3));
    let pairs = "columns velocity_rad_s=dq,torque_nm=tau";
    let parts = ["f.csv", "time_s, dq, tau", "velocity_m_s", "force_n", pairs];
    message::check("headers", "missing columns", &error.to_string(), &parts);
}

#[test]
fn layout_with_mapped_names_prefers_them() {
    let found = read_header("t,dq,torque_nm,u", "time_s=t,velocity_rad_s=dq,torque_nm=u").unwrap();
    assert_eq!(required_indices(&found), [0, 1, 3]);
    assert!(found.optional.is_empty());
    assert_eq!(found.left_out[0].name, "torque_nm");
    let parts = ["--columns", "torque_nm", " u"];
    message::check("headers", "name read from another column", &found.left_out[0].why, &parts);
}

#[test]
fn layout_with_two_swapped_names_swaps_columns() {
    let found = read_header(
        "time_s,velocity_rad_s,torque_nm,load_torque_nm",
        "torque_nm=load_torque_nm,load_torque_nm=torque_nm",
    )
    .unwrap();
    assert_eq!(required_indices(&found), [0, 1, 3]);
    assert_eq!(
        (found.optional[0].quantity, found.optional[0].reading.index),
        (Some(Quantity::LoadTorque), 2)
    );
    assert!(found.left_out.is_empty());
}

#[test]
fn layout_with_unknown_name_in_pair_returns_error_with_name() {
    let error = refused("t,v,f", "time_s=t,velocity_m_s=speed");
    let parts = ["f.csv", "columns velocity_m_s=speed:", " speed,", "t, v, f"];
    message::check("headers", "unknown column in a pair", &error, &parts);
    let error = refused("t,v,f", "torque_Nm=f");
    let parts = ["columns torque_Nm=f:", " torque_Nm,", "run, time_s"];
    message::check("headers", "unknown name in a pair", &error, &parts);
    let error = refused("t,v,f", "time_s=t,time_s=v");
    message::check("headers", "name twice in the pairs", &error, &["columns", "time_s"]);
}

#[test]
fn layout_with_duplicate_name_returns_error() {
    let error = read_header("time_s,velocity_rad_s,x,torque_nm,x", "").unwrap_err();
    let DataError::Cell(cell) = &error else { panic!("{error}") };
    assert_eq!((cell.row, &*cell.column), (1, "x"));
    message::check("headers", "name twice", &error.to_string(), &["f.csv", "3 and 5"]);
}

#[test]
fn layout_with_two_targets_returns_error_unless_mapped() {
    let both = "time_s,velocity_rad_s,torque_nm,force_n";
    let error = read_header(both, "").unwrap_err();
    let DataError::Cell(cell) = &error else { panic!("{error}") };
    assert_eq!((cell.row, &*cell.column), (1, "force_n"));
    message::check("headers", "two targets", &error.to_string(), &["torque_nm"]);
    let chosen = read_header("time_s,velocity_rad_s,tau,force_n", "torque_nm=tau").unwrap();
    assert_eq!(chosen.joint, JointKind::Revolute);
    assert_eq!(chosen.left_out[0].name, "force_n");
}

#[test]
fn layout_with_mixed_joint_kinds_returns_error_unless_mapped() {
    let error = refused("time_s,velocity_rad_s,force_n", "");
    let parts = ["force_n", "torque_nm", "velocity_rad_s"];
    message::check("headers", "mixed joint kinds", &error, &parts);
    let mixed = read_header("time_s,velocity_m_s,u", "torque_nm=u").unwrap();
    assert_eq!(mixed.joint, JointKind::Revolute);
    assert_eq!(mixed.notes.len(), 1);
}

#[test]
fn layout_with_numbers_or_nameless_columns_reports_them() {
    let error = read_header("0.0,1.5,-3e2", "").unwrap_err();
    assert!(!matches!(error, DataError::MissingColumns { .. }));
    message::check("headers", "numbers", &error.to_string(), &["f.csv", "row 1"]);
    let found = read_header(",time_s,velocity_rad_s,torque_nm", "").unwrap();
    assert_eq!(found.left_out[0].name, "number 1");
}
