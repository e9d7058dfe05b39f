"""`friction.Model` as an estimator: scikit-learn's tools, arrays with names, pickles, and the package without its optional parts."""

import copy
import pickle
import subprocess
import sys

import conftest
import numpy
import pandas
import pytest
from conftest import RUNS
from frames import comparable
from sklearn.base import BaseEstimator, RegressorMixin, clone, is_regressor
from sklearn.exceptions import NotFittedError
from sklearn.model_selection import GridSearchCV, GroupKFold, cross_val_score
from sklearn.pipeline import Pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn.utils.estimator_checks import check_estimator

import friction

#: scikit-learn's checks that do not fit. The others fit matrices of random numbers without a time and without names, so they
#: cannot pass; the tests here check the same on a log.
CHECKS_WITHOUT_DATA = {
    "check_estimator_cloneable",
    "check_estimator_tags_renamed",
    "check_valid_tag_types",
    "check_estimator_repr",
    "check_no_attributes_set_in_init",
    "check_do_not_raise_errors_in_init_or_set_params",
    "check_mixin_order",
    "check_parameters_default_constructible",
    "check_get_params_invariance",
    "check_set_params",
    "check_estimators_unfitted",
}
NAMES = ["time_s", "run", "velocity_rad_s"]


@pytest.fixture(scope="module")
def fitted(frame):
    return friction.Model("lugre", starts=1).fit(frame)


def test_model_is_an_estimator_that_clones():
    model = friction.Model("stribeck", columns={"torque_nm": "tau:mNm"}, torque_constant=0.9, feature_names=NAMES)
    assert isinstance(model, BaseEstimator) and isinstance(model, RegressorMixin) and is_regressor(model)
    twin = clone(model)
    assert twin is not model and twin.get_params() == model.get_params()
    assert twin.get_params()["torque_constant"] == 0.9 and twin.get_params()["feature_names"] == NAMES
    with pytest.raises(ValueError, match="laws"):
        model.set_params(laws="lugre")


def test_checks_of_scikit_learn_without_data_pass():
    found = {result["check_name"]: result["status"] for result in check_estimator(friction.Model("linear"), on_fail=None)}
    assert CHECKS_WITHOUT_DATA <= set(found)
    assert not [name for name in CHECKS_WITHOUT_DATA if found[name] != "passed"]


def test_fit_changes_neither_arguments_nor_data_and_repeats(frame):
    model = friction.Model("linear", rigid_body=["offset"])
    before, data = model.get_params(), frame.copy()
    assert model.fit(data) is model and model.get_params() == before and data.equals(frame)
    first = model.predict(frame)
    assert model.fit(data).predict(frame).equals(first)
    assert model.n_features_in_ == len(frame.columns) and list(model.feature_names_in_) == list(frame.columns)
    assert repr(model.set_params(name="stribeck")) == "<Model stribeck, not fitted>"
    assert not hasattr(model, "n_features_in_")
    with pytest.raises(NotFittedError, match="not fitted"):
        model.predict(frame)


def test_arrays_with_names_equal_a_frame(frame):
    features, torque = frame[NAMES], frame["torque_nm"]
    expected = friction.Model("stribeck").fit(features, torque)
    array = features.astype(float).to_numpy()
    records = features.to_records(index=False)
    named = friction.Model("stribeck", feature_names=NAMES)
    for model, data in ((named, array), (friction.Model("stribeck"), records), (friction.Model("stribeck"), features.to_dict("list"))):
        model.fit(data, torque.to_numpy())
        assert model.parameters == expected.parameters
        predicted = model.predict(data)
        assert isinstance(predicted, numpy.ndarray) and numpy.array_equal(predicted, expected.predict(features).to_numpy())
        assert model.score(data, torque) == expected.score(features, torque)
        assert list(model.feature_names_in_) == NAMES
    assert friction.Model("stribeck").fit(features, frame[["torque_nm"]]).parameters == expected.parameters
    folds = {"groups": frame["run"].to_numpy(), "cv": GroupKFold(2)}
    assert numpy.array_equal(
        cross_val_score(named, array, torque.to_numpy(), **folds), cross_val_score(expected, features, torque, **folds)
    )
    with pytest.raises(TypeError, match=r"array of 3 columns without names.*feature_names="):
        friction.Model("stribeck").fit(array, torque)
    with pytest.raises(ValueError, match="array of 2 columns, expected 3: time_s, run, velocity_rad_s"):
        named.fit(array[:, :2], torque)
    with pytest.raises(ValueError, match="2 rows in column torque_nm"):
        expected.fit(features, [1.0, 2.0])


