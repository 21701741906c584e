"""The options of what takes many, written from their tables: ``cargo run -p thetahat --example python_options``."""

from collections.abc import Mapping, Sequence
from typing import Literal, Optional, TypedDict, Union

from thetahat.engine.values import Band, Bound, Duration, Frequencies, Rows


class FitOptions(TypedDict, total=False):
    """What every fit of a model of polynomials can be told, beside the orders.

    Attributes
    ----------
    estimate
        Rows to estimate on, 1-based and inclusive, counted through all logs [default: all]
    validate
        Rows to validate on
    detrend
        What to subtract from each channel before the fit: none, mean, linear, or start:K (the mean of the
        first K rows); ``constant`` and ``trend`` estimate the remaining level and slope of the output
        [default: mean]
    offset
        Set a channel's offset by hand
    prefilter
        Fit in a band of frequencies in Hz, either end of which may be left out: inputs and output go through
        the same Butterworth filter; the model and its figures are those of the unfiltered signals
    likelihood
        The likelihood to maximise, conditional on the first samples or that of all samples (exact), which
        continues through missing outputs (models without D and F); ``"conditional"``: Given the samples that
        the first error needs: least squared prediction errors; ``"exact"``: Of all measured outputs, by the
        Kalman filter (ar, arma, arx, armax) [default: conditional]
    initial
        The initial condition of each segment; ``"auto"``: drop without F; with F estimate if there are rows
        before, or if it is worth its parameters, else zero; ``"drop"``: Measured samples before; without
        them, samples without a full regressor are left out (models without F); ``"zero"``: Zeros;
        ``"estimate"``: Measured samples before, and initial conditions estimated with the parameters (models
        with F, processes, or ``likelihood`` exact with inputs) [default: auto]
    focus
        What the model is for: prediction (errors one step ahead), simulation (free runs, driven by the
        inputs alone), or a number of steps ahead. auto: prediction; without orders simulation if a model for
        it has a clearly better free run on held-out rows; for networks and rbf-free simulation where there
        are inputs [default: auto]
    constant
        Estimate the level of the output with the parameters, in addition to the mean that is subtracted: for
        step tests and other logs whose mean is not the operating point of the plant. Of arima, which
        subtracts no mean: auto is yes without differences, and no with them; ``"auto"``: If it lowers MDL,
        unless the output's offset is given (``detrend`` none, ``offset``); ``"yes"``: Always; ``"no"``:
        Never [default: auto]
    trend
        Estimate a slope and the level of the output with the parameters: for drift; of arima with one
        difference the drift alone
    split
        Cut the rows in time order into parts: models are fitted to the first and compared, the chosen one is
        fitted again to the first two and evaluated on the third; 0 for no such part
    search
        The search algorithm; ``"lm"``: Levenberg and Marquardt; ``"gauss-newton"``: Gauss and Newton; the
        step is halved until the cost falls; ``"newton"``: Newton and Raphson with the full Hessian;
        ``"gradient"``: Steepest descent; ``"annealing"``: Simulated annealing, then lm from the best point
        found [default: lm]
    max_iterations
        The largest number of iterations from each start [default: 100, with ``narx`` 500]
    tolerance
        Stop where the next step would lower the cost by less than this fraction [default: 1e-8]
    step
        Step length of the gradient search: C1, or C1/(C2 + l) in iteration l [default: 1]
    starts
        Search from this many further starts [default: 0, with ``narx`` 4, with ``grey`` some where the first
        one fails]
    seed
        The seed of random starts and of random centres [default: 0]
    time_limit
        After this time begin no iteration and no search from a further start
    norm
        The norm of the errors to minimise: 2, the sum of squares; 1, the sum of absolute values, which is
        robust to outliers; huber or huber:K, squares up to K times the scale of the errors and absolute
        values beyond (K = 1.345 by default); inf, the largest error [default: 2]
    bound
        Keep a parameter in a range, either end of which may be left out, or at a value (a1=0.5)
    dc_gain
        Keep the static gain from an input in a range, or at a value
    ridge
        Ridge regression, which keeps parameters small: its weight, as a number of further samples with
        output 0 [default: 0]
    noise_bound
        A bound that no error may exceed, in units of the output; finds the box of all parameters that
        satisfy it
    """

    estimate: Optional[Rows]
    validate: Optional[Rows]
    detrend: Optional[Union[Literal["mean", "linear", "none"], str]]
    offset: Optional[Mapping[str, float]]
    prefilter: Optional[Band]
    likelihood: Optional[Literal["conditional", "exact"]]
    initial: Optional[Literal["auto", "drop", "zero", "estimate"]]
    focus: Optional[Union[int, Literal["auto", "prediction", "simulation"]]]
    constant: Optional[Literal["auto", "yes", "no"]]
    trend: Optional[bool]
    split: Optional[Union[str, tuple[float, float, float]]]
    search: Optional[Literal["lm", "gauss-newton", "newton", "gradient", "annealing"]]
    max_iterations: Optional[int]
    tolerance: Optional[float]
    step: Optional[Union[float, tuple[float, float]]]
    starts: Optional[int]
    seed: Optional[int]
    time_limit: Optional[float]
    norm: Optional[Union[float, Literal["huber", "inf"], str]]
    bound: Optional[Mapping[str, Bound]]
    dc_gain: Optional[Union[Bound, Mapping[str, Bound]]]
    ridge: Optional[float]
    noise_bound: Optional[float]


