"""What models and results show: print, frames, residuals with the labels of the log, and figures."""

import re

import matplotlib
import numpy
import pandas
import polars
import pytest
from frames import as_pandas, as_polars
from matplotlib import pyplot

import friction

matplotlib.use("Agg")


@pytest.fixture(scope="module")
def fit(frame):
    return friction.identify(frame, "lugre", starts=1)


@pytest.fixture(scope="module")
def compared(frame):
    return friction.compare(frame, ["linear", "stribeck"])


@pytest.fixture(autouse=True)
def closed_figures():
    yield
    pyplot.close("all")


def lists_parameters(text, model):
    """Returns True if a text has a line with name, value, unit, standard error and state of each parameter."""
    lines = [line.split() for line in text.splitlines()]
    for name, own in model.parameters.items():
        error = [] if own.std_error is None else [f"{own.std_error:.4g}"]
        if [name, f"{own.value:.4g}", *own.unit.split(), *error, own.state] not in lines:
            return False
    return len(model.parameters) > 0


def test_print_shows_parameters_with_units_and_states(fit, found, compared, tmp_path):
    model = fit.model
    assert {own.state for own in model.parameters.values()} <= {"determined", "not-determined", "at-start", "at-bound"}
    for text in (str(model), str(fit)):
        assert lists_parameters(text, model)
    assert f"{fit.test['rmse']:.4g} Nm held out" in str(fit) and all(verdict in str(fit) for verdict in fit.verdicts)
    assert lists_parameters(str(found), found.model) and all(line in str(found) for line in found.story)
    assert lists_parameters(str(compared), compared.best) and all(line in str(compared) for line in compared.summary)
    model.save(tmp_path / "params.toml")
    assert lists_parameters(str(friction.Model.load(tmp_path / "params.toml")), model)
    for one in (model, fit, found, compared):
        assert repr(one).startswith("<") and len(repr(one)) < 100 and "\n" not in repr(one)
    assert str(friction.Model("dahl")) == "<Model dahl, not fitted>"


def test_notebook_shows_parameters_in_place_of_an_estimator_diagram(fit):
    shown = fit.model._repr_mimebundle_()
    assert shown["text/html"].count("<tr>") == 1 + len(fit.model.parameters) and "coulomb_torque" in shown["text/html"]
    assert shown["text/html"] in fit._repr_html_() and "<td>lugre</td>" in fit._repr_html_()
    assert "not fitted" in friction.Model("<lugre>")._repr_html_() and "<lugre>" not in friction.Model("<lugre>")._repr_html_()


def test_to_pandas_has_the_values_of_the_result(fit, found, compared):
    for frame in (fit.to_pandas(), fit.model.to_pandas()):
        assert list(frame.columns) == ["value", "unit", "std_error", "state"]
        own = fit.model.parameters
        assert list(frame.index) == list(own)
        assert frame["value"].to_dict() == {name: one.value for name, one in own.items()}
        assert frame["state"].to_dict() == {name: one.state for name, one in own.items()}
    causes = found.to_pandas()
    assert list(causes.index) == [one.cause for one in found.candidates]
    assert list(causes["gain"]) == [one.gain for one in found.candidates] and found.cause in causes.index
    models = compared.to_pandas()
    assert models["test_rmse"].is_monotonic_increasing and list(models.index[models["is_recommended"]]) == [compared.best.name]
    for document in compared.to_dict()["models"]:
        assert models.loc[document["model"], "train_rmse"] == document["train"]["rmse"]
    simulated = friction.simulate("low-speed", runs=1, seconds=1)
    assert list(simulated.to_pandas().columns) == simulated.data.column_names and len(simulated.to_pandas()) == len(simulated.data)


