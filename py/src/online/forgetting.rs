//! Forgetting policies.

use std::ffi::{CStr, CString};

use pyo3::Borrowed;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyCFunction, PyDict, PyString, PyTuple};
use thetahat_core::{Forgetting as Policy, ForgettingPolicy};

use super::{Reduced, argument, snapshot};

/// How a recursive estimator forgets old samples.
///
/// Wherever an argument is called ``forgetting``, a float is exponential forgetting with that factor, and None is
/// no forgetting.
///
/// Notes
/// -----
/// The memory of a policy with a factor is 1 / (1 - factor) samples. The factor lies in n / (n + 1) to 1, for n
/// parameters.
///
/// References
/// ----------
/// Ljung and Söderström, Theory and Practice of Recursive Identification, 1983, section 2.6.
///
/// Examples
/// --------
/// >>> from thetahat import Forgetting, RecursiveLeastSquares
/// >>> Forgetting.exponential(0.98)
/// Forgetting.exponential(factor=0.98)
/// >>> RecursiveLeastSquares(2, 0.98).forgetting == Forgetting.exponential(0.98)
/// True
#[pyclass(module = "thetahat", frozen, eq)]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct Forgetting {
    pub(crate) policy: Policy<f64>,
}

impl Forgetting {
    /// A policy that was read back, checked as a new one is.
    pub(crate) fn restore(policy: Policy<f64>) -> PyResult<Self> {
        let (kind, numbers) = policy.describe();
        made(kind, &numbers.map(|(_, value)| value).collect::<Vec<_>>())
    }
}

#[pymethods]
impl Forgetting {
    fn __repr__(&self) -> String {
        let (policy, numbers) = self.policy.describe();
        let numbers: Vec<String> =
            numbers.map(|(number, value)| format!("{}={value:?}", number.name)).collect();
        format!("Forgetting.{}({})", name(policy), numbers.join(", "))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        snapshot(py, "Forgetting", &self.policy)
    }
}

/// Adds the class, with a static method for each policy.
pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add_class::<Forgetting>()?;
    let class = py.get_type::<Forgetting>();
    let staticmethod = py.import("builtins")?.getattr("staticmethod")?;
    for policy in Policy::policies() {
        // Python keeps pointers to both as long as the module lives, which is as long as the process does.
        let name: &'static CStr = Box::leak(CString::new(name(policy))?.into_boxed_c_str());
        let documentation: &'static CStr = Box::leak(CString::new(documentation(policy))?.into_boxed_c_str());
        let make = |arguments: &Bound<'_, PyTuple>, named: Option<&Bound<'_, PyDict>>| {
            made(policy, &numbers(policy, arguments, named)?)
        };
        let function = PyCFunction::new_closure(py, Some(name), Some(documentation), make)?;
        class.setattr(function.getattr("__name__")?.cast::<PyString>()?, staticmethod.call1((function,))?)?;
    }
    Ok(())
}

/// What the static method of a policy is called.
fn name(policy: &ForgettingPolicy) -> String {
    policy.word.replace('-', "_")
}

/// Its signature, where Python looks for it, and its text.
fn documentation(policy: &ForgettingPolicy) -> String {
    let arguments = policy.numbers.iter().map(|number| match number.usual {
        Some(usual) => format!("{}={usual:?}", number.name),
        None => number.name.to_owned(),
    });
    let (signature, plain) = (arguments.collect::<Vec<_>>().join(", "), |text: &str| text.replace('`', "``"));
    let mut text = format!("{}({signature})\n--\n\n{}\n", name(policy), plain(policy.says));
    if !policy.notes.is_empty() {
        text += &format!("\n{}\n", plain(policy.notes));
    }
    if !policy.numbers.is_empty() {
        text += "\nParameters\n----------\n";
    }
    for number in policy.numbers {
        let range = number.range.says();
        text += &format!(
            "{} : float\n    {} {}{}.\n",
            number.name,
            number.says,
            range[..1].to_uppercase(),
            &range[1..]
        );
    }
    if !policy.source.is_empty() {
        text += &format!("\nReferences\n----------\n{}\n", policy.source);
    }
    text
}

/// The numbers of a policy among the arguments of its static method.
fn numbers(
    policy: &ForgettingPolicy,
    arguments: &Bound<'_, PyTuple>,
    named: Option<&Bound<'_, PyDict>>,
) -> PyResult<Vec<f64>> {
    let wrong = |what: String| PyTypeError::new_err(format!("Forgetting.{}() {what}", name(policy)));
    if arguments.len() > policy.numbers.len() {
        let (expected, found) = (policy.numbers.len(), arguments.len());
        return Err(wrong(format!("takes {expected} positional arguments but {found} were given")));
    }
    let mut left = named.map(|named| named.copy()).transpose()?;
    let mut values = Vec::with_capacity(policy.numbers.len());
    for (index, number) in policy.numbers.iter().enumerate() {
        let by_place = arguments.get_item(index).ok();
        let by_name = match &left {
            Some(left) => left.get_item(number.name)?,
            None => None,
        };
        if let (Some(left), Some(_)) = (&mut left, &by_name) {
            left.del_item(number.name)?;
        }
        values.push(match (by_place, by_name, number.usual) {
            (Some(_), Some(_), _) => {
                return Err(wrong(format!("got multiple values for argument '{}'", number.name)));
            }
            (Some(given), None, _) | (None, Some(given), _) => argument::number(number.name, &given)?,
            (None, None, Some(usual)) => usual,
            (None, None, None) => return Err(wrong(format!("missing required argument '{}'", number.name))),
        });
    }
    match left.and_then(|left| left.keys().iter().next()) {
        Some(other) => Err(wrong(format!("got an unexpected keyword argument '{other}'"))),
        None => Ok(values),
    }
}

/// The policy with these numbers, each in its range.
fn made(policy: &ForgettingPolicy, numbers: &[f64]) -> PyResult<Forgetting> {
    if let Some((number, value)) = policy.refused(numbers) {
        let message = format!("{}: expected {}, found {value}", number.name, number.range.says());
        return Err(PyValueError::new_err(message));
    }
    let made = policy.with(numbers).map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(Forgetting { policy: made })
}

/// The argument `forgetting`: a float, None, or a policy.
pub(crate) struct Memory(pub(crate) Policy<f64>);

/// What it is where nothing is given.
pub(crate) const STANDARD: Memory = Memory(Policy::Exponential { factor: 0.99 });

impl<'a, 'py> FromPyObject<'a, 'py> for Memory {
    type Error = PyErr;

    fn extract(value: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        if value.is_none() {
            return Ok(Memory(Policy::None));
        }
        if let Ok(forgetting) = value.cast::<Forgetting>() {
            return Ok(Memory(forgetting.get().policy));
        }
        if !argument::is_number(&value) {
            return Err(PyTypeError::new_err(format!(
                "forgetting: expected a float, a Forgetting or None, found {}",
                argument::kind(&value)
            )));
        }
        Ok(Memory(Policy::Exponential { factor: argument::number("forgetting", &value)? }))
    }
}
