"""Types of the values of options."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from typing import Literal, Optional, Union

import numpy as np
from numpy.typing import NDArray

Order = Union[int, range]
"""An order, or the orders among which to choose: ``range(1, 9)`` is 1 to 8."""

Orders = Union[Order, Sequence[Order]]
"""An order for all inputs, or one for each."""

Rows = Union[str, slice, range, Sequence[Union[str, slice, range]]]
"""Rows of a log: a slice or a range as Python counts them, or ``"1..500"``, which counts from 1 and holds both ends."""

Bound = Union[float, tuple[Optional[float], Optional[float]]]
"""A value, or the lower and the upper end of a range, either of which may be None."""

Duration = Union[float, datetime.timedelta, np.timedelta64, str]
"""Seconds, a timedelta of Python, NumPy or pandas, or a text such as ``"10 ms"``, in ns, us, ms, s, min, h or d."""

Initial = Literal["auto", "drop", "zero", "estimate"]
"""What a response begins with: measured samples, zeros, or an estimate."""

Resample = Union[tuple[Duration, str], tuple[Duration, str, str]]
"""The time between the new rows, "linear", "hold" or "auto", and "unfiltered" where no filter is wanted."""

Band = Union[tuple[Optional[float], Optional[float]], str]
"""The lower and the upper end in Hz, either of which may be None; or a text such as "0.1..5"."""

Frequencies = Union[tuple[float, float], Sequence[float], NDArray[np.float64]]
"""A band in radians per second as a tuple of its ends, or a list of frequencies."""