class ArimaOptions(TypedDict, total=False):
    """What a fit of a seasonal ARIMA model can be told.

    Attributes
    ----------
    estimate
        Rows to estimate on, 1-based and inclusive, counted through all logs [default: all]
    validate
        Rows to validate on
    constant
        Estimate the level of the output with the parameters, in addition to the mean that is subtracted: for
        step tests and other logs whose mean is not the operating point of the plant. Of arima, which
        subtracts no mean: auto is yes without differences, and no with them; ``"auto"``: If it lowers MDL,
        unless the output's offset is given (``detrend`` none, ``offset``); ``"yes"``: Always; ``"no"``:
        Never [default: auto]
    trend
        Estimate a slope and the level of the output with the parameters: for drift; of arima with one
        difference the drift alone
    split
        Cut the rows in time order into parts: models are fitted to the first and compared, the chosen one is
        fitted again to the first two and evaluated on the third; 0 for no such part
    search
        The search algorithm; ``"lm"``: Levenberg and Marquardt; ``"gauss-newton"``: Gauss and Newton; the
        step is halved until the cost falls; ``"newton"``: Newton and Raphson with the full Hessian;
        ``"gradient"``: Steepest descent; ``"annealing"``: Simulated annealing, then lm from the best point
        found [default: lm]
    max_iterations
        The largest number of iterations from each start [default: 100, with ``narx`` 500]
    tolerance
        Stop where the next step would lower the cost by less than this fraction [default: 1e-8]
    time_limit
        After this time begin no iteration and no search from a further start
    """

    estimate: Optional[Rows]
    validate: Optional[Rows]
    constant: Optional[Literal["auto", "yes", "no"]]
    trend: Optional[bool]
    split: Optional[Union[str, tuple[float, float, float]]]
    search: Optional[Literal["lm", "gauss-newton", "newton", "gradient", "annealing"]]
    max_iterations: Optional[int]
    tolerance: Optional[float]
    time_limit: Optional[float]


