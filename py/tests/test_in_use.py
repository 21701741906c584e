"""An object that another call uses says so, in the words of its users."""

from __future__ import annotations

import copy
import threading
from collections.abc import Callable

import numpy as np
import pytest

import thetahat as th

BOTH = "^this {} is in use: a call of another thread, .* has not returned; wait for it, or .* copy.copy"


def held(filter: th.ExtendedKalmanFilter, inside: Callable[[], None]) -> None:
    """A step of the filter, in the middle of which `inside` is called."""

    def function(state: np.ndarray, _: np.ndarray) -> np.ndarray:
        inside()
        return state

    filter.predict(th.NonlinearTransition(function, [[1.0]], lambda state, _: [[1.0]]))


def test_another_thread() -> None:
    filter = th.ExtendedKalmanFilter([0.5], [[1.0]])
    begun, done = threading.Event(), threading.Event()

    def inside() -> None:
        begun.set()
        done.wait(60)

    thread = threading.Thread(target=held, args=(filter, inside))
    thread.start()
    try:
        assert begun.wait(60)
        with pytest.raises(RuntimeError, match=BOTH.format("ExtendedKalmanFilter")):
            filter.state  # noqa: B018
        with pytest.raises(RuntimeError, match=BOTH.format("ExtendedKalmanFilter")):
            held(filter, lambda: None)
        with pytest.raises(RuntimeError, match=BOTH.format("ExtendedKalmanFilter")):
            repr(filter)
    finally:
        done.set()
        thread.join()
    assert filter.state.shape == (1,)
    assert copy.copy(filter).state == filter.state


def test_a_function_that_calls_back() -> None:
    filter = th.ExtendedKalmanFilter([0.5], [[1.0]])
    with pytest.raises(RuntimeError, match=BOTH.format("ExtendedKalmanFilter")):
        held(filter, lambda: filter.predict(th.LinearTransition([[1.0]], [[1.0]])))
    assert filter.state == 0.5


def test_methods_that_several_classes_have() -> None:
    model = th.RecursiveArx(1, 1)
    noise = np.random.default_rng(0).normal(size=2_000_000)
    thread = threading.Thread(target=lambda: model.run(noise, u=noise))
    thread.start()
    said = set()
    while thread.is_alive():
        for ask in (lambda: model.update(1.0, u=1.0), lambda: model.parameters, lambda: model.a):
            try:
                ask()
            except RuntimeError as error:
                said.add(str(error).split(":")[0])
    thread.join()
    assert said == {"this RecursiveArx is in use"}


def test_an_object_of_another_class_is_a_type_error() -> None:
    with pytest.raises(TypeError):
        th.KalmanFilter.predict(th.RecursiveArx(1, 1), th.LinearTransition([[1.0]], [[1.0]]))  # type: ignore[call-overload]
