"""The Python module `friction` against the command line: equal documents, errors, models, tables."""

import json
import math

import conftest
import numpy
import pandas
import polars
import pyarrow
import pytest
from conftest import RUNS
from frames import KINDS, as_pandas, comparable, of_kind
from sklearn.model_selection import GroupKFold, cross_val_score

import friction


@pytest.mark.parametrize("kind", KINDS)
def test_diagnose_any_kind_of_input_equals_command_line(log, diagnosis, kind):
    found = friction.diagnose(of_kind(log, kind), columns=log.columns, name=str(log.path))
    ours = found.to_dict()
    assert comparable(ours) == comparable(diagnosis)
    if kind == "path":
        assert ours["data"] == diagnosis["data"]
    else:
        # Messages and results name a table as they name a file; the hash is that of the table.
        assert ours["data"]["files"] == diagnosis["data"]["files"]
        assert len(ours["data"]["sha256"][0]) == 64


def test_to_dict_of_comparison_and_fit_equal_command_line(plain):
    models = ["linear", "stribeck"]
    command = ["compare", plain.path, "--models", ",".join(models)]
    compared = friction.compare(plain.path, models)
    assert comparable(compared.to_dict()) == comparable(conftest.document(plain.path.parent, *command))
    assert compared.best.name == compared.to_dict()["chosen"]
    command = ["identify", plain.path, "--model", "stribeck", "--rigid-body", "inertia,offset"]
    fitted = friction.identify(plain.path, "stribeck", rigid_body=["inertia", "offset"])
    assert comparable(fitted.to_dict()) == comparable(conftest.document(plain.path.parent, *command))
    assert fitted.model.parameters["coulomb_torque"].unit == "Nm"
    assert fitted.test["rmse"] > 0


@pytest.fixture(scope="module")
def found(plain):
    return friction.diagnose(plain.path)


def test_diagnosis_names_the_hidden_cause(found):
    assert found.cause == "pressure-coulomb"
    assert 0 < found.gain <= 1 and found.gain_ci95[0] <= found.gain <= found.gain_ci95[1]
    first = found.findings[0]
    assert (first.cause, first.columns) == ("pressure-coulomb", ("pressure_diff_pa",))
    assert first.size.unit == "Nm/Pa" and first.size.ci95[0] <= first.size.value <= first.size.ci95[1]
    assert len(found.story) == 5
    assert repr(found).startswith("<Diagnosis pressure-coulomb")


def test_diagnosis_properties_equal_its_document(found):
    document = found.to_dict()
    assert found.next_experiment == document["next_experiment"] != ""
    assert [one.cause for one in found.candidates] == [one["cause"] for one in document["candidates"]]
    reasons = [one.get("rejected_because", "") for one in document["candidates"]]
    assert [one.rejected_because for one in found.candidates] == reasons
    assert all(not one.rejected_because for one in found.candidates if one.cause == found.cause)
    for model, name in ((found.baseline, "baseline"), (found.extended, "extended"), (found.model, "driver")):
        assert model.name == document[name]["model"]
        for parameter, value in document[name].get("params", {}).items():
            assert model.parameters[parameter].value == value["value"]
    assert "pressure-coulomb" in found.extended.name and "pressure-coulomb" not in found.baseline.name


def test_diagnosis_pages_and_files_equal_command_line(found, plain, tmp_path):
    assert found.html().startswith("<!DOCTYPE html>")
    screen = found._repr_html_()
    assert "pressure-coulomb" in screen and "<script" not in screen and len(screen) < 10_000
    out = found.save(tmp_path / "new" / "out")
    assert sorted(path.name for path in out.iterdir()) == ["diagnosis.json", "params.toml", "report.html", "rows.parquet"]
    assert json.loads((out / "diagnosis.json").read_text()) == found.to_dict()
    conftest.host_sim(plain.path.parent, "diagnose", plain.path, "--out", "cli")
    own, theirs = [
        [line for line in (folder / "params.toml").read_text().splitlines() if not line.startswith("# diagnose of")]
        for folder in (out, plain.path.parent / "cli")
    ]
    assert own == theirs