class ImpulseResponseOptions(TypedDict, total=False):
    """What a fit of an impulse response can be told.

    Attributes
    ----------
    estimate
        Rows to estimate on, 1-based and inclusive, counted through all logs [default: all]
    validate
        Rows to validate on
    detrend
        What to subtract from each channel before the fit: none, mean, linear, or start:K (the mean of the
        first K rows); ``constant`` and ``trend`` estimate the remaining level and slope of the output
        [default: mean]
    offset
        Set a channel's offset by hand
    prefilter
        Fit in a band of frequencies in Hz, either end of which may be left out: inputs and output go through
        the same Butterworth filter; the model and its figures are those of the unfiltered signals
    likelihood
        The likelihood to maximise, conditional on the first samples or that of all samples (exact), which
        continues through missing outputs (models without D and F); ``"conditional"``: Given the samples that
        the first error needs: least squared prediction errors; ``"exact"``: Of all measured outputs, by the
        Kalman filter (ar, arma, arx, armax) [default: conditional]
    initial
        The initial condition of each segment; ``"auto"``: drop without F; with F estimate if there are rows
        before, or if it is worth its parameters, else zero; ``"drop"``: Measured samples before; without
        them, samples without a full regressor are left out (models without F); ``"zero"``: Zeros;
        ``"estimate"``: Measured samples before, and initial conditions estimated with the parameters (models
        with F, processes, or ``likelihood`` exact with inputs) [default: auto]
    focus
        What the model is for: prediction (errors one step ahead), simulation (free runs, driven by the
        inputs alone), or a number of steps ahead. auto: prediction; without orders simulation if a model for
        it has a clearly better free run on held-out rows; for networks and rbf-free simulation where there
        are inputs [default: auto]
    constant
        Estimate the level of the output with the parameters, in addition to the mean that is subtracted: for
        step tests and other logs whose mean is not the operating point of the plant. Of arima, which
        subtracts no mean: auto is yes without differences, and no with them; ``"auto"``: If it lowers MDL,
        unless the output's offset is given (``detrend`` none, ``offset``); ``"yes"``: Always; ``"no"``:
        Never [default: auto]
    trend
        Estimate a slope and the level of the output with the parameters: for drift; of arima with one
        difference the drift alone
    split
        Cut the rows in time order into parts: models are fitted to the first and compared, the chosen one is
        fitted again to the first two and evaluated on the third; 0 for no such part
    norm
        The norm of the errors to minimise: 2, the sum of squares; 1, the sum of absolute values, which is
        robust to outliers; huber or huber:K, squares up to K times the scale of the errors and absolute
        values beyond (K = 1.345 by default); inf, the largest error [default: 2]
    bound
        Keep a parameter in a range, either end of which may be left out, or at a value (a1=0.5)
    dc_gain
        Keep the static gain from an input in a range, or at a value
    ridge
        Ridge regression, which keeps parameters small: its weight, as a number of further samples with
        output 0 [default: 0]
    noise_bound
        A bound that no error may exceed, in units of the output; finds the box of all parameters that
        satisfy it
    """

    estimate: Optional[Rows]
    validate: Optional[Rows]
    detrend: Optional[Union[Literal["mean", "linear", "none"], str]]
    offset: Optional[Mapping[str, float]]
    prefilter: Optional[Band]
    likelihood: Optional[Literal["conditional", "exact"]]
    initial: Optional[Literal["auto", "drop", "zero", "estimate"]]
    focus: Optional[Union[int, Literal["auto", "prediction", "simulation"]]]
    constant: Optional[Literal["auto", "yes", "no"]]
    trend: Optional[bool]
    split: Optional[Union[str, tuple[float, float, float]]]
    norm: Optional[Union[float, Literal["huber", "inf"], str]]
    bound: Optional[Mapping[str, Bound]]
    dc_gain: Optional[Union[Bound, Mapping[str, Bound]]]
    ridge: Optional[float]
    noise_bound: Optional[float]


