"""What the wheel brings besides the module."""

import subprocess
import sys
import sysconfig
from importlib.metadata import distribution, entry_points
from pathlib import Path

import pytest

import thetahat
import thetahat._thetahat


def test_the_module_and_the_distribution_have_one_version() -> None:
    assert thetahat.__version__ == distribution("thetahat").version


def test_the_command_is_the_program_of_that_version() -> None:
    command = Path(sysconfig.get_path("scripts")) / "thetahat"
    words = [str(command), "--version"]
    answer = subprocess.run(words, capture_output=True, check=True, text=True)
    assert answer.stdout == f"thetahat {thetahat.__version__}\n"


def test_the_command_passes_its_exit_code_on() -> None:
    (command,) = entry_points(group="console_scripts", name="thetahat")
    words = [str(Path(sysconfig.get_path("scripts")) / command.name), "fit", "absent.csv", "--no-such-option"]
    assert subprocess.run(words, capture_output=True, check=False).returncode == 2


def test_one_module_serves_every_python_from_the_lowest_on() -> None:
    assert Path(str(thetahat._thetahat.__file__)).name in ("_thetahat.abi3.so", "_thetahat.pyd")
    assert "Tag: cp39-abi3-" in str(distribution("thetahat").read_text("WHEEL"))


def test_dir_shows_what_users_need() -> None:
    shown = dir(thetahat)
    assert shown == sorted([*thetahat.__all__, "dask", "plot", "sklearn"])
    assert [name for name in shown if name.startswith("_")] == ["__version__"]
    assert all(hasattr(thetahat, name) for name in thetahat.__all__)
    with pytest.raises(AttributeError, match="module 'thetahat' has no attribute 'fits_'"):
        getattr(thetahat, "fits_")


def run(program: str) -> None:
    subprocess.run([sys.executable, "-c", program], check=True)


def test_what_needs_other_packages_loads_when_it_is_asked_for() -> None:
    run(
        "import sys, thetahat as th\n"
        "assert not {'matplotlib', 'sklearn', 'dask', 'distributed', 'pandas', 'polars', 'control'} & set(sys.modules)\n"
        "assert th.plot.bode and th.sklearn.ARXRegressor and th.dask.fit_many\n"
        "import thetahat.plot\n"
        "assert thetahat.plot is th.plot is sys.modules['thetahat.plot']\n"
    )


def test_what_is_not_installed_is_absent_and_says_what_to_install() -> None:
    run(
        "import inspect, sys\n"
        "sys.modules['matplotlib'] = None\n"
        "import thetahat as th\n"
        "assert 'plot' not in dict(inspect.getmembers(th)) and not hasattr(th, 'plot')\n"
        "try:\n"
        "    th.plot\n"
        "except AttributeError as error:\n"
        "    assert 'pip install thetahat[plot]' in str(error), error\n"
        "else:\n"
        "    raise AssertionError\n"
    )


def test_types_and_licences_are_inside_and_tests_are_not() -> None:
    files = {file.as_posix() for file in distribution("thetahat").files or []}
    assert {"thetahat/py.typed", "thetahat/_thetahat.pyi"} <= files
    licences = {file.rpartition("/")[2] for file in files if "/licenses/" in file}
    assert licences == {"LICENSE-APACHE", "LICENSE-MIT"}
    assert not [file for file in files if "/tests/" in file or file.endswith((".rs", ".map"))]