def test_model_predicts_log_with_small_error(found, plain):
    frame = as_pandas(plain)
    torque = found.model.predict(frame)
    error = frame["torque_nm"].to_numpy() - torque
    # The diagnosis states its held-out error; the prediction of the whole log is close to it.
    assert math.sqrt(float(numpy.mean(error**2))) < 1.5 * found.to_dict()["extended"]["test_rmse"]
    assert found.model.score(frame) > 0.9
    assert numpy.array_equal(found.model.predict(plain.path), torque)


def test_model_score_of_log_in_other_units_is_that_of_the_log(foreign):
    model = friction.Model("lugre", starts=1, columns=foreign.columns).fit(foreign.path)
    assert model.score(foreign.path) > 0.9
    frame = as_pandas(foreign)
    assert model.score(frame) == pytest.approx(model.score(foreign.path), abs=1e-9)
    assert model.score(frame.drop(columns="tau"), frame["tau"]) == pytest.approx(model.score(frame), abs=1e-9)
    assert len(model.predict(frame.drop(columns="tau"))) == len(frame)


def test_model_predict_with_unordered_rows_keeps_their_places(found, plain):
    frame = as_pandas(plain)
    torque = found.model.predict(frame)
    half = frame[frame["run"] != 0].reset_index(drop=True)
    assert numpy.array_equal(found.model.predict(half), torque[frame["run"] != 0])
    swapped = frame.sort_values(["time_s", "run"], kind="stable")
    assert numpy.allclose(found.model.predict(swapped), torque[swapped.index], atol=1e-9)
    damaged = frame.copy()
    damaged.loc[5, "velocity_rad_s"] = math.nan
    assert math.isnan(found.model.predict(damaged)[5]) or len(found.model.predict(damaged)) == len(frame)


def test_model_predict_with_adaptation_follows_rising_friction(found, plain):
    once = as_pandas(plain)
    # A gain moves by 2 % in a second of sliding, of which the log has ten.
    times = [once.assign(run=once["run"] + RUNS * at, time_s=once["time_s"] + 13_000 * at) for at in range(4)]
    frame = pandas.concat(times, ignore_index=True)
    frame["torque_nm"] *= numpy.linspace(1.0, 1.5, len(frame))

    def error(**options):
        residual = frame["torque_nm"].to_numpy() - found.model.predict(frame, **options)
        return math.sqrt(float(numpy.nanmean(residual**2)))

    assert error(adapt=True) < 0.6 * error()
    assert error(adapt=True, adapt_range=(1.0, 1.0)) == pytest.approx(error(), rel=1e-9)
    for options in ({"adapt_memory": 20.0}, {"adapt": True, "dt": 0.01}):
        with pytest.raises(TypeError, match="adapt"):
            found.model.predict(frame, **options)
    with pytest.raises(friction.FrictionError, match="memory_s"):
        found.model.predict(frame, adapt=True, adapt_memory=0.1)


def test_model_predict_of_samples_follows_the_law(found):
    velocity = numpy.full(2000, 1.0)
    pressure = numpy.linspace(0.0, 1e6, 2000)
    torque = found.extended.predict(velocity, 1e-3, pressure_diff_pa=pressure)
    slope = (torque[-1] - torque[1000]) / (pressure[-1] - pressure[1000])
    assert slope == pytest.approx(found.findings[0].size.value, rel=0.05)
    with pytest.raises(friction.FrictionError, match="needs the columns pressure_diff_pa"):
        found.extended.predict(velocity, 1e-3)
    with pytest.raises(ValueError, match="dt"):
        found.model.predict(velocity, 0.0)