class StateSpaceOptions(TypedDict, total=False):
    """What a fit of a model in state space can be told.

    Attributes
    ----------
    estimate
        Rows to estimate on, 1-based and inclusive, counted through all logs [default: all]
    validate
        Rows to validate on
    detrend
        What to subtract from each channel before the fit: none, mean, linear, or start:K (the mean of the
        first K rows); ``constant`` and ``trend`` estimate the remaining level and slope of the output
        [default: mean]
    offset
        Set a channel's offset by hand
    initial
        The initial condition of each segment; ``"auto"``: drop without F; with F estimate if there are rows
        before, or if it is worth its parameters, else zero; ``"drop"``: Measured samples before; without
        them, samples without a full regressor are left out (models without F); ``"zero"``: Zeros;
        ``"estimate"``: Measured samples before, and initial conditions estimated with the parameters (models
        with F, processes, or ``likelihood`` exact with inputs) [default: auto]
    focus
        What the model is for: prediction (errors one step ahead), simulation (free runs, driven by the
        inputs alone), or a number of steps ahead. auto: prediction; without orders simulation if a model for
        it has a clearly better free run on held-out rows; for networks and rbf-free simulation where there
        are inputs [default: auto]
    constant
        Estimate the level of the output with the parameters, in addition to the mean that is subtracted: for
        step tests and other logs whose mean is not the operating point of the plant. Of arima, which
        subtracts no mean: auto is yes without differences, and no with them; ``"auto"``: If it lowers MDL,
        unless the output's offset is given (``detrend`` none, ``offset``); ``"yes"``: Always; ``"no"``:
        Never [default: auto]
    past
        Past samples from which the states are computed [default: the number with the least AIC, 40 at most]
    future
        Future samples that the states predict [default: as many as past ones]
    weighting
        The subspace method: ssarx, which is consistent in closed loop too; or moesp, n4sid, cva, which
        project on future inputs [default: ssarx]
    feedthrough
        Whether inputs act on the outputs in the same sample [default: auto]
    refine
        Refine the model of the subspace method by a search for the least errors one step ahead (prediction)
        or of the free run (simulation): poles, gains and responses then have standard errors
    split
        Cut the rows in time order into parts: models are fitted to the first and compared, the chosen one is
        fitted again to the first two and evaluated on the third; 0 for no such part
    search
        The search algorithm; ``"lm"``: Levenberg and Marquardt; ``"gauss-newton"``: Gauss and Newton; the
        step is halved until the cost falls; ``"newton"``: Newton and Raphson with the full Hessian;
        ``"gradient"``: Steepest descent; ``"annealing"``: Simulated annealing, then lm from the best point
        found [default: lm]
    max_iterations
        The largest number of iterations from each start [default: 100, with ``narx`` 500]
    tolerance
        Stop where the next step would lower the cost by less than this fraction [default: 1e-8]
    step
        Step length of the gradient search: C1, or C1/(C2 + l) in iteration l [default: 1]
    time_limit
        After this time begin no iteration and no search from a further start
    """

    estimate: Optional[Rows]
    validate: Optional[Rows]
    detrend: Optional[Union[Literal["mean", "linear", "none"], str]]
    offset: Optional[Mapping[str, float]]
    initial: Optional[Literal["auto", "drop", "zero", "estimate"]]
    focus: Optional[Union[int, Literal["auto", "prediction", "simulation"]]]
    constant: Optional[Literal["auto", "yes", "no"]]
    past: Optional[int]
    future: Optional[int]
    weighting: Optional[Literal["ssarx", "moesp", "n4sid", "cva"]]
    feedthrough: Optional[bool]
    refine: Optional[Literal["prediction", "simulation"]]
    split: Optional[Union[str, tuple[float, float, float]]]
    search: Optional[Literal["lm", "gauss-newton", "newton", "gradient", "annealing"]]
    max_iterations: Optional[int]
    tolerance: Optional[float]
    step: Optional[Union[float, tuple[float, float]]]
    time_limit: Optional[float]


