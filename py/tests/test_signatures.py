"""What editors and notebooks are told: types, names, pages of help."""

from __future__ import annotations

import inspect
import subprocess
import sys
import typing
from pathlib import Path

import pytest

import thetahat as th


def test_aliases_of_types_are_spelled_out() -> None:
    shown = str(inspect.signature(th.arx))
    assert "na: Union[int, range]" in shown or "na: int | range" in shown
    for function in (th.arx, th.fit, th.Log, th.Tracker, th.StateFilter, th.read_csv, th.Model.predict, th.Log.resample):
        text = str(inspect.signature(function))
        for alias in ("Order'", "Orders'", "Rows'", "Duration'", "Resample'", "Band'", "Policy'", "Initial'"):
            assert alias not in text, (function, alias)
    assert typing.get_type_hints(th.arx)["initial"] == typing.Optional[typing.Literal["auto", "drop", "zero", "estimate"]]


def test_compiled_classes_have_signatures_with_types() -> None:
    arx = inspect.signature(th.RecursiveArx).parameters
    assert arx["nb"].annotation == "int | Sequence[int]"
    assert arx["start"].annotation == "Literal['standard', 'exact', 'mixed']"
    assert arx["huber"].default == float("inf")
    for name in ("KalmanFilter", "ExtendedKalmanFilter", "RecursiveLeastSquares", "ChangeDetector", "LinearTransition", "RstController"):
        compiled = getattr(th, name)
        for parameter in inspect.signature(compiled).parameters.values():
            assert parameter.annotation is not parameter.empty, (name, parameter)
    # What nobody makes has no constructor, as before.
    with pytest.raises(ValueError, match="no signature found"):
        inspect.signature(th.Alarm)


def test_names_are_found_and_modules_load_when_they_are_asked_for() -> None:
    code = "import sys, thetahat as th; assert 'thetahat.plot' not in sys.modules; th.plot.log; th.sklearn; print(*dir(th))"
    names = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert {"plot", "sklearn", "dask", "Log", "arx"} <= set(names)
    assert [name for name in names if name.startswith("_") and name != "__version__"] == []


def test_the_page_of_the_module_names_everything_that_is_for_users() -> None:
    page = th.__doc__ or ""
    assert len(page.splitlines()) < 45
    assert max(map(len, page.splitlines())) <= 130
    results = "Forecast Trajectory Options Alarm Innovation Forgetting Response Inspection Finding Decision Estimate Tracked Topic Log".split()
    for name in th.__all__:
        made = name[0].isupper() and any(part in name for part in [*results, "Comparison", "Validation", "Fits", "Control", "LoopRun"])
        other = name in ("EstimationError", "EstimationWarning", "StepTest", "TestSignal", "Tuning", "SteadyState", "ExperimentDesign", "StateSpace")
        model = name.endswith(("Transition", "Observation")) or name in ("__version__", "dc_motor", "NormalEquations")
        assert made or other or model or f"`{name}`" in page, name


def test_a_script_of_a_user_passes_a_strict_type_checker(tmp_path: Path) -> None:
    """A misspelt word of an option is an error there."""
    script = tmp_path / "user.py"
    script.write_text("import thetahat as th\n\nth.arx(th.dc_motor(), 2, 2).predict(th.dc_motor(), initial='zeroo')\nth.narx(th.dc_motor(), 'polly')\n")
    checked = subprocess.run([sys.executable, "-m", "mypy", "--strict", str(script)], capture_output=True, text=True, cwd=tmp_path, check=False)
    assert checked.stdout.count(": error: Argument") == 2, checked.stdout