def test_grid_search_and_pipeline_choose_the_law(frame):
    pipeline = Pipeline([("keep", FunctionTransformer()), ("model", friction.Model("linear", starts=1))])
    search = GridSearchCV(pipeline, {"model__name": ["linear", "lugre"]}, cv=GroupKFold(2))
    search.fit(frame.drop(columns="torque_nm"), frame["torque_nm"], groups=frame["run"])
    assert search.best_params_ == {"model__name": "lugre"}
    linear, lugre = search.cv_results_["mean_test_score"]
    assert linear < 0.9 < lugre
    direct = GridSearchCV(friction.Model(starts=1), {"name": ["linear", "lugre"]}, cv=GroupKFold(2))
    direct.fit(frame, groups=frame["run"])
    assert list(direct.cv_results_["mean_test_score"]) == pytest.approx([linear, lugre], rel=1e-9)
    assert direct.best_estimator_.predict(frame).equals(search.predict(frame).rename("torque_nm"))


def r2(residuals):
    squares = (residuals["torque_nm"] - residuals["torque_nm"].mean()) ** 2
    return 1 - (residuals["residual_torque_nm"] ** 2).sum() / squares.sum()


def test_torque_constant_scales_a_current_as_the_command_line_does(frame, tmp_path):
    drive = frame.assign(i_q=frame["torque_nm"] / 0.9).drop(columns="torque_nm")
    drive.to_csv(tmp_path / "drive.csv", index=False)
    columns = {"torque_nm": "i_q:A"}
    command = ["identify", "drive.csv", "--model", "linear", "--columns", "torque_nm=i_q:A", "--torque-constant", "0.9Nm/A"]
    theirs = conftest.document(tmp_path, *command)
    for constant in (0.9, numpy.float64(0.9), "0.9Nm/A", "900 mNm/A"):
        fit = friction.identify(tmp_path / "drive.csv", "linear", columns=columns, torque_constant=constant)
        ours = fit.to_dict()
        ours["data"]["files"] = theirs["data"]["files"]
        assert comparable(ours) == comparable(theirs)
        # The model of a result reads the same frame.
        assert fit.model.score(drive) == pytest.approx(fit.model.residuals(drive).pipe(r2), rel=1e-9)
    of_torque = friction.Model("linear").fit(frame)
    mapped = friction.Model("linear", columns=columns, torque_constant=0.9).fit(drive)
    features = drive.drop(columns="i_q")
    alone = friction.Model("linear", torque_constant=0.9).fit(features, drive["i_q"])
    for model in (mapped, alone):
        assert model.parameters["coulomb_torque"].value == pytest.approx(of_torque.parameters["coulomb_torque"].value, rel=1e-9)
    assert alone.score(features, drive["i_q"]) == pytest.approx(of_torque.score(frame), rel=1e-9)
    # Predictions are torques.
    assert mapped.predict(drive).to_numpy() == pytest.approx(of_torque.predict(frame).to_numpy(), rel=1e-9, abs=1e-12)
    assert len(alone.predict(features)) == len(features)
    with pytest.raises(friction.DataError, match='torque_constant="0.9Nm/A": found no torque_nm in amperes'):
        friction.Model("linear", torque_constant=0.9).fit(frame)
    force = {"time_s": [0.0, 1.0], "velocity_m_s": [0.0, 1.0], "i": [0.0, 1.0]}
    with pytest.raises(friction.FrictionError, match='torque_constant="-40.0N/A"'):
        friction.identify(force, "linear", columns={"force_n": "i:A"}, torque_constant=-40)