class ProcessOptions(TypedDict, total=False):
    """What a fit of a process in continuous time can be told.

    Attributes
    ----------
    estimate
        Rows to estimate on, 1-based and inclusive, counted through all logs [default: all]
    validate
        Rows to validate on
    offset
        Set a channel's offset by hand
    initial
        The initial condition of each segment; ``"auto"``: drop without F; with F estimate if there are rows
        before, or if it is worth its parameters, else zero; ``"drop"``: Measured samples before; without
        them, samples without a full regressor are left out (models without F); ``"zero"``: Zeros;
        ``"estimate"``: Measured samples before, and initial conditions estimated with the parameters (models
        with F, processes, or ``likelihood`` exact with inputs) [default: auto]
    trend
        Estimate a slope and the level of the output with the parameters: for drift; of arima with one
        difference the drift alone
    split
        Cut the rows in time order into parts: models are fitted to the first and compared, the chosen one is
        fitted again to the first two and evaluated on the third; 0 for no such part
    search
        The search algorithm; ``"lm"``: Levenberg and Marquardt; ``"gauss-newton"``: Gauss and Newton; the
        step is halved until the cost falls; ``"newton"``: Newton and Raphson with the full Hessian;
        ``"gradient"``: Steepest descent; ``"annealing"``: Simulated annealing, then lm from the best point
        found [default: lm]
    max_iterations
        The largest number of iterations from each start [default: 100, with ``narx`` 500]
    tolerance
        Stop where the next step would lower the cost by less than this fraction [default: 1e-8]
    step
        Step length of the gradient search: C1, or C1/(C2 + l) in iteration l [default: 1]
    starts
        Search from this many further starts [default: 0, with ``narx`` 4, with ``grey`` some where the first
        one fails]
    time_limit
        After this time begin no iteration and no search from a further start
    """

    estimate: Optional[Rows]
    validate: Optional[Rows]
    offset: Optional[Mapping[str, float]]
    initial: Optional[Literal["auto", "drop", "zero", "estimate"]]
    trend: Optional[bool]
    split: Optional[Union[str, tuple[float, float, float]]]
    search: Optional[Literal["lm", "gauss-newton", "newton", "gradient", "annealing"]]
    max_iterations: Optional[int]
    tolerance: Optional[float]
    step: Optional[Union[float, tuple[float, float]]]
    starts: Optional[int]
    time_limit: Optional[float]


