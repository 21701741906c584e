"""Controllers: those of the core, and what Python adds to them."""

from __future__ import annotations

import copy
import math
import pickle
from typing import Any

import numpy as np
import pytest

import thetahat as th

E = math.exp(-0.5)
A = [1.0, -1.0 - E, E]
B = [0.0, 0.5 - 1.0 + E, 1.0 - E - 0.5 * E]
DECAY, TURN = 0.35, 0.5 * math.sqrt(1.0 - 0.49)
RESPONSE = [1.0, -2.0 * math.exp(-DECAY) * math.cos(TURN), math.exp(-2.0 * DECAY)]


def test_the_motor_has_the_published_controllers() -> None:
    """Åström and Wittenmark, Adaptive Control, 2nd ed., examples 3.1 and 3.2."""
    cancelled = th.RstController.pole_placement(A, B, RESPONSE, cancel_zeros=True)
    np.testing.assert_allclose(cancelled.r[:2], [1.0, 0.846742], atol=1e-6)
    np.testing.assert_allclose(cancelled.s[:2], [2.685158, -1.032054], atol=1e-6)
    np.testing.assert_allclose(cancelled.t[0], 1.653104, atol=1e-6)
    kept = th.RstController.pole_placement(A, B, RESPONSE)
    np.testing.assert_allclose(kept.r[:2], [1.0, 0.111105], atol=1e-6)
    np.testing.assert_allclose(kept.s[:2], [1.642216, -0.747070], atol=1e-6)
    np.testing.assert_allclose(kept.t[0], 0.895146, atol=1e-6)
    assert kept.limits == (None, None)
    # A R + B S = A_m.
    closed = np.convolve(A, kept.r)[:4] + np.convolve(B, kept.s)[:4]
    np.testing.assert_allclose(closed, [*RESPONSE, 0.0], atol=1e-12)


def run(controller: th.RstController, rows: int, load: float = 0.0) -> tuple[Any, Any]:
    y, u = np.zeros(rows), np.zeros(rows)
    for k in range(2, rows):
        y[k] = -A[1] * y[k - 1] - A[2] * y[k - 2] + B[1] * (u[k - 1] + load) + B[2] * (u[k - 2] + load)
        u[k] = controller.control(1.0, y[k])
    return y, u


def test_a_load_is_forgotten_and_limits_hold() -> None:
    controller = th.RstController.pole_placement(A, B, RESPONSE, [1.0, -0.5], integrator=True, limits=(-0.4, 0.4))
    y, u = run(controller, 300, load=0.1)
    assert np.abs(u).max() == 0.4 and abs(y[-1] - 1.0) < 1e-9 and y.max() < 1.3
    sensitivity, complementary = controller.peaks(A, B)
    assert 1.0 < sensitivity < 3.0 and 1.0 < complementary < 3.0
    for other in (pickle.loads(pickle.dumps(controller)), copy.deepcopy(controller)):
        assert repr(other) == repr(controller) and other.limits == (-0.4, 0.4)
        assert other.control(1.0, 0.7) == copy.copy(controller).control(1.0, 0.7)


def test_it_takes_over_without_a_bump_and_holds_what_is_missing() -> None:
    controller = th.RstController.pole_placement(A, B, RESPONSE, [1.0, -0.5], integrator=True)
    controller.start(0.3, 2.0, 2.0)
    assert abs(controller.control(2.0, 2.0) - 0.3) < 1e-12
    moved = controller.control(2.0, 1.9)
    assert controller.control(2.0, math.nan) == moved
    controller.applied(0.0)
    assert controller.control(2.0, 1.9) < moved
    # A controller of its own: proportional and integral.
    own = th.RstController([1.0, -1.0], [2.2, -2.0], 2.2, [1.0, -2.0 / 2.2], limits=(0.0, None))
    assert own.control(1.0, 0.0) == 2.2 and own.limits == (0.0, None)


def test_what_cannot_be_placed_is_refused() -> None:
    placed = th.RstController.pole_placement
    with pytest.raises(ValueError, match="without a factor in common with a"):
        placed(np.convolve([1, -0.6], [1, -0.9]), np.convolve([0, 1], [1, -0.6]), [1, -0.5])
    for a, b, response in (
        (A, [1.0, 0.5, 0.2], RESPONSE),
        (A, [0.0, 0.0, 0.0], RESPONSE),
        ([0.5, 0.1, 0.1], B, RESPONSE),
        (A, [0.0, math.nan, 1.0], RESPONSE),
        ([], B, RESPONSE),
        (A, B, [1.0, 0.1, 0.1, 0.1, 0.1]),
        (A, B, []),
    ):
        with pytest.raises(ValueError):
            placed(a, b, response)
    with pytest.raises(ValueError, match="unit circle"):
        placed(A, [0.0, 1.0, 1.5], RESPONSE, cancel_zeros=True)
    with pytest.raises(ValueError, match="limits"):
        placed(A, B, RESPONSE, limits=(1.0, -1.0))
    with pytest.raises(ValueError, match="r: expected a polynomial that begins with 1"):
        th.RstController([2.0], [1.0], 1.0)
    with pytest.raises(ValueError, match="finite"):
        placed(A, B, RESPONSE).start(math.inf, 0.0, 0.0)
