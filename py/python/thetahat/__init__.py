"""System identification: models of dynamic systems from logged data.

>>> import thetahat as th
>>> log = th.dc_motor()
>>> model = th.search(log[:700])
>>> model
Model(ARMAX(2, 2, 1, 1), 1-step fit 98.37 % on rows 1..700)

Logs            `Log`, `read_log`, `read_csv`, `topics` of the log of a flight, `inspect` before a fit.
Fits            `fit` takes the model that the data ask for, `search` chooses among orders, `fit_many` does it with many logs.
  polynomials   `arx`, `armax`, `oe`, `bj`, `general`, `fir`, `iv`, `sriv`, `NormalEquations` part by part.
  time series   `arima` with differences and seasons, `ar`, `arma`.
  others        `ss` state space, `process` and `tf` in continuous time, `narx` nonlinear ARX, `blocks` of systems and curves,
                `grey` and `GreyBox` equations, with `table`, `where` and `delayed`; `templates` of plants that are ready.
Models          `Model` predicts, simulates, forecasts, validates, converts and exports; `Model.from_polynomials`,
                `from_transfer_function`, `from_state_space`, `from_control` and `from_scipy` make it of known numbers.
                `compare` lays several side by side.
Experiments     `design` makes test signals, `spectrum` finds a frequency response, `step_test` what steps show.
Controllers     `tune` for processes; `lqr`, `pole_placement`, `minimum_variance`, run by `closed_loop`;
                `RstController`, `SelfTuner`.
Row by row      `update(y, u)` and `predict(u)`, or `run` for whole arrays:
  models        `Tracker` with channels and documents; `RecursiveArx`, `RecursiveVectorArx`, `RecursiveArmax`,
                `RecursiveOutputError`, `RecursiveNarx`, `RecursiveLeastSquares`, `WindowedLeastSquares`.
  states        `StateFilter` of a model, a `StateModel` or a `GreyBox`; `KalmanFilter`, `ExtendedKalmanFilter`,
                `UnscentedKalmanFilter`, `OutOfSequenceFilter`, `LuenbergerObserver`. `fit_noise` finds Q and R.
                A `ChangeDetector` watches their innovations.
Warnings        `warnings_as` raises, logs or silences them; the logger is ``"thetahat"``.
Modules         `thetahat.plot` draws, `thetahat.sklearn` fits into scikit-learn, `thetahat.dask` fits to data on many machines.

Whatever takes numbers takes arrays of NumPy, lists and tuples, and the series and frames of pandas, Polars and PyArrow; of one
channel also a column. What is None, NaN, NA, null or masked is missing. `help(th.arx)` and its like say more.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from thetahat._thetahat import (
    Alarm,
    ChangeDetector,
    ChangeTrajectory,
    EstimationError,
    ExtendedKalmanFilter,
    FilterTrajectory,
    Forgetting,
    Innovation,
    KalmanFilter,
    LinearObservation,
    LinearTransition,
    LuenbergerObserver,
    NonlinearObservation,
    NonlinearTransition,
    ObserverTrajectory,
    OutOfSequenceFilter,
    RecursiveArmax,
    RecursiveArx,
    RecursiveLeastSquares,
    RecursiveNarx,
    RecursiveOutputError,
    RecursiveTrajectory,
    RecursiveVectorArx,
    RstController,
    SelfTuner,
    SmoothedTrajectory,
    SteadyState,
    UnscentedKalmanFilter,
    WindowedLeastSquares,
    __version__,
)
from thetahat.base.said import EstimationWarning, warnings_as
from thetahat.controllers.control import Control, LoopRun, closed_loop, lqr, minimum_variance, pole_placement
from thetahat.controllers.tune import Tuning, tune
from thetahat.engine import signatures as _signatures
from thetahat.engine.option_types import (
    ArimaOptions,
    BlocksOptions,
    DesignOptions,
    EquationsOptions,
    FitOptions,
    ImpulseResponseOptions,
    NarxOptions,
    ProcessOptions,
    SpectrumOptions,
    StateSpaceOptions,
    ValidationOptions,
)
from thetahat.engine.options import ReadOptions
from thetahat.experiments.design import ExperimentDesign, TestSignal, design
from thetahat.experiments.spectrum import MeasuredResponse, spectrum
from thetahat.experiments.step_test import StepTest, step_test
from thetahat.fits import templates as templates
from thetahat.fits.arima import arima
from thetahat.fits.blocks import blocks
from thetahat.fits.comparison import Comparison, compare
from thetahat.fits.expressions import delayed, table, where
from thetahat.fits.fit import ar, arma, armax, arx, bj, fir, fit, general, oe, search
from thetahat.fits.grey_box import GreyBox, grey
from thetahat.fits.instrumental import iv, sriv
from thetahat.fits.many import Fits, fit_many
from thetahat.fits.narx import narx
from thetahat.fits.normal_equations import NormalEquations
from thetahat.fits.process import process, tf
from thetahat.fits.state_space import ss
from thetahat.logs.inspection import Finding, Inspection, inspect
from thetahat.logs.log import Log
from thetahat.logs.read import dc_motor, read_csv, read_log
from thetahat.logs.topics import Topic, topics
from thetahat.models.model import Model
from thetahat.models.report import Decision
from thetahat.models.responses import Forecast, FrequencyResponse, StateSpace, TransientResponse
from thetahat.models.validation import Validation
from thetahat.online.filter import StateEstimate, StateFilter, StateTrajectory
from thetahat.online.noise import NoiseEstimate, fit_noise
from thetahat.online.state_model import StateModel
from thetahat.online.track import Tracker
from thetahat.online.tracked import Tracked, TrackTrajectory

if TYPE_CHECKING:
    from thetahat import dask as dask, plot as plot, sklearn as sklearn

__all__ = [
    "Alarm",
    "ArimaOptions",
    "BlocksOptions",
    "ChangeDetector",
    "ChangeTrajectory",
    "Comparison",
    "Control",
    "Decision",
    "DesignOptions",
    "EquationsOptions",
    "EstimationError",
    "EstimationWarning",
    "ExperimentDesign",
    "ExtendedKalmanFilter",
    "FilterTrajectory",
    "Finding",
    "FitOptions",
    "Fits",
    "Forecast",
    "Forgetting",
    "FrequencyResponse",
    "GreyBox",
    "ImpulseResponseOptions",
    "Innovation",
    "Inspection",
    "KalmanFilter",
    "LinearObservation",
    "LinearTransition",
    "Log",
    "LoopRun",
    "LuenbergerObserver",
    "MeasuredResponse",
    "Model",
    "NarxOptions",
    "NoiseEstimate",
    "NonlinearObservation",
    "NonlinearTransition",
    "NormalEquations",
    "ObserverTrajectory",
    "OutOfSequenceFilter",
    "ProcessOptions",
    "ReadOptions",
    "RecursiveArmax",
    "RecursiveArx",
    "RecursiveLeastSquares",
    "RecursiveNarx",
    "RecursiveOutputError",
    "RecursiveTrajectory",
    "RecursiveVectorArx",
    "RstController",
    "SelfTuner",
    "SmoothedTrajectory",
    "SpectrumOptions",
    "StateEstimate",
    "StateFilter",
    "StateModel",
    "StateSpace",
    "StateSpaceOptions",
    "StateTrajectory",
    "SteadyState",
    "StepTest",
    "TestSignal",
    "Topic",
    "TrackTrajectory",
    "Tracked",
    "Tracker",
    "TransientResponse",
    "Tuning",
    "UnscentedKalmanFilter",
    "Validation",
    "ValidationOptions",
    "WindowedLeastSquares",
    "__version__",
    "ar",
    "arima",
    "arma",
    "armax",
    "arx",
    "bj",
    "blocks",
    "closed_loop",
    "compare",
    "dc_motor",
    "delayed",
    "design",
    "fir",
    "fit",
    "fit_many",
    "fit_noise",
    "general",
    "grey",
    "inspect",
    "iv",
    "lqr",
    "minimum_variance",
    "narx",
    "oe",
    "pole_placement",
    "process",
    "read_csv",
    "read_log",
    "search",
    "spectrum",
    "sriv",
    "ss",
    "step_test",
    "table",
    "templates",
    "templates",
    "tf",
    "topics",
    "tune",
    "warnings_as",
    "where",
]

_signatures.spell_out(globals()[name] for name in __all__)

_LATER = ("dask", "plot", "sklearn")
"""Modules that load when they are first asked for: each needs a package that not everybody has."""

if not TYPE_CHECKING:

    def __getattr__(name):
        if name not in _LATER:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        try:
            return import_module(f"thetahat.{name}")
        except ImportError as error:
            # Who asks what a module has, as `help` does, passes over what is not there.
            raise AttributeError(str(error)) from error


def __dir__() -> list[str]:
    return sorted([*__all__, *_LATER])
