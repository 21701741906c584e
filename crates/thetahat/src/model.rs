//! What a model is: its orders, its polynomials, its equations, and the form that a document stores.
//!
//! - [`Orders`] say how many coefficients each polynomial of A(q) y(t) = B(q)/F(q) u(t - nk) + C(q)/D(q) e(t) has, and
//!   with that the [`Structure`] (Ljung, System Identification: Theory for the User, 2nd ed. 1999, section 4.2).
//! - [`PolynomialModel`] has the polynomials, each [`Parameter`] with its standard error, every [`Root`] and
//!   [`Quantity`] that follows from them with an [`Interval`], and the [`Signal`]s it was fitted to.
//!   [`OffsetCovariance`] is the uncertainty of the output's offset.
//! - [`ArimaFactors`] of [`ArimaOrders`] are what C and D of a seasonal ARIMA model are products of.
//! - [`StateSpace`] is the same model as a recursion of first order, for filters and controllers: of fewer states
//!   ([`Reduced`]), in continuous time ([`ContinuousStateSpace`]) as a [`Hold`] says, or as [`ZerosPolesGain`] of one
//!   input and output. [`StateSpaceModel`] is one that was estimated as such, with any number of outputs,
//!   [`ContinuousStateSpaceModel`] what a fitted model is in continuous time, and [`TimeBase`] what one is converted
//!   to.
//! - [`GreyBox`] is a model in equations as a person writes it, [`EquationsModel`] one whose parameters were estimated.
//! - [`NonlinearArxModel`] is a nonlinear map of past outputs and inputs: for each output an [`OutputMap`], a [`Map`]
//!   of [`Regressor`]s, which may be local models, each with its [`Membership`].
//! - [`Model`] is a model of any kind: what reports hold. [`LinearModel`] is one output of a linear one.
//!
//! ```
//! use thetahat::model::{Orders, Structure};
//!
//! let orders = Orders::bj(&[2], 1, 1, &[2], &[3])?;
//! assert_eq!(orders.structure(), Structure::Bj);
//! assert_eq!(orders.names(), ["b3", "b4", "c1", "d1", "f1", "f2"]);
//! # Ok::<(), thetahat::Error>(())
//! ```

mod arima;
mod assembly;
mod convert;
mod dynamics;
pub(crate) mod equations;
mod fitted;
mod kind;
mod known;
mod linear;
mod nonlinear_arx;
mod orders;
pub(crate) mod polynomial;
mod process;
mod quantity;
mod resolvent;
mod state_space;

pub use arima::ArimaOrders;
pub(crate) use arima::{Expanded, Factor};
pub use convert::TimeBase;
pub(crate) use dynamics::{
    Block, Blocks, Gradient, cancel, covariance, is_simple, near_cancellation, standard_error,
};
pub(crate) use equations::{ChannelExpression, ExpressionBuffer, toml_text};
pub use equations::{DerivedFigure, EquationsModel, GreyBox};
pub(crate) use fitted::is_covariance;
pub use fitted::{ArimaFactors, OffsetCovariance, Parameter, PolynomialModel, Signal};
pub(crate) use kind::FilterForm;
pub use kind::Model;
pub use known::{ChannelNames, Coefficients, KnownOptions, Matrix, Polynomials, TransferFunction};
pub use linear::LinearModel;
pub(crate) use nonlinear_arx::Evaluator;
pub use nonlinear_arx::{
    Activation, Functions, Map, Membership, NonlinearArxModel, OutputMap, Regressor, RunError,
};
pub(crate) use orders::{LARGEST, lag_name};
pub use orders::{Orders, Structure};
pub(crate) use process::{Chain, Columns, MOST_POLES, Parts, State, Transition};
pub use process::{ProcessModel, ProcessStructure};
pub use quantity::{Interval, Quantity, Root};
pub(crate) use resolvent::{Complex, resolved};
pub use state_space::{
    ContinuousStateSpace, ContinuousStateSpaceModel, Entry, EntryCovariance, Hold, Reduced, StateSpace,
    StateSpaceMatrix, StateSpaceModel, ZerosPolesGain,
};
pub(crate) use state_space::{
    Path, Sizes, across_coordinates, eigenvalues, flat, is_stable, riccati, symmetric_eigen,
};