def test_model_saved_and_loaded_has_the_same_values(found, tmp_path):
    found.model.save(tmp_path / "params.toml")
    loaded = friction.Model.load(tmp_path / "params.toml")
    # The file states values with the precision of the driver's number type.
    for name, parameter in found.model.parameters.items():
        assert loaded.parameters[name].value == pytest.approx(parameter.value, rel=1e-6)
        assert loaded.parameters[name].unit == parameter.unit
    assert b"float" in loaded.export("c")
    assert loaded.export("urdf").startswith(b"<")
    with pytest.raises(friction.ModelError, match="joint: missing"):
        friction.Model.from_toml("schema = 1\n")


@pytest.mark.parametrize("form", ["record", "rust", "c", "onnx", "mujoco", "urdf"])
def test_export_equals_command_line(found, plain, tmp_path, form):
    found.model.save(tmp_path / "params.toml")
    settings = {"torque_constant_nm_per_a": 0.9, "torque_limit_nm": 3.0, "current_limit_a": 5.0, "scale": 0.7}
    exported = found.model.export(form, compensator=settings)
    own = exported.save(tmp_path / "own")
    given = ",".join(f"{name}={value}" for name, value in settings.items())
    document = conftest.document(tmp_path, "export", "params.toml", "--to", form, "--out", "cli", "--compensator", given)
    theirs = tmp_path / "cli"
    assert sorted(path.name for path in own.iterdir()) == sorted(path.name for path in theirs.iterdir())
    assert all((own / path.name).read_bytes() == path.read_bytes() for path in theirs.iterdir())
    assert exported == (theirs / exported.name).read_bytes() and isinstance(exported, bytes)
    assert list(exported.notes) == document["notes"] != []


def test_export_of_a_form_without_support_names_it_in_keywords(found):
    with pytest.raises(friction.FrictionError, match="found no section .network."):
        found.model.export("network")
    with pytest.raises(friction.FrictionError, match='to="pdf": expected one of record, rust, c, network, onnx'):
        found.model.export("pdf")


def test_export_with_a_current_asks_for_settings_in_keywords(found):
    with pytest.raises(friction.FrictionError, match=r"lacks scale, torque_limit_nm.*compensator="):
        found.model.export("record")


def test_export_with_unsupported_term_suggests_forms_in_keywords(plain):
    model = friction.identify(plain.path, "linear+warm-up", starts=1).model
    with pytest.raises(friction.FrictionError, match='use to="rust" or to="record"'):
        model.export("c")


def test_model_works_with_group_k_fold(plain):
    frame = as_pandas(plain)
    scores = cross_val_score(
        friction.Model("lugre", starts=1),
        frame.drop(columns="torque_nm"),
        frame["torque_nm"],
        groups=frame["run"],
        cv=GroupKFold(RUNS),
    )
    assert len(scores) == RUNS and min(scores) > 0.5, scores
    held = frame["run"] == frame["run"].iloc[0]
    alone = friction.Model("lugre", starts=1).fit(frame[~held]).score(frame[held])
    assert any(score == pytest.approx(alone, rel=1e-9) for score in scores), (alone, scores)
    model = friction.Model("stribeck").fit(frame)
    # All rows are used, as scikit-learn expects of a fit.
    assert f"# {len(frame)} rows in {RUNS} runs" in model.toml
    assert model.score(frame) > 0.5
    assert set(model.get_params()) >= {"name", "rigid_body"}
    assert repr(model.set_params(name="linear")) == "<Model linear, not fitted>"
    with pytest.raises(friction.FrictionError, match="not fitted"):
        model.predict(frame)


def test_diagnose_given_model_evaluates_it_unchanged(plain):
    model = friction.identify(plain.path, "linear").model
    given = friction.diagnose(plain.path, model=model).to_dict()["baseline"]
    assert given["model"] == "linear"
    assert given["params"]["coulomb_torque"]["value"] == model.parameters["coulomb_torque"].value