class NarxOptions(TypedDict, total=False):
    """What a fit of a nonlinear ARX model can be told.

    Attributes
    ----------
    estimate
        Rows to estimate on, 1-based and inclusive, counted through all logs [default: all]
    validate
        Rows to validate on
    detrend
        What to subtract from each channel before the fit: none, mean, linear, or start:K (the mean of the
        first K rows); ``constant`` and ``trend`` estimate the remaining level and slope of the output
        [default: mean]
    offset
        Set a channel's offset by hand
    focus
        What the model is for: prediction (errors one step ahead), simulation (free runs, driven by the
        inputs alone), or a number of steps ahead. auto: prediction; without orders simulation if a model for
        it has a clearly better free run on held-out rows; for networks and rbf-free simulation where there
        are inputs [default: auto]
    regressors
        A further argument of g, an expression of channels such as 'sqrt(u)', at the lags of the channels in
        it; may be repeated
    degree
        The largest number of factors of a product (poly), or the degree of curves (``curve`` poly) [default:
        2, of curves 3]
    terms
        The number of functions in the model; or products by name, as ``Model.parameter_names`` has them
        [default: as ``select`` says, by the free run on validation rows, or on blocks of the estimation
        rows]
    most_terms
        How many functions to evaluate [default: 40, and 10 local models]
    centres
        The centres of radial basis functions (rbf): chosen among the samples, at the means of N clusters, at
        a grid of N in each direction, or at N pseudo-random points [default: chosen]
    width
        sigma of radial basis functions exp(-|z - centre|^2/sigma^2), z in standard deviations [default: so
        that neighbours overlap]
    linear
        Whether a constant and the regressors themselves stand beside radial basis functions (rbf); whether
        local models, and what neighbours say, are planes (local, knn)
    membership
        How local models share the space of the regressors (local); ``"rectangle"``: Each in its box alone;
        ``"trapezoid"``: Sloping edges, which overlap; ``"gaussian"``: Gaussians, over their sum [default:
        gaussian]
    units
        Units of a network (tanh, logistic, relu), centres (rbf-free), local models (local) or neighbours
        (knn); bends of each regressor (spline), 5 if not said; units that are drawn (step, ``drawn``), 100
        if not said [default: chosen]
    drawn
        Draw the weights of the hidden layer of a network, and choose among its units (tanh, logistic, relu);
        else they are trained. Those of step are always drawn
    raw_terms
        Keep signals in their own units; without it each is divided by its standard deviation
    select
        The criterion of the choice; ``"fpe"``: Akaike's final prediction error; ``"aic"``: Akaike's
        information criterion; ``"aicc"``: The same, corrected for few samples; ``"mdl"``: Rissanen's minimum
        description length; ``"hqc"``: Hannan and Quinn's criterion, between AIC and MDL; ``"validation"``:
        The smallest model within 1 % of the least cost on the validation rows; ``"cv"``: The same by
        cross-validation over five blocks in time [default: mdl]
    split
        Cut the rows in time order into parts: models are fitted to the first and compared, the chosen one is
        fitted again to the first two and evaluated on the third; 0 for no such part
    search
        The search algorithm; ``"lm"``: Levenberg and Marquardt; ``"gauss-newton"``: Gauss and Newton; the
        step is halved until the cost falls; ``"newton"``: Newton and Raphson with the full Hessian;
        ``"gradient"``: Steepest descent; ``"annealing"``: Simulated annealing, then lm from the best point
        found [default: lm]
    max_iterations
        The largest number of iterations from each start [default: 100, with ``narx`` 500]
    tolerance
        Stop where the next step would lower the cost by less than this fraction [default: 1e-8]
    step
        Step length of the gradient search: C1, or C1/(C2 + l) in iteration l [default: 1]
    starts
        Search from this many further starts [default: 0, with ``narx`` 4, with ``grey`` some where the first
        one fails]
    seed
        The seed of random starts and of random centres [default: 0]
    time_limit
        After this time begin no iteration and no search from a further start
    ridge
        Ridge regression, which keeps parameters small: its weight, as a number of further samples with
        output 0 [default: 0]
    """

    estimate: Optional[Rows]
    validate: Optional[Rows]
    detrend: Optional[Union[Literal["mean", "linear", "none"], str]]
    offset: Optional[Mapping[str, float]]
    focus: Optional[Union[int, Literal["auto", "prediction", "simulation"]]]
    regressors: Optional[Sequence[str]]
    degree: Optional[int]
    terms: Optional[Union[int, Sequence[str]]]
    most_terms: Optional[int]
    centres: Optional[str]
    width: Optional[float]
    linear: Optional[bool]
    membership: Optional[Literal["rectangle", "trapezoid", "gaussian"]]
    units: Optional[int]
    drawn: Optional[bool]
    raw_terms: Optional[bool]
    select: Optional[Literal["fpe", "aic", "aicc", "mdl", "hqc", "validation", "cv"]]
    split: Optional[Union[str, tuple[float, float, float]]]
    search: Optional[Literal["lm", "gauss-newton", "newton", "gradient", "annealing"]]
    max_iterations: Optional[int]
    tolerance: Optional[float]
    step: Optional[Union[float, tuple[float, float]]]
    starts: Optional[int]
    seed: Optional[int]
    time_limit: Optional[float]
    ridge: Optional[float]


