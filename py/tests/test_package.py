"""What the wheel brings besides the module."""

import subprocess
import sysconfig
from importlib.metadata import distribution, entry_points
from pathlib import Path

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


def test_types_and_licences_are_inside_and_tests_are_not() -> None:
    files = {file.as_posix() for file in distribution("thetahat").files or []}
    assert {"thetahat/py.typed", "thetahat/_thetahat.pyi"} <= files
    licences = {file.rpartition("/")[2] for file in files if "/licenses/" in file}
    assert licences == {"LICENSE-APACHE", "LICENSE-MIT"}
    assert not [file for file in files if "/tests/" in file or file.endswith((".rs", ".map"))]
