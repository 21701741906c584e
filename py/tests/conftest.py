"""What the tests share."""

from __future__ import annotations

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
    """Where a public log is: among those that come with the tests, or beside the repository."""
    root = Path(__file__).parents[2]
    for folder in (root / "tests" / "data" / "public", root.parent / "shared" / "data"):
        if (folder / name).exists():
            return folder / name
    pytest.skip(f"{name} is not in ../shared/data")