def test_pickles_and_copies_predict_the_same_bits(frame, fitted, found, tmp_path):
    (tmp_path / "model.pickle").write_bytes(pickle.dumps(fitted))
    restored = pickle.loads((tmp_path / "model.pickle").read_bytes())
    for twin in (restored, copy.copy(fitted), copy.deepcopy(fitted), pickle.loads(pickle.dumps(restored))):
        assert twin is not fitted and twin.predict(frame).equals(fitted.predict(frame))
        assert twin.parameters == fitted.parameters and twin.toml == fitted.toml
        assert (twin.get_params(), str(twin)) == (fitted.get_params(), str(fitted))
        assert bytes(twin.export("c")) == bytes(fitted.export("c"))
        twin.set_params(name="linear")
    assert fitted.name == "lugre" and len(fitted.predict(frame)) == len(frame)
    for model in (found.model, found.extended, found.baseline):
        assert pickle.loads(pickle.dumps(model)).predict(frame).equals(model.predict(frame))
    bare = pickle.loads(pickle.dumps(friction.Model("stribeck", starts=1, columns={"run": "trial"})))
    assert bare.get_params() == friction.Model("stribeck", starts=1, columns={"run": "trial"}).get_params()
    with pytest.raises(friction.FrictionError, match="not fitted"):
        bare.predict(frame)
    with pytest.raises(TypeError, match="Diagnosis: cannot be pickled.*pickle a model of it"):
        pickle.dumps(found)


def test_pickle_of_another_version_says_so(frame, fitted):
    state = fitted.__getstate__()
    assert state["_version"] == friction.__version__
    # A version that had fewer arguments.
    old = {name: value for name, value in state.items() if name != "feature_names"} | {"_version": "0.1.0"}
    restored = friction.Model.__new__(friction.Model)
    with pytest.warns(UserWarning, match=rf"pickled by friction 0\.1\.0, read by {friction.__version__}.*params.toml"):
        restored.__setstate__(old)
    assert restored.predict(frame).equals(fitted.predict(frame)) and restored.feature_names is None
    old["_fitted"] = ("schema = 99\n", [])
    with pytest.warns(UserWarning), pytest.raises(friction.ModelError, match=r"pickled by friction 0\.1\.0, cannot be read by"):
        friction.Model.__new__(friction.Model).__setstate__(old)


def python(code, folder):
    """Runs Python code in a process of its own and returns what it prints."""
    result = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, timeout=conftest.LIMIT_S)
    assert result.returncode == 0, result.stderr
    return result.stdout


def test_only_a_model_imports_scikit_learn(plain):
    # It takes longer to import than all of the package.
    code = f"""
import sys, friction
print(*{{name.split(".")[0] for name in sys.modules}})
fit = friction.identify({str(plain.path)!r}, "linear", starts=1)
assert str(fit) and len(fit.residuals()) and len(fit.to_pandas()) and "sklearn" not in sys.modules
assert "Model" in dir(friction) and friction.Model and "sklearn" in sys.modules
"""
    loaded = python(code, plain.path.parent).split()
    assert "friction" in loaded and not {"numpy", "pandas", "sklearn", "matplotlib", "pyarrow"} & set(loaded)


def test_package_works_without_its_optional_packages(plain, fitted):
    code = f"""
import sys
for name in ("numpy", "pandas", "sklearn", "matplotlib", "pyarrow"):
    sys.modules[name] = None
import copy, csv, pickle, friction
with open({str(plain.path)!r}) as file:
    rows = list(csv.DictReader(file))
log = {{name: [float(row[name]) for row in rows] for name in ("run", "time_s", "velocity_rad_s", "torque_nm")}}
model = friction.Model("linear", starts=1).fit(log)
twin = pickle.loads(pickle.dumps(copy.copy(model)))
assert type(model.predict(log)).__name__ == "array" and twin.predict(log) == model.predict(log)
assert model.get_params()["starts"] == 1 and list(model.feature_names_in_) == list(log)
try:
    model.set_params(law="lugre")
except ValueError as error:
    print(error)
for call in (model.plot, model.to_pandas, lambda: model.residuals(log), friction.identify(log, "linear", starts=1).plot):
    try:
        call()
    except ImportError as error:
        print(error)
print(model.set_params(name="stribeck"))
"""
    lines = python(code, plain.path.parent).splitlines()
    assert lines[0].startswith("unknown parameter law, expected one of name, columns")
    assert lines[1:4] == [
        "plot: matplotlib is missing: pip install matplotlib",
        "to_pandas: pandas is missing: pip install pandas",
        "residuals: pandas is missing: pip install pandas",
    ]
    assert lines[4].endswith("is missing: pip install pandas") and lines[5] == "<Model stribeck, not fitted>"


def test_unordered_runs_in_folds_keep_groups_whole(frame):
    shuffled = pandas.concat([part for _, part in sorted(frame.groupby("run"), key=lambda own: -own[0])])
    scores = cross_val_score(friction.Model("linear", starts=1), shuffled, groups=shuffled["run"], cv=GroupKFold(RUNS))
    assert len(scores) == RUNS and numpy.isfinite(scores).all()
