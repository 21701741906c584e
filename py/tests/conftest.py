"""What the tests share."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import pytest

import thetahat as th

matplotlib.use("Agg")


@pytest.fixture
def motor() -> th.Log:
    """The log that comes with the package."""
    return th.dc_motor()


@pytest.fixture
def shared() -> Path:
    """The public logs beside the repository, where they are."""
    folder = Path(__file__).parents[3] / "shared"
    if not (folder / "data").is_dir():
        pytest.skip("../shared/data is not here")
    return folder
