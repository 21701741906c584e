//! PyO3 with another message where an object is in use already: `#[pyo3(crate = "crate::in_use")]` at the methods of a
//! class that changes makes their code call what stands here, where `&self` and its like are taken. There is no lock: a
//! call that comes while another one runs is refused, as before.
//!
//! What generated code calls is no stable interface of PyO3. Where it changes, this does not compile, or the tests of
//! the message tell.

pub(crate) use pyo3::*;

pub(crate) mod impl_ {
    pub(crate) use pyo3::impl_::*;

    pub(crate) mod extract_argument {
        pub(crate) use pyo3::impl_::extract_argument::*;

        use pyo3::exceptions::PyRuntimeError;
        use pyo3::impl_::extract_argument as inner;
        use pyo3::prelude::*;
        use pyo3::pyclass::boolean_struct::False;
        use pyo3::type_object::PyTypeCheck;
        use pyo3::{Borrowed, PyClass, PyClassGuard, PyClassGuardMut};

        /// What is said of an object that could not be taken: PyO3 raises a RuntimeError for one in use, and a
        /// TypeError for one of another class.
        #[cold]
        fn said(object: &Bound<'_, PyAny>, error: PyErr) -> PyErr {
            if !error.is_instance_of::<PyRuntimeError>(object.py()) {
                return error;
            }
            match object.get_type().name() {
                Ok(class) => PyRuntimeError::new_err(format!(
                    "this {class} is in use: a call of another thread, or one that called the function that calls now, has not returned; \
                     wait for it, or give each thread an object of its own, such as copy.copy(…) makes"
                )),
                Err(other) => other,
            }
        }

        /// PyO3 trusts the class here; to ask for it once more takes a few nanoseconds, and no promise.
        #[inline]
        pub(crate) fn extract_pyclass_ref_trusted<'a, 'holder, T: PyClass>(
            object: Borrowed<'a, '_, PyAny>,
            holder: &'holder mut Option<PyClassGuard<'a, T>>,
        ) -> PyResult<&'holder T> {
            inner::extract_pyclass_ref(object, holder).map_err(|error| said(&object, error))
        }

        #[inline]
        pub(crate) fn extract_pyclass_ref_mut_trusted<'a, 'holder, T: PyClass<Frozen = False>>(
            object: Borrowed<'a, '_, PyAny>,
            holder: &'holder mut Option<PyClassGuardMut<'a, T>>,
        ) -> PyResult<&'holder mut T> {
            inner::extract_pyclass_ref_mut(object, holder).map_err(|error| said(&object, error))
        }

        #[inline]
        pub(crate) fn extract_receiver_trusted<'a, 'py, T, R>(object: &'a Bound<'py, PyAny>) -> PyResult<R>
        where
            T: PyTypeCheck + 'a,
            R: TryFrom<&'a Bound<'py, T>>,
            R::Error: Into<PyErr>,
        {
            inner::extract_receiver::<T, R>(object).map_err(|error| said(object, error))
        }
    }
}
