"""Other forms of a fitted model: state space, fewer states, another time, source code, and what other packages take."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from thetahat import _thetahat
from thetahat.base import said as _said
from thetahat.base.said import EstimationWarning
from thetahat.engine import files as _files, options as _options
from thetahat.logs.log import handle
from thetahat.models import convert as _convert
from thetahat.models.report import ReportedModel
from thetahat.models.responses import StateSpace

if TYPE_CHECKING:
    from typing_extensions import Self

Array = npt.NDArray[np.float64]


class ConvertibleModel(ReportedModel):
    """What a fitted model can be made into; `thetahat.Model` adds what can be computed with it."""

    @classmethod
    def _of(cls, model: _thetahat.Model) -> Self:
        made = object.__new__(cls)
        made._model = model
        return made

    def to_state_space(self) -> StateSpace:
        """The innovations form, x(t+1) = F x(t) + G u(t) + K e(t), y(t) = H x(t) + D u(t) + e(t), in deviations.

        Examples
        --------
        >>> import thetahat as th
        >>> th.arx(th.dc_motor(), na=2, nb=2).to_state_space().F.shape
        (2, 2)
        """
        sampled = self._model if self.kind != "process" else self._model.converted(repr(self.sample_time), None)
        matrices = sampled.state_space()
        return StateSpace(*matrices, self.noise_covariance, self.sample_time, self.inputs, self.outputs)

    def hankel_singular_values(self) -> Array:
        """How much of its inputs each state of the innovations form passes on to the outputs, falling; infinite where a pole does not decay.

        Of models in state space and of polynomials, inputs and noise counted together.
        """
        return np.array(self._model.hankel_singular_values())

    def reduced(self, order: int) -> Self:
        """The model with so many states, by balanced truncation: its frequency response is off by no more than twice the sum of the
        `hankel_singular_values` that are left out.

        Parameters
        ----------
        order : int
            How many states to keep.

        Returns
        -------
        Model
            In state space; it has no figures of a fit of its own, so validate it.

        Raises
        ------
        ValueError
            If the model has no such form, or not so many states, or poles that are always kept are more.

        References
        ----------
        Moore, IEEE Transactions on Automatic Control 26, 1981. Enns, 23rd Conference on Decision and Control, 1984.

        Examples
        --------
        >>> import thetahat as th
        >>> model = th.arx(th.dc_motor(), na=4, nb=4)
        >>> model.reduced(2).name
        'state space of order 2'
        """
        return self._of(self._model.reduced(_options.count("order", order)))

    def converted(self, to: float | str, hold: Literal["zoh", "foh", "tustin"] | None = None) -> Self:
        """The model in continuous time, or at another sample time.

        Of polynomials, in state space and of processes; the result is in state space. A model in continuous time goes with a log of any sample
        time.

        Parameters
        ----------
        to : float, timedelta or "continuous"
            A sample time in seconds, or the word.
        hold : {"zoh", "foh", "tustin"}, optional
            What inputs do between samples: they keep their values, follow straight lines, or the bilinear transformation. That of a model in
            continuous time, else ``"zoh"``.

        Returns
        -------
        Model
            Its `kind` is ``"state-space"`` or ``"continuous-state-space"``. It has no figures of a fit of its own, so validate it.

        Raises
        ------
        ValueError
            If the model is not linear, or one of its poles has no counterpart: it is named.

        References
        ----------
        Franklin, Powell and Workman, Digital Control of Dynamic Systems, 3rd ed. 1998, sections 4.3 and 6.3.

        Examples
        --------
        >>> import thetahat as th
        >>> model = th.ss(th.dc_motor(), 2)
        >>> continuous = model.converted("continuous")
        >>> continuous.name
        'continuous state space of order 2'
        >>> continuous.converted(0.05).sample_time
        0.05
        """
        word = to if isinstance(to, str) else repr(_options.seconds("to", to))
        return self._of(self._model.converted(word, None if hold is None else _options.text("hold", hold)))

    def export(
        self,
        to: Literal["c", "rust"],
        what: Literal["predictor", "simulator", "observer", "recursive", "controller"],
        log: Any = None,
        *,
        precision: Literal["f32", "f64"] = "f32",
        name: str | None = None,
        folder: str | os.PathLike[str] | None = None,
    ) -> dict[str, str]:
        """Source code for firmware, in C99 or Rust: without a heap, and with every number in it.

        Signals go in and come out in the units of their channels, as offsets and scales are in the files. It starts at rest at the offsets.

        Parameters
        ----------
        to : {"c", "rust"}
            The language.
        what : {"predictor", "simulator", "observer", "recursive", "controller"}
            What to make of the model.
        log : Log, optional
            Rows for a test vector: beside the source stand a CSV of inputs, outputs and expected results, and a program that steps along it.
        precision : {"f32", "f64"}
            That of all numbers. In double precision the results are the library's to the bit.
        name : str, optional
            What files, types and functions are called, ``"model_"`` and `what` unless said otherwise.
        folder : path, optional
            Where to write the files, beside returning them.

        Returns
        -------
        dict of str to str
            What each file holds, by its name.

        Raises
        ------
        ValueError
            If the model cannot be exported as such: the message says what it can be.

        Warns
        -----
        EstimationWarning
            If single precision is not enough along the rows of the log.

        Examples
        --------
        >>> import thetahat as th
        >>> files = th.arx(th.dc_motor(), na=2, nb=2, nk=3).export("c", "predictor", name="motor")
        >>> list(files)
        ['motor.h', 'motor.c']
        """
        words = [_options.text("to", to), _options.text("what", what), _options.text("precision", precision)]
        words.append(f"model_{what}" if name is None else _options.text("name", name))
        files, found = self._model.exported(words, None if log is None else handle("log", log))
        for warning in found:
            _said.warn(warning, EstimationWarning)
        if folder is not None:
            place = _files.name(folder)
            os.makedirs(place, exist_ok=True)
            for file, text in files:
                _thetahat.write(os.path.join(place, file), text)
        return dict(files)

    def to_scipy(self, *, pade: int | None = None) -> Any:
        """The plant as a system of SciPy, in deviations from the offsets.

        Parameters
        ----------
        pade : int, optional
            The order of Padé's approximation of dead times in continuous time, which SciPy's systems cannot have.

        Returns
        -------
        scipy.signal.dlti or scipy.signal.lti
            Of polynomials with one input the transfer function B/(A F), else a state space; in continuous time an ``lti``.

        Raises
        ------
        ValueError
            For a dead time without ``pade``, and a model that is not linear.
        """
        if self.kind == "polynomial" and len(self.inputs) == 1:
            return _convert.to_scipy(self.b, self._denominators(), self.sample_time)
        return _convert.state_space_to_scipy(*self._plant(pade))

    def to_control(self, *, pade: int | None = None) -> Any:
        """The plant for python-control, in deviations from the offsets, with inputs and outputs by name.

        Parameters
        ----------
        pade : int, optional
            The order of Padé's approximation of dead times in continuous time, which python-control does not have.

        Returns
        -------
        control.TransferFunction or control.StateSpace
            Of polynomials with one input the transfer function B/(A F), else a state space, which needs no Slycot; in continuous time with
            ``dt`` 0.

        Raises
        ------
        ValueError
            For a dead time without ``pade``, and a model that is not linear.

        Examples
        --------
        >>> import thetahat as th
        >>> model = th.Model.from_transfer_function([3], [10, 1], delay=2)
        >>> system = model.to_control(pade=3)
        >>> system.nstates, round(float(system.dcgain()), 6)
        (4, 3.0)
        """
        if self.kind == "polynomial" and len(self.inputs) == 1:
            return _convert.to_control(self.b, self._denominators(), self.sample_time, self.inputs, self.output)
        return _convert.state_space_to_control(*self._plant(pade), self.inputs, self.outputs)

    def _plant(self, pade: int | None) -> tuple[Array, Array, Array, Array, float | None]:
        """The matrices from the inputs to the outputs, and the sample time; none in continuous time."""
        if self.kind in ("continuous-state-space", "process"):
            return (*self._continuous_matrices(pade), None)
        found = self.to_state_space()
        return found.F, found.G, found.H, found.D, self.sample_time

    def _continuous_matrices(self, pade: int | None) -> tuple[Array, Array, Array, Array]:
        matrices, delays = self._matrices_in_seconds(), self._in_states["delays"]
        if not any(delays):
            return matrices
        if pade is None:
            raise ValueError(
                "the model has a dead time, which matrices in continuous time cannot have: pade=3 approximates it, converted(seconds) samples it"
            )
        return _convert.with_pade(matrices, delays, _options.count("pade", pade, 20))

    def _matrices_in_seconds(self) -> tuple[Array, Array, Array, Array]:
        """A, B, C and D in continuous time, without dead times."""
        own = self._in_states
        order, inputs, outputs = len(own["a"]), len(self.inputs), len(self.outputs)
        shapes = {"a": (order, order), "b": (order, inputs), "c": (outputs, order), "d": (outputs, inputs)}
        a, b, c, d = (np.reshape(np.array(own[name], dtype=np.float64), shape) for name, shape in shapes.items())
        return a, b, c, d

    def _denominators(self) -> list[Array]:
        return [np.convolve(self.a, f) for f in self.f]
