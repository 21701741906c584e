"""What the process goes through: forks, signals, its end, its file descriptors, its garbage."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import textwrap
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thetahat as th

PATIENCE = 120
"""Seconds after which something hangs, on whatever machine."""


def python(code: str) -> subprocess.CompletedProcess[str]:
    """Runs a program in an interpreter of its own, in which Ctrl-C does what it does at a terminal."""
    # The tests may run in the background of a script, where it is ignored.
    listening = "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
    words = [sys.executable, "-c", listening + textwrap.dedent(code)]
    return subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE, check=False)


EVERYTHING = """
    import os, tempfile
    import numpy as np
    import thetahat as th

    folder = tempfile.mkdtemp()
    path = os.path.join(folder, "log.csv")
    random = np.random.default_rng(1)
    y, u = random.standard_normal((2, 3000))
    np.savetxt(path, np.column_stack([y, u]), delimiter=",", header="y,u", comments="")

    def everything():
        log = th.Log(y, u)
        part = log[:2000]
        model = th.search(part)
        th.oe(part, nb=2, nf=2, starts=3)
        model.validate(log).summary()
        th.compare([model, th.arx(part, na=2, nb=2)], log)
        th.inspect(log)
        th.inspect(path)
        th.read_csv(path)
        model.predict(log)
        model.simulate(u)
        model.forecast(log, 3, u[:3])
        model.frequency_response()
        model.step_response()
        th.arx(part, na=2, nb=2, norm=1)
        th.arx(part, na=1, nb=1, noise_bound=20.0)
        model.write_html(os.path.join(folder, "page.html"), log)
        th.Model.from_json(model.to_json()).to_state_space()
        th.RecursiveArx(na=1, nb=1)
        th.KalmanFilter([0.0], [[1.0]]).run(
            th.LinearTransition([[1.0]], [[1.0]]), th.LinearObservation([[1.0]], [[1.0]]), y
        )
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_whatever_the_parent_did_a_forked_child_does_too() -> None:
    done = python(
        EVERYTHING
        + """
    everything()
    child = os.fork()
    if child == 0:
        everything()
        os._exit(7)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
    """
    )
    assert done.stdout == "7\n", done.stderr


INTERRUPTED = """
    import signal
    import numpy as np
    import thetahat as th

    {before}
    def interrupted(*_):
        raise KeyboardInterrupt

    signal.signal(signal.SIGALRM, interrupted)
    signal.setitimer(signal.ITIMER_REAL, 0.3)
    returned = []
    try:
        # No line of Python is between its return and the list, in which the handler could be called.
        list(map(returned.append, map({function}, *([argument] for argument in ({arguments})))))
    except KeyboardInterrupt:
        print("interrupted", len(returned))
"""

LINEAR = (
    "model = th.LinearTransition(np.eye(100), np.eye(100)), th.LinearObservation(np.zeros((1, 100)), [[1.0]]);"
    "kf = th.KalmanFilter(np.zeros(100), np.eye(100));"
    "observer = th.LuenbergerObserver(np.zeros(100), np.zeros((100, 1)))"
)


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="this system has no timers")
@pytest.mark.parametrize(
    ("before", "function", "arguments"),
    [
        ("rls, phi = th.RecursiveLeastSquares(300, 1.0), np.ones((50000, 300))", "rls.run", "phi, np.ones(50000)"),
        (LINEAR, "kf.run", "*model, np.ones(20000)"),
        (LINEAR, "observer.run", "*model, np.ones(1_000_000)"),
        (LINEAR, "kf.smooth", "*model, np.ones(20000)"),
        (LINEAR, "kf.steady_state", "*model, 10_000_000"),
        (
            "model = th.arx(th.Log(*np.random.default_rng(1).standard_normal((2, 4000))), na=100, nb=200)",
            "model._model.step_response",
            "0, 1_000_000",
        ),
        (
            "log = th.Log(*np.random.default_rng(1).standard_normal((2, 2_000_000)))",
            "th._thetahat.inspect",
            "log._log,",
        ),
        (
            "tracker = th.Tracker(100, 0, forgetting=None)",
            "tracker.run",
            "np.random.default_rng(1).standard_normal(200_000),",
        ),
        (
            "one = np.eye(60); filter = th.StateFilter(th.StateModel(one, one[:1], one, [[1.0]], one, sample_time=1))",
            "filter.run",
            "np.ones(100_000),",
        ),
    ],
    ids=[
        "RecursiveLeastSquares",
        "KalmanFilter",
        "observer",
        "smooth",
        "steady_state",
        "step_response",
        "inspect",
        "Tracker",
        "StateFilter",
    ],
)
def test_ctrl_c_ends_what_takes_long(before: str, function: str, arguments: str) -> None:
    done = python(INTERRUPTED.format(before=before, function=function, arguments=arguments))
    assert done.stdout == "interrupted 0\n", done.stderr