def test_residuals_have_the_labels_of_the_log_and_the_values_of_its_files(frame, fit, found, tmp_path):
    residuals = fit.residuals()
    assert list(residuals.columns) == ["run", "time_s", "torque_nm", "predicted_torque_nm", "residual_torque_nm"]
    assert residuals.index.equals(frame.index) and (residuals["torque_nm"] == frame["torque_nm"]).all()
    rows = pandas.read_parquet(fit.save(tmp_path) / "rows.parquet")
    for name in ("time_s", "predicted_torque_nm", "residual_torque_nm"):
        assert residuals[name].to_numpy() == pytest.approx(rows[name].to_numpy(), abs=1e-12)
    rms = float((residuals["residual_torque_nm"] ** 2).mean() ** 0.5)
    assert rms == pytest.approx(fit.to_dict()["prediction"]["rmse"], rel=1e-9)
    assert fit.model.residuals(frame).equals(residuals)
    assert fit.model.residuals(frame.drop(columns="torque_nm"), frame["torque_nm"]).equals(residuals)
    half = frame[frame["run"] != 0]
    assert fit.residuals(half).equals(residuals.loc[half.index])
    swapped = frame.sort_values(["time_s", "run"], kind="stable")
    assert friction.identify(swapped, "linear", starts=1).residuals().index.equals(swapped.index)
    after = float((found.residuals(of="extended")["residual_torque_nm"] ** 2).mean())
    assert after < float((found.residuals(of="baseline")["residual_torque_nm"] ** 2).mean())
    assert found.residuals()["predicted_torque_nm"].equals(found.model.predict(frame).rename("predicted_torque_nm"))


def test_residuals_of_a_log_in_other_units_are_in_si_units(foreign):
    frame = as_pandas(foreign)
    fit = friction.identify(frame, "lugre", columns=foreign.columns, starts=1)
    residuals = fit.residuals()
    # A row without a torque has no residual.
    measured = frame["tau"].dropna()
    assert residuals.index.equals(measured.index) and list(residuals["run"]) == list(frame.loc[measured.index, "run"])
    assert residuals["torque_nm"].to_numpy() == pytest.approx(measured.to_numpy() / 1000)
    assert float((residuals["residual_torque_nm"] ** 2).mean() ** 0.5) == pytest.approx(fit.to_dict()["prediction"]["rmse"], rel=1e-9)
    for data in (as_polars(foreign), foreign.path):
        other = fit.residuals(data)["residual_torque_nm"]
        assert other.to_numpy() == pytest.approx(residuals["residual_torque_nm"].to_numpy(), abs=1e-9)
    parts = [part for _, part in frame.groupby("run", observed=True)]
    assert len(friction.identify(parts, "linear", columns=foreign.columns, starts=1).residuals()) == len(measured)


def test_residuals_of_a_torque_with_the_other_sign_are_small(frame, fit):
    turned = friction.identify(frame.assign(torque_nm=-frame["torque_nm"]), "lugre", starts=1).residuals()
    assert turned["residual_torque_nm"].to_numpy() == pytest.approx(fit.residuals()["residual_torque_nm"].to_numpy(), abs=1e-9)


def test_residuals_turn_a_torque_only_where_the_checks_of_the_log_do(frame, fit):
    # A load may drive a joint in one direction, so the checks leave its torque as logged.
    ahead = frame[frame["velocity_rad_s"] > 0]
    driven = ahead.assign(torque_nm=-ahead["torque_nm"])
    residuals = fit.model.residuals(driven)
    assert len(residuals) > 100 and (residuals["torque_nm"] == driven["torque_nm"].loc[residuals.index]).all()
    assert fit.model.score(driven) < 0


def test_predict_keeps_the_index_of_pandas_and_the_order_of_others(frame, fit):
    torque = fit.model.predict(frame)
    assert isinstance(torque, pandas.Series) and torque.name == "torque_nm" and torque.index.equals(frame.index)
    assert (frame["torque_nm"] - torque).std() < 0.2
    velocity = pandas.Series(numpy.linspace(-1.0, 1.0, 50), index=pandas.date_range("2024", periods=50, freq="s"))
    assert fit.model.predict(velocity, 1e-3).index.equals(velocity.index)
    for data in (polars.from_pandas(frame), frame.to_dict("list")):
        predicted = fit.model.predict(data)
        assert isinstance(predicted, numpy.ndarray) and numpy.array_equal(predicted, torque.to_numpy())


def texts(axes):
    return [text.get_text() for text in axes.get_legend().get_texts()]