def test_simulate_equals_command_line(folder):
    simulated = friction.simulate("underwater-joint", hide=["pressure-coulomb"], seed=5, runs=RUNS, seconds=4, rate_hz=250)
    assert simulated.csv == (folder / "joint.csv").read_text()
    assert simulated.truth == json.loads((folder / "simulated" / "truth.json").read_text())
    table = pyarrow.table(simulated.data)
    assert table.num_rows == len(simulated.data) == len(simulated.csv.splitlines()) - 1
    assert table.column_names == simulated.csv.splitlines()[0].split(",")
    with pytest.raises(friction.FrictionError, match="expected one of underwater-joint"):
        friction.simulate("nothing")


def test_read_trace_has_the_rows_of_the_log(folder):
    trace = friction.read_trace(folder / "simulated" / "trace.log")
    frame = polars.DataFrame(trace)
    assert {"run", "time_s", "velocity_rad_s", "torque_nm", "pressure_diff_pa"} <= set(frame.columns)
    assert frame.height == len((folder / "joint.csv").read_text().splitlines()) - 1
    assert friction.diagnose(trace).cause == "pressure-coulomb"


@pytest.mark.parametrize(
    "arguments, kind, message",
    [
        ({"data": "missing.csv"}, friction.DataError, "missing.csv: cannot be read"),
        ({"columns": {"torque_nm": "tau"}}, friction.DataError, 'columns={"torque_nm": "tau"}: found no column tau'),
        ({"where": {"run": [77]}}, friction.DataError, 'where={"run": "77"}'),
        ({"skip": 10**6}, friction.DataError, "skip=1000000"),
        ({"model": "lugra"}, friction.ModelError, 'model="lugra": unknown model'),
        ({"rigid_body": ["mass"]}, friction.ModelError, "rigid_body=: unknown part"),
        ({"data": 5}, TypeError, "expected a path, a data frame"),
        ({"tail": 2.0}, friction.DataError, "between 0 and 1"),
        ({"hold_out": {"run": 0, "gear": 1}}, ValueError, "one column"),
        ({"motion": "guessed"}, friction.FrictionError, "smoothed"),
        ({"as_logged": ["typo"]}, friction.FrictionError, "unknown kind"),
    ],
)
def test_diagnose_with_wrong_argument_names_it(plain, arguments, kind, message):
    with pytest.raises(kind) as raised:
        friction.diagnose(**{"data": plain.path, **arguments})
    assert message in str(raised.value)
    assert "--" not in str(raised.value) and "\n" not in str(raised.value)


def test_data_error_states_file_row_and_column(plain):
    frame = as_pandas(plain)
    missing = frame.rename(columns={"velocity_rad_s": "dq"}).drop(columns="position_rad", errors="ignore")
    with pytest.raises(friction.DataError) as raised:
        friction.diagnose(missing, name="bench")
    assert raised.value.file == "bench" and raised.value.row is None
    assert 'columns={"velocity_rad_s": "dq"}' in raised.value.expected
    text = frame.astype({"torque_nm": object})
    text.loc[text.index % 3 == 0, "torque_nm"] = "off"
    with pytest.raises(friction.DataError) as raised:
        friction.diagnose({name: text[name].tolist() for name in text})
    assert (raised.value.row, raised.value.column) == (2, "torque_nm")
    assert raised.value.found == '"off"'
    with pytest.raises(friction.DataError, match='row 2, column torque_nm: found "off"'):
        friction.diagnose(text)
    with pytest.raises(friction.DataError) as raised:
        friction.diagnose({"time": [0.0], "0x606C:00": [1.0], "0x6077:00": [1.0]}, preset="ethercat", name="drive")
    assert str(raised.value).startswith('drive: preset="ethercat": found velocity_rad_s in 0x606C:00')
    assert 'columns={"velocity_rad_s": "0x606C:00:UNIT"}' in raised.value.expected
    several = pandas.concat([frame.assign(joint=1), frame.assign(joint=2)])
    with pytest.raises(friction.DataError) as raised:
        friction.diagnose(several)
    assert raised.value.joints == ("1", "2") and 'where={"joint": "1"}' in str(raised.value)