@pytest.mark.skipif(not hasattr(os, "kill"), reason="this system has no signals")
def test_ctrl_c_ends_many_fits_without_waiting_for_any() -> None:
    code = """
        import os, signal, threading
        import numpy as np
        import thetahat as th

        random = np.random.default_rng(0)
        u = random.standard_normal(60_000)
        y = np.cumsum(random.standard_normal(len(u))) * 0.01 + np.convolve(u, np.exp(-np.arange(50) / 9))[: len(u)]
        logs = {str(place): th.Log(y, u) for place in range(8)}
        begun, ended = threading.Event(), []

        def long(log):
            begun.set()
            found = th.search(log)
            ended.append(found)
            return found

        def press():
            begun.wait()
            os.kill(os.getpid(), signal.SIGINT)

        threading.Thread(target=press).start()
        try:
            th.fit_many(logs, long)
        except KeyboardInterrupt:
            print("interrupted", len(ended))
        # What comes next is not ended.
        print(th.fit_many(logs, th.arx, na=1, nb=1))
        """
    done = python(code)
    assert done.stdout == "interrupted 0\nFits(8 logs, 8 of them without a failure)\n", done.stderr


def test_parts_of_numpy_are_there_before_threads_are() -> None:
    # NumPy loads some at their first use: of several threads that meet there, one may recurse without end.
    code = """
        import sys
        import thetahat as th
        log = th.Log([1.0, 3.0, 2.0, 4.0, 1.0], [0.0, 1.0, 0.0, 1.0, 0.0])
        loaded = set(sys.modules)
        th.arx(log, 1, 1)
        th.ExtendedKalmanFilter([0.0], [[1.0]])
        print(sorted(name for name in set(sys.modules) - loaded if name.startswith("numpy")))
        """
    assert python(code).stdout == "[]\n"


def test_a_daemon_thread_in_a_function_of_a_model_ends_with_the_interpreter() -> None:
    code = """
        import threading
        import numpy as np
        import thetahat as th

        begun = threading.Event()

        def f(x, u):
            begun.set()
            # A list is converted by Python code.
            return [sum(x[0] for _ in range(50)) / 50]

        def forever():
            moved = th.NonlinearTransition(f, [[1.0]])
            seen = th.NonlinearObservation(f, [[1.0]])
            while True:
                th.ExtendedKalmanFilter([0.0], [[1.0]]).run(moved, seen, np.ones(1000))

        for _ in range(4):
            threading.Thread(target=forever, daemon=True).start()
        begun.wait()
        """
    # The interpreter ends at any point of the loop.
    for _ in range(5):
        done = python(code)
        assert (done.returncode, done.stderr) == (0, "")


def test_a_daemon_thread_in_a_search_ends_with_the_interpreter() -> None:
    done = python("""
        import threading
        import thetahat as th

        begun = threading.Event()

        def forever():
            while True:
                begun.set()
                th.search(th.dc_motor())

        threading.Thread(target=forever, daemon=True).start()
        begun.wait()
        """)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("kind", [th.NonlinearTransition, th.NonlinearObservation])
@pytest.mark.parametrize("argument", ["function", "noise", "jacobian"])
def test_a_plant_that_holds_a_model_of_its_own_methods_is_collected(kind: Any, argument: str) -> None:
    class Plant:
        def __init__(self) -> None:
            functions: dict[str, Any] = {"function": abs, "noise": [[1.0]]}
            self.model = kind(**{**functions, argument: self.step})

        def step(self, x: Any, u: Any) -> Any:
            return x

    plant = weakref.ref(Plant())
    gc.collect()
    assert plant() is None


@pytest.mark.parametrize("path", [0, 1, True, np.int64(1), None, 1.5])
def test_a_file_descriptor_is_no_path(path: Any, tmp_path: Path) -> None:
    model = th.arx(th.dc_motor(), na=2, nb=2)
    for call in (th.Model.read, th.read_csv, th.inspect, model.write, model.write_html):
        with pytest.raises(TypeError, match="path: expected a str or a path, found"):
            call(path)
    os.fstat(1)
