//! What follows from how an estimate was found, for those who use it.

use super::{
    ConvexOutcome, EquationsOutcome, LikelihoodOutcome, MapsOutcome, Procedure, ProcessOutcome,
    RegularisedOutcome, SearchOutcome, SharedPolesOutcome, SubspaceOutcome, TermsOutcome, VectorArxOutcome,
};

/// Which distribution the tests of residuals have where the model is right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum NullDistribution {
    /// The parameters made the squares of these residuals least.
    Fitted,
    /// The parameters were fitted to the same samples by instrumental variables.
    Instrumental,
    /// The parameters come from other samples, or the tests do not know what the errors owe to them.
    Known,
}

/// The covariance of parameters that were found from prefiltered signals, whose errors have a colour where e is white.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FilteredCovariance {
    /// It is found again for errors with that colour.
    OfColouredErrors,
    /// The estimate has it.
    Own,
    /// Nobody knows it.
    Unknown,
}

impl Procedure {
    /// The distribution of the tests of residuals on the rows of the fit.
    pub(crate) fn null_distribution(&self) -> NullDistribution {
        match self {
            Self::LeastSquares { .. }
            | Self::RefinedInstrumentalVariables { .. }
            | Self::PredictionError(_)
            | Self::Regularised(_)
            | Self::Constrained(_)
            | Self::Robust(_)
            | Self::ExactLikelihood(_) => NullDistribution::Fitted,
            Self::InstrumentalVariables { .. } => NullDistribution::Instrumental,
            // The tests have no derivatives of these errors by the parameters.
            Self::InnovationsLikelihood(_)
            | Self::ForwardRegression(_)
            | Self::Splits(_)
            | Self::Neighbours(_)
            | Self::Training(_)
            | Self::FreeRun(_)
            | Self::FrequencyResponse(_)
            | Self::SharedPoles(_)
            | Self::Subspace(_)
            | Self::VectorArx(_)
            | Self::Given => NullDistribution::Known,
        }
    }

    /// What is known of the covariance of parameters that were found from prefiltered signals.
    pub(super) fn filtered_covariance(&self, output_error: bool) -> FilteredCovariance {
        match self {
            Self::LeastSquares { .. } | Self::PredictionError(_) => FilteredCovariance::OfColouredErrors,
            Self::InstrumentalVariables { .. } | Self::RefinedInstrumentalVariables { .. } => {
                FilteredCovariance::Own
            }
            Self::Robust(_) if output_error => FilteredCovariance::Own,
            Self::Robust(_)
            | Self::Constrained(_)
            | Self::Regularised(_)
            | Self::ExactLikelihood(_)
            | Self::InnovationsLikelihood(_)
            | Self::ForwardRegression(_)
            | Self::Splits(_)
            | Self::Neighbours(_)
            | Self::Training(_)
            | Self::FreeRun(_)
            | Self::FrequencyResponse(_)
            | Self::SharedPoles(_)
            | Self::Subspace(_)
            | Self::VectorArx(_)
            | Self::Given => FilteredCovariance::Unknown,
        }
    }

    /// That of numbers that were given.
    pub(crate) fn given() -> Self {
        Self::Given
    }

    /// Whether nothing was estimated.
    pub fn is_given(&self) -> bool {
        matches!(self, Self::Given)
    }

    /// Whether it was by instrumental variables, which say nothing of the noise.
    pub fn is_instrumental(&self) -> bool {
        matches!(self, Self::InstrumentalVariables { .. } | Self::RefinedInstrumentalVariables { .. })
    }

    /// The search for the parameters of polynomials, if there was one whose cost is a sum over prediction errors.
    pub fn search(&self) -> Option<&SearchOutcome> {
        match self {
            Self::PredictionError(search) => Some(search),
            Self::Robust(outcome) => Some(&outcome.search),
            Self::ExactLikelihood(outcome) => Some(&outcome.search),
            Self::LeastSquares { .. }
            | Self::InstrumentalVariables { .. }
            | Self::RefinedInstrumentalVariables { .. }
            | Self::Regularised(_)
            | Self::Constrained(_)
            | Self::InnovationsLikelihood(_)
            | Self::ForwardRegression(_)
            | Self::Splits(_)
            | Self::Neighbours(_)
            | Self::Training(_)
            | Self::FreeRun(_)
            | Self::FrequencyResponse(_)
            | Self::SharedPoles(_)
            | Self::Subspace(_)
            | Self::VectorArx(_)
            | Self::Given => None,
        }
    }