def test_plot_of_a_model_draws_its_friction_in_both_directions(frame, fit, found):
    linear = friction.Model("linear").fit(frame)
    _, axes = pyplot.subplots()
    assert linear.plot(ax=axes, speed=2.0) is axes
    coulomb, viscous = (linear.parameters[name].value for name in ("coulomb_torque", "viscous_friction"))
    forward, backward = axes.get_lines()[:2]
    for line, sign in ((forward, 1.0), (backward, -1.0)):
        velocity = numpy.asarray(line.get_xdata())
        assert sign * velocity.max() <= 2.0 and (sign * velocity).max() == pytest.approx(2.0) and (sign * velocity > 0).all()
        assert line.get_ydata() == pytest.approx(sign * coulomb + viscous * velocity, rel=1e-6)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("velocity (rad/s)", "friction torque (Nm)")
    for name, own in fit.model.parameters.items():
        (text,) = [text for text in texts(fit.model.plot()) if text.startswith(f"{name} ")]
        assert f" {own.unit}" in text and text.endswith(f", {own.state}")

    def fastest(**covariates):
        return found.extended.plot(speed=3.0, **covariates).get_lines()[0].get_ydata()[-1]

    size = found.findings[0].size.value
    assert fastest(pressure_diff_pa=2e5) - fastest(pressure_diff_pa=1e5) == pytest.approx(1e5 * size, rel=0.05)
    assert "pressure_diff_pa = " in found.extended.plot().get_title()
    with pytest.raises(friction.FrictionError, match="found the columns temperature_c, the model .* reads pressure_diff_pa"):
        found.extended.plot(temperature_c=20.0)
    with pytest.raises(ValueError, match="speed"):
        linear.plot(speed=0.0)
    without_means = friction.Model.from_toml(re.sub(r"(?ms)^\[log_means\]\n.*?(?=^\[|\Z)", "", found.extended.toml))
    with pytest.raises(friction.FrictionError, match="states no mean of pressure_diff_pa"):
        without_means.plot()
    assert without_means.plot(pressure_diff_pa=0.0).get_title().endswith("at pressure_diff_pa = 0")


def test_plot_of_a_fit_draws_measured_predicted_and_residual(frame, fit):
    axes = fit.plot()
    held_out = fit.to_dict()["data"]["test_runs"][0]
    assert axes.get_title().startswith(f"Run {held_out}, held out. Held-out error {fit.test['rmse']:.4g} Nm")
    rows = fit.residuals()[fit.residuals()["run"] == held_out]
    lines = {line.get_label(): line.get_ydata() for line in axes.get_lines() if not line.get_label().startswith("_")}
    assert set(lines) == {"measured torque", "predicted by lugre", "residual"} == set(texts(axes))
    assert lines["measured torque"] == pytest.approx(rows["torque_nm"].to_numpy())
    assert lines["measured torque"] - lines["predicted by lugre"] == pytest.approx(lines["residual"])
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time (s)", "torque (Nm)")
    _, own = pyplot.subplots()
    assert fit.plot(ax=own, run=0) is own and own.get_title().startswith("Run 0")
    with pytest.raises(friction.FrictionError, match="run='77': found no such run, expected one of 0, 1"):
        fit.plot(run=77)
    # Of a single run, blocks are held out.
    single = frame[frame["run"] == 0].drop(columns="run")
    assert friction.identify(single, "linear", starts=1).plot().get_title().startswith("Run data. Held-out error")


def test_plot_of_a_diagnosis_draws_the_residual_before_and_after(found):
    _, axes = pyplot.subplots()
    assert found.plot(ax=axes) is axes and axes.get_xlabel() == "pressure_diff_pa" and "(Nm)" in axes.get_ylabel()
    document = found.to_dict()
    assert f"{document['baseline']['test_rmse']:.4g} to {document['extended']['test_rmse']:.4g} Nm" in axes.get_title()
    lines = {line.get_label(): numpy.abs(line.get_ydata()).max() for line in axes.get_lines()}
    for direction in ("forward", "backward"):
        assert lines[f"extended: {found.extended.name}, {direction}"] < lines[f"{found.baseline.name}, {direction}"]


def test_plot_of_a_comparison_draws_a_bar_per_model(compared):
    _, axes = pyplot.subplots()
    assert compared.plot(ax=axes) is axes and "(Nm)" in axes.get_xlabel()
    assert [bar.get_width() for bar in axes.patches] == list(compared.to_pandas()["test_rmse"])
    names = [text.get_text() for text in axes.get_yticklabels()]
    assert names.count(f"{compared.best.name} (recommended)") == 1
