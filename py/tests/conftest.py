"""What the tests share."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import matplotlib
import pytest

import thetahat as th

matplotlib.use("Agg")

# A script has its jobs in the background ignore SIGINT, and what is ignored stays so in all that they start.
for number in (signal.SIGINT, signal.SIGTERM):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)


@pytest.fixture
def motor() -> th.Log:
    """The log that comes with the package."""
    return th.dc_motor()


def public_log(name: str) -> Path:
    """Where a public log is: among those that come with the tests, or in the folder that THETAHAT_LOGS names."""
    folders = [Path(__file__).parents[2] / "tests" / "data" / "public"]
    if more := os.environ.get("THETAHAT_LOGS"):
        folders.append(Path(more))
    for folder in folders:
        if (folder / name).exists():
            return folder / name
    pytest.skip(f"{name} is in no folder of logs: THETAHAT_LOGS names one")