def test_each_joint_equals_each_joint_of_the_command_line(plain, tmp_path):
    frame = as_pandas(plain)
    both = pandas.concat([frame.assign(joint="left"), frame.assign(joint="right", torque_nm=1.1 * frame["torque_nm"])])
    both.to_csv(tmp_path / "robot.csv", index=False)
    fits = friction.each_joint(friction.identify, tmp_path / "robot.csv", "linear")
    result = conftest.host_sim(tmp_path, "identify", tmp_path / "robot.csv", "--model", "linear", "--out", "cli")
    assert result.returncode == 0, result.stderr
    assert list(fits) == ["left", "right"]
    for joint, own in fits.items():
        theirs = json.loads((tmp_path / "cli" / f"joint-{joint}" / "fit.json").read_text())
        assert comparable(own.to_dict()) == comparable(theirs)
    assert list(friction.each_joint(friction.identify, frame, "linear")) == [""]
    both.loc[both["joint"] == "right", "torque_nm"] = 1.0
    with pytest.raises(friction.DataError, match="^joint right: .*torque"):
        friction.each_joint(friction.identify, both, "linear")


def test_column_of_lists_is_left_out_or_rejected(plain):
    table = pyarrow.table(as_pandas(plain))
    lists = pyarrow.array([[1.0]] * table.num_rows)
    fitted = friction.identify(table.append_column("raw", lists), "linear").to_dict()
    assert all(column["name"] != "raw" for column in fitted["data"]["columns"])
    place = table.column_names.index("torque_nm")
    with pytest.raises(friction.DataError, match="column torque_nm: found a list, expected a column of plain numbers"):
        friction.identify(table.set_column(place, "torque_nm", lists), "linear")


@pytest.mark.parametrize("of", [pandas.array, polars.Series, pyarrow.array])
def test_dict_of_nullable_columns_is_read(of):
    velocity = [math.sin(0.05 * row) for row in range(400)]
    torque = [None if row == 9 else math.copysign(1.0, v) + 0.2 * v for row, v in enumerate(velocity)]
    data = {"time_s": of([0.01 * row for row in range(400)]), "velocity_rad_s": of(velocity), "torque_nm": of(torque)}
    data["run"] = of([row // 100 for row in range(400)])
    fitted = friction.identify(data, "linear").to_dict()
    assert (fitted["data"]["runs"], fitted["data"]["rows_left_out"]) == (4, 1)


def test_tables_of_several_parts_join_as_files_do(plain):
    frame = as_pandas(plain)
    parts = [part.drop(columns="run") for _, part in frame.groupby("run")]
    fitted = friction.identify(parts, "linear").to_dict()
    assert fitted["data"]["runs"] == len(parts)
    assert fitted["data"]["files"] == [f"data-{number}" for number in range(1, len(parts) + 1)]
    held = friction.identify(parts[:-1], "linear", test=parts[-1]).to_dict()
    assert held["data"]["test_runs"] == ["test"]
    with pytest.raises(TypeError, match="found both"):
        friction.identify([parts[0], plain.path], "linear")


def test_dict_without_numpy_and_with_missing_values_is_read():
    rows = range(400)
    velocity = [math.sin(0.05 * row) for row in rows]
    data = {
        "time_s": [0.01 * row for row in rows],
        "velocity_rad_s": velocity,
        "torque_nm": [None if row == 9 else math.copysign(1.0, v) + 0.2 * v for row, v in zip(rows, velocity)],
        "note": [None if row % 2 else "ok" for row in rows],
    }
    fitted = friction.identify(data, "linear")
    assert fitted.to_dict()["data"]["rows_left_out"] == 1
    assert fitted.model.parameters["coulomb_torque"].value == pytest.approx(1.0, abs=0.05)
    with pytest.raises(friction.DataError, match="rows in column"):
        friction.identify({**data, "torque_nm": [1.0]}, "linear")