    /// How many initial conditions of polynomials were estimated with the parameters.
    pub(crate) fn initial_conditions(&self) -> usize {
        match self {
            Self::RefinedInstrumentalVariables { initial_conditions, .. } => *initial_conditions,
            Self::Constrained(outcome) => {
                outcome.search.as_ref().map_or(0, |search| search.initial_conditions)
            }
            _ => self.search().map_or(0, |search| search.initial_conditions),
        }
    }

    /// The search for the largest likelihood of all measured outputs, if it was that.
    pub fn exact_likelihood(&self) -> Option<&LikelihoodOutcome> {
        if let Self::ExactLikelihood(outcome) = self { Some(outcome) } else { None }
    }

    /// What was made small, and what bounds were kept, if it was by convex optimization.
    pub fn constrained(&self) -> Option<&ConvexOutcome> {
        if let Self::Constrained(outcome) = self { Some(outcome) } else { None }
    }

    /// The kernel of regularised least squares, if it was by that.
    pub fn regularised(&self) -> Option<&RegularisedOutcome> {
        if let Self::Regularised(outcome) = self { Some(outcome) } else { None }
    }

    /// How a model in equations was found.
    pub fn equations(&self) -> Option<&EquationsOutcome> {
        if let Self::InnovationsLikelihood(outcome) = self { Some(outcome) } else { None }
    }

    /// How a process was found from a log.
    pub fn free_run(&self) -> Option<&ProcessOutcome> {
        if let Self::FreeRun(outcome) = self { Some(outcome) } else { None }
    }

    /// How a process was found from a measured frequency response.
    pub fn frequency_response(&self) -> Option<&ProcessOutcome> {
        if let Self::FrequencyResponse(outcome) = self { Some(outcome) } else { None }
    }

    /// How a process was found, from whatever.
    pub fn process(&self) -> Option<&ProcessOutcome> {
        self.free_run().or(self.frequency_response())
    }

    /// How a state-space model was found, if it was by a subspace method.
    pub fn subspace(&self) -> Option<&SubspaceOutcome> {
        if let Self::Subspace(outcome) = self { Some(outcome) } else { None }
    }

    /// How a state-space model was found from a measured frequency response.
    pub fn shared_poles(&self) -> Option<&SharedPolesOutcome> {
        if let Self::SharedPoles(outcome) = self { Some(outcome) } else { None }
    }

    /// How an ARX model of several outputs was found.
    pub fn vector_arx(&self) -> Option<&VectorArxOutcome> {
        if let Self::VectorArx(outcome) = self { Some(outcome) } else { None }
    }

    /// The choices of the functions of a nonlinear ARX model.
    pub(crate) fn maps(&self) -> Option<&MapsOutcome> {
        if let Self::ForwardRegression(maps)
        | Self::Splits(maps)
        | Self::Neighbours(maps)
        | Self::Training(maps) = self
        {
            Some(maps)
        } else {
            None
        }
    }

    /// The choices of the functions of a nonlinear ARX model, one for each output; none of other models.
    pub fn terms(&self) -> &[TermsOutcome] {
        self.maps().map_or(&[], |outcome| &outcome.maps)
    }
}

impl From<EquationsOutcome> for Procedure {
    fn from(outcome: EquationsOutcome) -> Self {
        Self::InnovationsLikelihood(outcome)
    }
}

impl From<SubspaceOutcome> for Procedure {
    fn from(outcome: SubspaceOutcome) -> Self {
        Self::Subspace(outcome)
    }
}

impl From<SharedPolesOutcome> for Procedure {
    fn from(outcome: SharedPolesOutcome) -> Self {
        Self::SharedPoles(outcome)
    }
}

impl From<VectorArxOutcome> for Procedure {
    fn from(outcome: VectorArxOutcome) -> Self {
        Self::VectorArx(outcome)
    }
}

impl ProcessOutcome {
    /// How a process was found from a log.
    pub(crate) fn of_log(self) -> Procedure {
        Procedure::FreeRun(self)
    }

    /// How a process was found from a measured frequency response.
    pub(crate) fn of_response(self) -> Procedure {
        Procedure::FrequencyResponse(self)
    }
}

impl MapsOutcome {
    /// Functions that were chosen.
    pub(crate) fn chosen(self) -> Procedure {
        Procedure::ForwardRegression(self)
    }

    /// Local models, whose boxes were split.
    pub(crate) fn split(self) -> Procedure {
        Procedure::Splits(self)
    }

    /// Samples that are asked.
    pub(crate) fn of_neighbours(self) -> Procedure {
        Procedure::Neighbours(self)
    }

    /// Maps that were trained.
    pub(crate) fn trained(self) -> Procedure {
        Procedure::Training(self)
    }
}