class BlocksOptions(TypedDict, total=False):
    """What a fit of a model in blocks can be told.

    Attributes
    ----------
    estimate
        Rows to estimate on, 1-based and inclusive, counted through all logs [default: all]
    validate
        Rows to validate on
    degree
        The largest number of factors of a product (poly), or the degree of curves (``curve`` poly) [default:
        2, of curves 3]
    curve
        The form of static curves; ``"lines"``: Straight lines from knot to knot; ``"poly"``: A polynomial,
        of degree 3 unless ``degree`` says otherwise [default: lines, of a feedback poly]
    knots
        Knots of curves of lines [default: chosen]
    split
        Cut the rows in time order into parts: models are fitted to the first and compared, the chosen one is
        fitted again to the first two and evaluated on the third; 0 for no such part
    search
        The search algorithm; ``"lm"``: Levenberg and Marquardt; ``"gauss-newton"``: Gauss and Newton; the
        step is halved until the cost falls; ``"newton"``: Newton and Raphson with the full Hessian;
        ``"gradient"``: Steepest descent; ``"annealing"``: Simulated annealing, then lm from the best point
        found [default: lm]
    max_iterations
        The largest number of iterations from each start [default: 100, with ``narx`` 500]
    tolerance
        Stop where the next step would lower the cost by less than this fraction [default: 1e-8]
    step
        Step length of the gradient search: C1, or C1/(C2 + l) in iteration l [default: 1]
    time_limit
        After this time begin no iteration and no search from a further start
    """

    estimate: Optional[Rows]
    validate: Optional[Rows]
    degree: Optional[int]
    curve: Optional[Literal["lines", "poly"]]
    knots: Optional[int]
    split: Optional[Union[str, tuple[float, float, float]]]
    search: Optional[Literal["lm", "gauss-newton", "newton", "gradient", "annealing"]]
    max_iterations: Optional[int]
    tolerance: Optional[float]
    step: Optional[Union[float, tuple[float, float]]]
    time_limit: Optional[float]


class EquationsOptions(TypedDict, total=False):
    """What a fit of a model in equations can be told.

    Attributes
    ----------
    estimate
        Rows to estimate on, 1-based and inclusive, counted through all logs [default: all]
    validate
        Rows to validate on
    split
        Cut the rows in time order into parts: models are fitted to the first and compared, the chosen one is
        fitted again to the first two and evaluated on the third; 0 for no such part
    search
        The search algorithm; ``"lm"``: Levenberg and Marquardt; ``"gauss-newton"``: Gauss and Newton; the
        step is halved until the cost falls; ``"newton"``: Newton and Raphson with the full Hessian;
        ``"gradient"``: Steepest descent; ``"annealing"``: Simulated annealing, then lm from the best point
        found [default: lm]
    max_iterations
        The largest number of iterations from each start [default: 100, with ``narx`` 500]
    tolerance
        Stop where the next step would lower the cost by less than this fraction [default: 1e-8]
    step
        Step length of the gradient search: C1, or C1/(C2 + l) in iteration l [default: 1]
    starts
        Search from this many further starts [default: 0, with ``narx`` 4, with ``grey`` some where the first
        one fails]
    profile
        Add intervals of 95 % by profile likelihood, which know bounds and curvature; some twenty searches
        for each parameter
    seed
        The seed of random starts and of random centres [default: 0]
    time_limit
        After this time begin no iteration and no search from a further start
    """

    estimate: Optional[Rows]
    validate: Optional[Rows]
    split: Optional[Union[str, tuple[float, float, float]]]
    search: Optional[Literal["lm", "gauss-newton", "newton", "gradient", "annealing"]]
    max_iterations: Optional[int]
    tolerance: Optional[float]
    step: Optional[Union[float, tuple[float, float]]]
    starts: Optional[int]
    profile: Optional[bool]
    seed: Optional[int]
    time_limit: Optional[float]


class ValidationOptions(TypedDict, total=False):
    """How to validate a model on a log.

    Attributes
    ----------
    rows
        Rows to validate on, 1-based and inclusive [default: all]
    detrend
        Offsets: the model's own, or none, mean, linear, start:K of the rows evaluated [default: model]
    horizon
        Prediction horizons besides 1, in steps [default: 5]
    lags
        Lags of the tests of residuals; short logs have fewer [default: 25]
    alpha
        Significance level [default: 0.05]
    alphas
        The levels of the bands of Anderson's test, which counts the correlations outside [default:
        0.01,0.02,0.05,0.1,0.2]
    """

    rows: Optional[Rows]
    detrend: Optional[Union[Literal["model", "none", "mean", "linear"], str]]
    horizon: Optional[Union[int, Sequence[int]]]
    lags: Optional[int]
    alpha: Optional[float]
    alphas: Optional[Sequence[float]]


class SpectrumOptions(TypedDict, total=False):
    """How a frequency response is estimated from a log.

    Attributes
    ----------
    rows
        Rows to use, 1-based and inclusive; each range is a segment of its own [default: all]
    detrend
        What is subtracted from each channel first: none, mean, linear, start:K [default: mean]
    method
        The estimation method; ``"lpm"``: Local polynomials for response and transient; ``"spa"``: Blackman
        and Tukey: transforms of windowed covariances; ``"welch"``: Welch: averages over windows that overlap
        by half; ``"etfe"``: The ratio of the transforms, unsmoothed; ``"sines"``: Correlation over whole
        periods of a stepped or a multi-sine input [default: lpm]
    frequencies
        Frequencies in radians per second: a band, or for lpm and spa a list [default: all that the log has]
    points
        For lpm and spa: how many frequencies of the band, each the same factor above the one before
        [default: 200]
    half_width
        For lpm: lines of the transform on either side of a frequency [default: 12 for one input, 14 for two,
        …]
    lags
        For spa: lags of the Hann window [default: as many as do not change the response when they are
        doubled]
    window
        For welch: rows of a window [default: a power of two, about an eighth of the log]
    estimator
        For welch: which ratio of the spectra; ``"h1"``: The noise is in the output; ``"h2"``: It is in the
        input [default: h1]
    period
        For sines: rows of a period [default: those after which the input repeats itself]
    discard
        For sines: periods to leave out at the beginning [default: those that differ from the later ones]
    """

    rows: Optional[Rows]
    detrend: Optional[Union[Literal["mean", "linear", "none"], str]]
    method: Optional[Literal["lpm", "spa", "welch", "etfe", "sines"]]
    frequencies: Optional[Frequencies]
    points: Optional[int]
    half_width: Optional[int]
    lags: Optional[int]
    window: Optional[int]
    estimator: Optional[Literal["h1", "h2"]]
    period: Optional[int]
    discard: Optional[int]


class DesignOptions(TypedDict, total=False):
    """What a test signal has to be.

    Attributes
    ----------
    length
        How many samples [default: 1023, a period of a PRBS; with ``model`` the length whose errors are told]
    range
        The lowest and the highest value, in units of the input [default: -1..1]
    rms
        A power budget: give the deviations from the middle of the range this root mean square, instead of
        its width
    band
        The lowest and the highest frequency of multisine, chirp and sines, in radians per second [default:
        all]
    points
        How many frequencies, each the same factor above the one before, of multisine and sines [default:
        every line of the period; of sines 10]
    period
        Repeat the signal after this many samples [default: of prbs the longest that fits, of multisine 4096
        at most, else the length]
    channels
        The number of uncorrelated signals [default: 1, with ``model`` one for each input of the model]
    sample_time
        Seconds from one sample to the next [default: 1, with ``model`` that of the model]
    seed
        The seed of random signals, or where a PRBS begins [default: 0]
    """

    length: Optional[int]
    range: Optional[tuple[float, float]]
    rms: Optional[float]
    band: Optional[tuple[float, float]]
    points: Optional[int]
    period: Optional[int]
    channels: Optional[int]
    sample_time: Optional[Duration]
    seed: Optional[int]
