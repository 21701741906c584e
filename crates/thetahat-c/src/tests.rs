//! Error paths, which are the same for all sizes: what is refused, and that nothing has changed then.

use core::ffi::{CStr, c_char, c_void};
use core::ptr::{null, null_mut};

use super::*;

const ONES: [Number; 16] = [1.0; 16];

/// Memory for any object of these tests, of any content.
#[repr(C)]
struct Memory([Word; 256]);

impl Memory {
    const BYTES: usize = size_of::<Memory>();

    fn new() -> Box<Self> {
        Box::new(Memory([0x5a5a_5a5a_5a5a_5a5a; 256]))
    }

    fn start(&mut self) -> *mut Word {
        self.0.as_mut_ptr()
    }
}

fn text(text: *const c_char) -> &'static str {
    // SAFETY: names and texts are constant.
    unsafe { CStr::from_ptr(text) }.to_str().expect("plain letters")
}

/// A recursive least squares estimator with two parameters.
fn rls(memory: &mut Memory) -> *mut Rls {
    let mut rls = null_mut();
    // SAFETY: all is as the interface asks for.
    let code = unsafe {
        thetahat_rls_init(&raw mut rls, memory.start(), Memory::BYTES, &thetahat_rls_2, ONES.as_ptr(), null())
    };
    assert_eq!(code, Error::None);
    rls
}

/// An extended Kalman filter with two states.
fn ekf(memory: &mut Memory) -> *mut Ekf {
    let mut ekf = null_mut();
    let (start, bytes) = (memory.start(), Memory::BYTES);
    // SAFETY: all is as the interface asks for.
    let code =
        unsafe { thetahat_ekf_init(&raw mut ekf, start, bytes, &thetahat_ekf_2_1, ONES.as_ptr(), null()) };
    assert_eq!(code, Error::None);
    // SAFETY: the same.
    let code = unsafe { thetahat_ekf_set_noise(ekf, null(), ONES.as_ptr()) };
    assert_eq!(code, Error::None);
    ekf
}

#[test]
fn every_error_has_a_name_and_a_text() {
    let mut names = std::collections::BTreeSet::new();
    for code in 0..=Error::Inputs as i32 {
        names.insert(text(thetahat_error_name(code)));
        assert!(!text(thetahat_error_text(code)).is_empty());
    }
    assert_eq!(names.len(), 23);
    assert_eq!(text(thetahat_error_name(Error::NotFinite as i32)), "NOT_FINITE");
    assert_eq!(text(thetahat_error_name(Error::Other as i32)), "OTHER");
    for code in [-1, 23, i32::MAX, i32::MIN] {
        assert_eq!(text(thetahat_error_name(code)), "UNKNOWN");
        assert_eq!(text(thetahat_action_word(code)), "other");
    }
    assert_eq!(text(thetahat_action_word(Action::NotReady as i32)), "not ready");
}

#[test]
fn memory_is_checked() {
    let mut memory = Memory::new();
    let (start, mut handle) = (memory.start(), null_mut());
    let init =
        |handle: *mut *mut Rls, memory: *mut Word, bytes, size: *const RlsSize, scales: *const Number| {
            // SAFETY: pointers are null, misaligned or valid.
            unsafe { thetahat_rls_init(handle, memory, bytes, size, scales, null()) }
        };
    let (size, ones) = (&raw const thetahat_rls_2, ONES.as_ptr());
    assert_eq!(init(null_mut(), start, 2048, size, ones), Error::NullPointer);
    assert_eq!(init(&raw mut handle, null_mut(), 2048, size, ones), Error::NullPointer);
    assert_eq!(init(&raw mut handle, start, 2048, null(), ones), Error::NullPointer);
    assert_eq!(init(&raw mut handle, start, 2048, size, null()), Error::NullPointer);
    assert_eq!(init(&raw mut handle, start.wrapping_byte_add(4), 2044, size, ones), Error::Misaligned);
    assert_eq!(init(&raw mut handle, start, 2048, size, ones.wrapping_byte_add(1)), Error::Misaligned);
    for bytes in [0, 8, 16, 64] {
        assert_eq!(init(&raw mut handle, start, bytes, size, ones), Error::MemoryTooSmall);
    }
    for scales in [[1.0, Number::NAN], [Number::INFINITY, 1.0]] {
        assert_eq!(init(&raw mut handle, start, 2048, size, scales.as_ptr()), Error::NotFinite);
    }
    assert_eq!(init(&raw mut handle, start, 2048, size, [1.0, 0.0].as_ptr()), Error::OutOfRange);
    assert!(handle.is_null());
    assert!(memory.0.iter().all(|word| *word == 0x5a5a_5a5a_5a5a_5a5a));
}

#[test]
fn a_handle_is_that_of_an_object_of_its_kind() {
    let mut memory = Memory::new();
    // SAFETY: pointers are null or valid.
    unsafe {
        let unused: *mut Rls = memory.start().cast();
        assert_eq!(thetahat_rls_update(unused, ONES.as_ptr(), 1.0, null_mut()), Error::NotInitialised);
        assert_eq!(thetahat_rls_update(null_mut(), ONES.as_ptr(), 1.0, null_mut()), Error::NullPointer);
        let misaligned = unused.wrapping_byte_add(4);
        assert_eq!(thetahat_rls_update(misaligned, ONES.as_ptr(), 1.0, null_mut()), Error::Misaligned);
        let rls = rls(&mut memory);
        assert_eq!(thetahat_rls_update(rls, ONES.as_ptr(), 1.0, null_mut()), Error::None);
        assert_eq!(thetahat_arx_measured(rls.cast(), 1.0, null_mut()), Error::NotInitialised);
        assert_eq!(thetahat_kalman_predict(rls.cast(), null()), Error::NotInitialised);
        assert_eq!(thetahat_ekf_set_iterations(rls.cast(), 1), Error::NotInitialised);
        assert_eq!(thetahat_luenberger_state(rls.cast(), null_mut()), Error::NotInitialised);
        assert_eq!(thetahat_detector_reset(rls.cast()), Error::NotInitialised);
        assert_eq!(thetahat_rst_applied(rls.cast(), 1.0), Error::NotInitialised);
    }
}

#[test]
fn a_sample_that_is_refused_changes_nothing() {
    let mut memory = Memory::new();
    let rls = rls(&mut memory);
    let mut innovation = core::mem::MaybeUninit::<Innovation>::uninit();
    let told = innovation.as_mut_ptr();
    let mut parameters = [0.0; 2];
    // SAFETY: pointers are null or valid; the innovation is read after it was written.
    unsafe {
        assert_eq!(thetahat_rls_update(rls, [1.0, 2.0].as_ptr(), 3.0, told), Error::None);
        assert_eq!((*told).action, Action::Updated as i32);
        let before = memory.0;
        assert_eq!(thetahat_rls_update(rls, [1.0, 2.0].as_ptr(), Number::INFINITY, told), Error::Infinite);
        assert_eq!(thetahat_rls_update(rls, [1.0, 1e30].as_ptr(), 1.0, told), TOO_LARGE_OR_NONE);
        assert_eq!(thetahat_rls_update(rls, null(), 1.0, told), Error::NullPointer);
        assert_eq!(thetahat_rls_set_parameters(rls, [1.0, Number::NAN].as_ptr()), Error::NotFinite);
        assert_eq!(thetahat_rls_predict(rls, ONES.as_ptr(), null_mut()), Error::NullPointer);
        assert!(cfg!(feature = "double") || memory.0 == before);
        assert_eq!(thetahat_rls_update(rls, [1.0, 2.0].as_ptr(), Number::NAN, told), Error::None);
        assert_eq!((*told).action, Action::Missing as i32);
        assert_eq!(thetahat_rls_set_adaptation(rls, 0), Error::None);
        assert_eq!(thetahat_rls_update(rls, [1.0, 2.0].as_ptr(), 9.0, told), Error::None);
        assert_eq!((*told).action, Action::Frozen as i32);
        assert_eq!(thetahat_rls_set_parameters(rls, [5.0, 6.0].as_ptr()), Error::None);
        assert_eq!(
            thetahat_rls_parameters(rls, parameters.as_mut_ptr(), null_mut(), null_mut()),
            Error::None
        );
    }
    assert_eq!(parameters, [5.0, 6.0]);
}

/// What is too large in single precision is not in double.
const TOO_LARGE_OR_NONE: Error = if cfg!(feature = "double") { Error::None } else { Error::TooLarge };

const FIRST_ORDER: ArxModel = ArxModel {
    na: 1,
    inputs: 1,
    input: [InputOrders { nb: 1, nk: 1 }; 4],
    nc: 0,
    constant: 0,
    output_scale: 1.0,
    input_scales: [1.0; 4],
    noise_scale: 1.0,
    gradient: 0,
};

#[test]
fn orders_and_learning_are_checked() {
    let (mut memory, mut arx) = (Memory::new(), null_mut());
    let model = FIRST_ORDER;
    let start = memory.start();
    let mut init = |size: &'static ArxSize, model: ArxModel, learning: Learning| {
        // SAFETY: all pointers are valid.
        unsafe {
            thetahat_arx_init(&raw mut arx, start, Memory::BYTES, size, &raw const model, &raw const learning)
        }
    };
    let usual = Learning::DEFAULT;
    assert_eq!(init(&thetahat_arx_2, model, usual), Error::None);
    assert_eq!(init(&thetahat_arx_3, model, usual), Error::Orders);
    assert_eq!(init(&thetahat_arx_2, ArxModel { nc: 1, ..model }, usual), Error::Orders);
    assert_eq!(init(&thetahat_arx_2, ArxModel { inputs: 5, ..model }, usual), Error::Length);
    assert_eq!(init(&thetahat_arx_2, ArxModel { inputs: u32::MAX, ..model }, usual), Error::Length);
    let late = ArxModel { input: [InputOrders { nb: 1, nk: 17 }; 4], ..model };
    assert_eq!(init(&thetahat_arx_2, late, usual), Error::Delays);
    assert_eq!(init(&thetahat_arx_2, ArxModel { output_scale: 0.0, ..model }, usual), Error::OutOfRange);
    assert_eq!(init(&thetahat_arx_2, model, Learning { forgetting: 5, ..usual }), Error::OutOfRange);
    assert_eq!(init(&thetahat_arx_2, model, Learning { forgetting: -1, ..usual }), Error::OutOfRange);
    assert_eq!(init(&thetahat_arx_2, model, Learning { factor: 0.0, ..usual }), Error::OutOfRange);
    assert_eq!(init(&thetahat_arx_2, model, Learning { start: 3, ..usual }), Error::OutOfRange);
    assert_eq!(init(&thetahat_arx_2, model, Learning { dead_zone: -1.0, ..usual }), Error::OutOfRange);
    for (outliers, threshold, release) in [(3, 9.0, 0), (1, 0.5, 0), (2, Number::NAN, 0), (2, 9.0, 65_536)] {
        let wrong = Learning { outliers, threshold, release, ..usual };
        assert_eq!(init(&thetahat_arx_2, model, wrong), Error::OutOfRange);
    }
    let robust = Learning { outliers: Outliers::Gate as i32, threshold: 25.0, release: 10, ..usual };
    assert_eq!(init(&thetahat_arx_2, model, robust), Error::None);
    let mixed = Learning { start: Start::Mixed as i32, blend: 65_536, ..usual };
    assert_eq!(init(&thetahat_arx_2, model, mixed), Error::OutOfRange);
    assert_eq!(init(&thetahat_arx_2, model, Learning { blend: 10, ..mixed }), Error::None);
    let exact = Learning { start: Start::Exact as i32, ..usual };
    assert_eq!(init(&thetahat_arx_2, model, exact), Error::None);
    let noisy = ArxModel { nc: 1, ..model };
    assert_eq!(init(&thetahat_armax_3, noisy, exact), Error::OutOfRange);
    assert_eq!(init(&thetahat_armax_3, ArxModel { gradient: 2, ..noisy }, usual), Error::OutOfRange);
    assert_eq!(init(&thetahat_armax_3, ArxModel { gradient: 1, ..noisy }, usual), Error::None);
    for forgetting in 0..=4 {
        let learning = Learning { forgetting, minimum: 0.9, noise_variance: 1.0, ..usual };
        assert_eq!(init(&thetahat_arx_2, model, learning), Error::None);
    }
    let at_once = ArxModel { input: [InputOrders { nb: 1, nk: 0 }; 4], ..model };
    assert_eq!(init(&thetahat_arx_2, at_once, usual), Error::None);
    // SAFETY: all pointers are valid.
    unsafe {
        assert_eq!(thetahat_arx_measured(arx, 1.0, null_mut()), Error::InputFirst);
        assert_eq!(thetahat_arx_log_row(arx, 1.0, ONES.as_ptr(), 2, null_mut()), Error::Length);
        assert_eq!(thetahat_arx_log_row(arx, 1.0, ONES.as_ptr(), 1, null_mut()), Error::None);
        assert_eq!(thetahat_arx_applied(arx, null(), 1), Error::NullPointer);
        assert_eq!(thetahat_arx_applied(arx, ONES.as_ptr(), usize::MAX / 2), Error::Length);
    }
}

#[test]
fn a_fit_is_checked_and_taken_whole() {
    let (mut memory, mut arx) = (Memory::new(), null_mut());
    let model = ArxModel { inputs: 0, nc: 1, ..FIRST_ORDER };
    let start = memory.start();
    // SAFETY: all pointers are valid.
    let code =
        unsafe { thetahat_arx_init(&raw mut arx, start, Memory::BYTES, &thetahat_armax_2, &model, null()) };
    assert_eq!(code, Error::None);
    let set = |parameters: [Number; 2], factor: [Number; 4], variance, samples| {
        // SAFETY: all pointers are valid.
        unsafe { thetahat_arx_set_fit(arx, parameters.as_ptr(), factor.as_ptr(), variance, samples) }
    };
    let (good, factor) = ([-0.5, 0.25], [2.0, 0.5, 0.0, 1.0]);
    let before = memory.0;
    // SAFETY: pointers are null or valid.
    unsafe {
        assert_eq!(
            thetahat_arx_set_fit(null_mut(), ONES.as_ptr(), ONES.as_ptr(), 1.0, 3),
            Error::NullPointer
        );
        assert_eq!(thetahat_arx_set_fit(arx, null(), ONES.as_ptr(), 1.0, 3), Error::NullPointer);
        assert_eq!(thetahat_arx_set_fit(arx, ONES.as_ptr(), null(), 1.0, 3), Error::NullPointer);
    }
    assert_eq!(set([Number::NAN, 0.0], factor, 1.0, 3), Error::NotFinite);
    assert_eq!(set([-0.5, 1.5], factor, 1.0, 3), Error::OutOfRange);
    assert_eq!(set([Number::MAX, 0.0], factor, 1.0, 3), Error::TooLarge);
    assert_eq!(set(good, [Number::INFINITY, 0.5, 0.0, 1.0], 1.0, 3), Error::NotFinite);
    assert_eq!(set(good, [Number::MAX, 0.5, 0.0, 1.0], 1.0, 3), Error::TooLarge);
    assert_eq!(set(good, [1.0, Number::MAX, 0.0, 1.0], 1.0, 3), Error::Overflow);
    assert_eq!(set(good, [2.0, 0.5, 0.5, 1.0], 1.0, 3), Error::OutOfRange);
    assert_eq!(set(good, [-2.0, 0.5, 0.0, 1.0], 1.0, 3), Error::Negative);
    for variance in [-1.0, Number::NAN, Number::INFINITY] {
        assert_eq!(set(good, factor, variance, 3), Error::OutOfRange);
    }
    assert_eq!(set(good, factor, 1.0, 2), Error::OutOfRange);
    assert_eq!(set(good, factor, 1.0, 0), Error::OutOfRange);
    assert!(memory.0 == before);
    assert_eq!(set(good, factor, 0.5, 4), Error::None);
    let (mut parameters, mut errors, mut variance, mut covariance) = ([0.0; 2], [0.0; 2], 0.0, [0.0; 4]);
    // SAFETY: all pointers are valid.
    unsafe {
        let code =
            thetahat_arx_parameters(arx, parameters.as_mut_ptr(), errors.as_mut_ptr(), &raw mut variance);
        assert_eq!(code, Error::None);
        assert_eq!(thetahat_arx_covariance(arx, covariance.as_mut_ptr()), Error::None);
    }
    // U D U' of U = (1 0.5; 0 1) and D = (2, 1).
    assert_eq!((parameters, variance, covariance), (good, 0.5, [2.25, 0.5, 0.5, 1.0]));
    assert_eq!(errors[1], Number::sqrt(0.5));
}

#[test]
fn a_filter_asks_for_its_model_and_checks_it() {
    let (mut memory, mut kalman) = (Memory::new(), null_mut());
    let (start, bytes, ones) = (memory.start(), Memory::BYTES, ONES.as_ptr());
    let (identity, indefinite, skew) = ([1.0, 0.0, 0.0, 1.0], [1.0, 2.0, 2.0, 1.0], [1.0, 0.5, 0.0, 1.0]);
    // SAFETY: pointers are null or valid.
    unsafe {
        let init = |kalman, prior: &[Number; 4]| {
            thetahat_kalman_init(kalman, start, bytes, &thetahat_kalman_2_1, ones, prior.as_ptr())
        };
        assert_eq!(init(&raw mut kalman, &indefinite), Error::NotPositive);
        assert_eq!(init(&raw mut kalman, &skew), Error::NotSymmetric);
        assert_eq!(init(&raw mut kalman, &[Number::NAN; 4]), Error::NotFinite);
        assert_eq!(init(&raw mut kalman, &identity), Error::None);
        let matrix = identity.as_ptr();
        assert_eq!(thetahat_kalman_predict(kalman, null()), Error::NoModel);
        assert_eq!(thetahat_kalman_correct(kalman, null(), ones, null_mut()), Error::NoModel);
        assert_eq!(thetahat_kalman_set_transition(kalman, matrix, ones, 5, matrix), Error::Length);
        assert_eq!(thetahat_kalman_set_transition(kalman, null(), ones, 1, matrix), Error::NullPointer);
        assert_eq!(
            thetahat_kalman_set_transition(kalman, matrix, ones, 1, skew.as_ptr()),
            Error::NotSymmetric
        );
        assert_eq!(thetahat_kalman_predict(kalman, null()), Error::NoModel);
        assert_eq!(thetahat_kalman_set_transition(kalman, matrix, ones, 1, matrix), Error::None);
        assert_eq!(thetahat_kalman_set_observation(kalman, ones, null(), null()), Error::None);
        assert_eq!(thetahat_kalman_predict(kalman, null()), Error::NullPointer);
        assert_eq!(thetahat_kalman_predict(kalman, [Number::NAN].as_ptr()), Error::NotFinite);
        assert_eq!(thetahat_kalman_predict(kalman, ones), Error::None);
        assert_eq!(
            thetahat_kalman_correct(kalman, ones, [Number::INFINITY].as_ptr(), null_mut()),
            Error::Infinite
        );
        assert_eq!(thetahat_kalman_correct(kalman, ones, ones, null_mut()), Error::None);
        assert_eq!(thetahat_kalman_set_gate(kalman, 0.0, 0), Error::OutOfRange);
        assert_eq!(thetahat_kalman_set_gate(kalman, 9.0, 65_536), Error::OutOfRange);
        assert_eq!(thetahat_kalman_set_gate(kalman, 9.0, 5), Error::None);
    }
}

#[test]
fn what_is_set_while_it_runs_is_set_or_changes_nothing() {
    let (identity, indefinite) = ([1.0, 0.0, 0.0, 1.0], [1.0, 2.0, 2.0, 1.0]);
    let (zeros, not_finite) = ([0.0; 2], [Number::NAN; 2]);
    let mut found = [0.0; 4];
    macro_rules! check_filter {
        ($init:ident, $size:ident, $set_state:ident, $set_covariance:ident, $widen:ident, $state:ident, $covariance:ident) => {
            let (mut memory, mut filter) = (Memory::new(), null_mut());
            // SAFETY: pointers are null or valid.
            unsafe {
                let (start, prior) = (memory.start(), identity.as_ptr());
                let code = $init(&raw mut filter, start, Memory::BYTES, &$size, zeros.as_ptr(), prior);
                assert_eq!(code, Error::None);
                let before = memory.0;
                assert_eq!($set_state(filter, null()), Error::NullPointer);
                assert_eq!($set_state(filter, not_finite.as_ptr()), Error::NotFinite);
                assert_eq!($set_covariance(filter, indefinite.as_ptr()), Error::NotPositive);
                assert_eq!($widen(filter, 0.5), Error::OutOfRange);
                assert_eq!($widen(null_mut(), 2.0), Error::NullPointer);
                assert!(memory.0 == before);
                assert_eq!($set_state(filter, ONES.as_ptr()), Error::None);
                assert_eq!($state(filter, found.as_mut_ptr()), Error::None);
                assert_eq!(found[..2], [1.0, 1.0]);
                assert_eq!($widen(filter, 4.0), Error::None);
                assert_eq!($covariance(filter, found.as_mut_ptr()), Error::None);
                assert_eq!(found, [4.0, 0.0, 0.0, 4.0]);
                assert_eq!($set_covariance(filter, null()), Error::None);
                assert_eq!($covariance(filter, found.as_mut_ptr()), Error::None);
                assert_eq!(found, [0.0; 4]);
            }
        };
    }
    check_filter!(
        thetahat_kalman_init,
        thetahat_kalman_2_1,
        thetahat_kalman_set_state,
        thetahat_kalman_set_covariance,
        thetahat_kalman_widen,
        thetahat_kalman_state,
        thetahat_kalman_covariance
    );
    check_filter!(
        thetahat_ekf_init,
        thetahat_ekf_2_1,
        thetahat_ekf_set_state,
        thetahat_ekf_set_covariance,
        thetahat_ekf_widen,
        thetahat_ekf_state,
        thetahat_ekf_covariance
    );
    check_filter!(
        thetahat_ukf_init,
        thetahat_ukf_2_1,
        thetahat_ukf_set_state,
        thetahat_ukf_set_covariance,
        thetahat_ukf_widen,
        thetahat_ukf_state,
        thetahat_ukf_covariance
    );
    let (mut memory, mut observer) = (Memory::new(), null_mut());
    let (start, zero) = (memory.start(), zeros.as_ptr());
    // SAFETY: pointers are null or valid.
    unsafe {
        let code = thetahat_luenberger_init(
            &raw mut observer,
            start,
            Memory::BYTES,
            &thetahat_luenberger_2_1,
            zero,
            null(),
        );
        assert_eq!(code, Error::None);
        assert_eq!(thetahat_luenberger_set_state(observer, not_finite.as_ptr()), Error::NotFinite);
        assert_eq!(thetahat_luenberger_set_state(observer, ONES.as_ptr()), Error::None);
        assert_eq!(thetahat_luenberger_state(observer, found.as_mut_ptr()), Error::None);
    }
    assert_eq!(found[..2], [1.0, 1.0]);
}

#[test]
fn an_estimator_is_widened_or_stays() {
    let (identity, indefinite) = ([1.0, 0.0, 0.0, 1.0], [1.0, 2.0, 2.0, 1.0]);
    let mut found = [0.0; 4];
    let mut memory = Memory::new();
    let rls = rls(&mut memory);
    let (mut second, mut arx) = (Memory::new(), null_mut());
    let start = second.start();
    // SAFETY: pointers are null or valid.
    unsafe {
        let before = memory.0;
        assert_eq!(thetahat_rls_set_covariance(rls, null()), Error::NullPointer);
        assert_eq!(thetahat_rls_set_covariance(rls, indefinite.as_ptr()), Error::NotPositive);
        assert_eq!(thetahat_rls_widen(rls, Number::NAN), Error::OutOfRange);
        assert!(memory.0 == before);
        assert_eq!(thetahat_rls_set_covariance(rls, identity.as_ptr()), Error::None);
        assert_eq!(thetahat_rls_widen(rls, 9.0), Error::None);
        assert_eq!(thetahat_rls_covariance(rls, found.as_mut_ptr()), Error::None);
        assert_eq!(found, [9.0, 0.0, 0.0, 9.0]);

        let code =
            thetahat_arx_init(&raw mut arx, start, Memory::BYTES, &thetahat_arx_2, &FIRST_ORDER, null());
        assert_eq!(code, Error::None);
        let before = second.0;
        assert_eq!(thetahat_arx_set_covariance(arx, indefinite.as_ptr()), Error::NotPositive);
        assert_eq!(thetahat_arx_widen(arx, 0.0), Error::OutOfRange);
        assert!(second.0 == before);
        assert_eq!(thetahat_arx_set_covariance(arx, identity.as_ptr()), Error::None);
        assert_eq!(thetahat_arx_widen(arx, 4.0), Error::None);
        assert_eq!(thetahat_arx_covariance(arx, found.as_mut_ptr()), Error::None);
        assert_eq!(found, [4.0, 0.0, 0.0, 4.0]);
    }
}

unsafe extern "C" fn identity(state: *const Number, value: *mut Number, _: *mut c_void) {
    // SAFETY: a filter with two states gives both.
    unsafe { value.copy_from(state, 2) };
}

unsafe extern "C" fn unit_matrix(_: *const Number, value: *mut Number, _: *mut c_void) {
    // SAFETY: a filter with two states gives four entries.
    unsafe { value.copy_from([1.0, 0.0, 0.0, 1.0].as_ptr(), 4) };
}

unsafe extern "C" fn not_a_number(_: *const Number, value: *mut Number, _: *mut c_void) {
    // SAFETY: there is at least one.
    unsafe { value.write(Number::NAN) };
}

/// Calls with the filter that called it, which is the context, and keeps the answer as the state.
unsafe extern "C" fn calls_back(_: *const Number, value: *mut Number, context: *mut c_void) {
    let mut state = [0.0; 2];
    // SAFETY: the context is the filter.
    let code = unsafe { thetahat_ekf_state(context.cast(), state.as_mut_ptr()) };
    assert_eq!(code, Error::Busy);
    // SAFETY: a filter with two states gives room for both.
    unsafe { value.copy_from([3.0, 4.0].as_ptr(), 2) };
}

#[test]
fn functions_of_the_user_are_checked_and_must_not_call_back() {
    let mut memory = Memory::new();
    let ekf = ekf(&mut memory);
    let good = Function { value: Some(identity), jacobian: Some(unit_matrix), context: null_mut() };
    // SAFETY: pointers are null or valid, and the functions write what they must.
    unsafe {
        assert_eq!(thetahat_ekf_predict(ekf, null()), Error::NullPointer);
        assert_eq!(thetahat_ekf_predict(ekf, &Function { value: None, ..good }), Error::NullPointer);
        let before = memory.0;
        let unknown = Function { value: Some(not_a_number), ..good };
        assert_eq!(thetahat_ekf_predict(ekf, &unknown), Error::NotFinite);
        assert_eq!(thetahat_ekf_correct(ekf, &unknown, ONES.as_ptr(), null_mut()), Error::NotFinite);
        assert!(memory.0 == before);
        let recursive = Function { value: Some(calls_back), context: ekf.cast(), ..good };
        assert_eq!(thetahat_ekf_predict(ekf, &recursive), Error::None);
        let mut state = [0.0; 2];
        assert_eq!(thetahat_ekf_state(ekf, state.as_mut_ptr()), Error::None);
        assert_eq!(state, [3.0, 4.0]);
        assert_eq!(thetahat_ekf_predict(ekf, &good), Error::None);
        assert_eq!(thetahat_ekf_set_iterations(ekf, 0), Error::OutOfRange);
    }
}

#[test]
fn an_unscented_filter_needs_no_jacobian() {
    let (mut memory, mut ukf, mut found) = (Memory::new(), null_mut(), [0.0; 4]);
    let (start, size) = (memory.start(), &thetahat_ukf_2_1);
    let model = Function { value: Some(identity), jacobian: None, context: null_mut() };
    // SAFETY: pointers are null or valid, and the functions write what they must.
    unsafe {
        let code = thetahat_ukf_init(&raw mut ukf, start, Memory::BYTES, size, ONES.as_ptr(), null());
        assert_eq!(code, Error::None);
        assert_eq!(thetahat_ukf_set_noise(ukf, [1.0, 0.0, 0.0, 4.0].as_ptr(), ONES.as_ptr()), Error::None);
        let before = memory.0;
        let unknown = Function { value: Some(not_a_number), ..model };
        assert_eq!(thetahat_ukf_predict(ukf, &unknown), Error::NotFinite);
        assert_eq!(thetahat_ukf_correct(ukf, &unknown, ONES.as_ptr(), null_mut()), Error::NotFinite);
        assert_eq!(thetahat_ukf_set_spread(ukf, 0.5), Error::OutOfRange);
        assert!(memory.0 == before);
        assert_eq!(thetahat_ukf_set_spread(ukf, 2.0), Error::None);
        assert_eq!(thetahat_ukf_predict(ukf, &model), Error::None);
        assert_eq!(thetahat_ukf_covariance(ukf, found.as_mut_ptr()), Error::None);
    }
    assert_eq!(found, [1.0, 0.0, 0.0, 4.0], "P = Q a step after a known state");
}

#[test]
fn observers_detectors_and_controllers_check_what_they_get() {
    let mut memory = Memory::new();
    let (start, bytes, ones) = (memory.start(), Memory::BYTES, ONES.as_ptr());
    let (mut observer, mut detector, mut rst) = (null_mut(), null_mut(), null_mut());
    // SAFETY: pointers are null or valid.
    unsafe {
        let size = &thetahat_luenberger_2_1;
        assert_eq!(
            thetahat_luenberger_init(&raw mut observer, start, bytes, size, ones, null()),
            Error::None
        );
        assert_eq!(thetahat_luenberger_place(observer, ones, ones, null()), Error::NoModel);
        let (unit, none, half) = ([1.0, 0.0, 0.0, 1.0], [0.0; 2], [0.5; 2]);
        assert_eq!(thetahat_luenberger_set_transition(observer, unit.as_ptr(), null(), 0), Error::None);
        assert_eq!(thetahat_luenberger_set_observation(observer, ones, null()), Error::None);
        assert_eq!(thetahat_luenberger_place(observer, ones, none.as_ptr(), null()), Error::OutOfRange);
        let unseen = thetahat_luenberger_place(observer, half.as_ptr(), none.as_ptr(), null());
        assert_eq!(unseen, Error::NotObservable);

        assert_eq!(thetahat_detector_init(&raw mut detector, start, bytes, 0.0, 1.0), Error::OutOfRange);
        assert_eq!(thetahat_detector_init(&raw mut detector, start, bytes, 4.0, 4.0), Error::None);
        let mut innovation =
            Innovation { error: [1.0; 3], variance: [1.0; 3], nis: 3.0, outputs: 0, action: 0 };
        let mut alarm = Alarm { chart: 9, samples: 9, statistic: 9.0 };
        for outputs in [0, 4] {
            innovation.outputs = outputs;
            assert_eq!(thetahat_detector_update(detector, &innovation, &mut alarm), Error::Length);
        }
        assert_eq!(alarm.chart, 9);
        for outputs in [1, 2, 3] {
            innovation.outputs = outputs;
            assert_eq!(thetahat_detector_update(detector, &innovation, &mut alarm), Error::None);
            assert_eq!(alarm.chart, Chart::None as i32);
        }

        let size = &thetahat_rst_2;
        let law = RstLaw { gain: 1.0, r: [0.0; 12], s: [0.0; 12], observer: [0.0; 12] };
        let unknown = RstLaw { gain: Number::NAN, ..law };
        assert_eq!(thetahat_rst_init(&raw mut rst, start, bytes, size, &unknown), Error::NotFinite);
        assert_eq!(thetahat_rst_init(&raw mut rst, start, bytes, size, &law), Error::None);
        assert_eq!(thetahat_rst_set_limits(rst, 1.0, 0.0), Error::OutOfRange);
        assert_eq!(thetahat_rst_control(rst, 1.0, 1.0, null_mut()), Error::NullPointer);
    }
}

/// A filter of two states and one output, which starts at 0.
fn kalman(memory: &mut Memory) -> *mut Kalman {
    let (mut kalman, zeros) = (null_mut(), [0.0; 2]);
    let (start, bytes, ones) = (memory.start(), Memory::BYTES, [1.0, 0.0, 0.0, 1.0]);
    let size = &raw const thetahat_kalman_2_1;
    // SAFETY: all is as the interface asks for.
    let code =
        unsafe { thetahat_kalman_init(&raw mut kalman, start, bytes, size, zeros.as_ptr(), ones.as_ptr()) };
    assert_eq!(code, Error::None);
    kalman
}

#[test]
fn a_direct_term_belongs_to_the_inputs_of_the_transition() {
    let (unit, nothing, direct) = ([1.0, 0.0, 0.0, 1.0], [0.0; 8], [2.0, 3.0]);
    let (f, g, h, d, r) = (unit.as_ptr(), nothing.as_ptr(), unit.as_ptr(), direct.as_ptr(), unit.as_ptr());
    let mut memory = Memory::new();
    let filter = kalman(&mut memory);
    let mut innovation = core::mem::MaybeUninit::<Innovation>::uninit();
    let told = innovation.as_mut_ptr();
    // SAFETY: pointers are null or valid; the innovation is read after it was written.
    unsafe {
        // The transition, which says how many inputs there are, is not there yet, or has none.
        let before = memory.0;
        assert_eq!(thetahat_kalman_set_observation(filter, h, d, r), Error::Inputs);
        assert!(memory.0 == before);
        assert_eq!(thetahat_kalman_set_transition(filter, f, null(), 0, null()), Error::None);
        assert_eq!(thetahat_kalman_set_observation(filter, h, d, r), Error::Inputs);
        assert_eq!(thetahat_kalman_set_observation(filter, h, null(), r), Error::None);
        assert_eq!(thetahat_kalman_set_transition(filter, f, g, 1, null()), Error::None);
        assert_eq!(thetahat_kalman_set_observation(filter, h, d, r), Error::None);
        // y = D u, so that there is nothing new; it stays so while D does.
        let (u, y) = ([10.0, 7.0], [20.0]);
        for transition in 0..2 {
            assert_eq!(thetahat_kalman_correct(filter, u.as_ptr(), y.as_ptr(), told), Error::None);
            assert_eq!((*told).error[0], 0.0, "{transition}");
            let before = memory.0;
            for inputs in [0, 2, 3] {
                assert_eq!(thetahat_kalman_set_transition(filter, f, g, inputs, null()), Error::Inputs);
            }
            assert!(memory.0 == before);
            assert_eq!(thetahat_kalman_set_transition(filter, f, g, 1, null()), Error::None);
        }
        // Without D the number may change, and D is set for the new one.
        assert_eq!(thetahat_kalman_set_observation(filter, h, null(), r), Error::None);
        assert_eq!(thetahat_kalman_set_transition(filter, f, g, 2, null()), Error::None);
        assert_eq!(thetahat_kalman_set_observation(filter, h, d, r), Error::None);
        assert_eq!(thetahat_kalman_correct(filter, u.as_ptr(), [41.0].as_ptr(), told), Error::None);
        assert_eq!((*told).error[0], 0.0);

        let (mut observer, size) = (null_mut(), &raw const thetahat_luenberger_2_1);
        let (start, bytes) = (memory.start(), Memory::BYTES);
        assert_eq!(thetahat_luenberger_init(&raw mut observer, start, bytes, size, g, null()), Error::None);
        assert_eq!(thetahat_luenberger_set_observation(observer, h, d), Error::Inputs);
        assert_eq!(thetahat_luenberger_set_transition(observer, f, g, 1), Error::None);
        assert_eq!(thetahat_luenberger_set_observation(observer, h, d), Error::None);
        assert_eq!(thetahat_luenberger_set_transition(observer, f, g, 2), Error::Inputs);
        assert_eq!(thetahat_luenberger_update(observer, u.as_ptr(), y.as_ptr(), told), Error::None);
        assert_eq!((*told).error[0], 0.0);
    }
    let said = text(thetahat_error_text(Error::Inputs as i32));
    assert!(said.contains("set the transition first, then the observation with its D; before the"), "{said}");
}

#[test]
fn a_tuner_checks_what_it_is_asked_for() {
    let (mut memory, mut tuner) = (Memory::new(), null_mut());
    let (start, bytes) = (memory.start(), Memory::BYTES);
    let mut wish = core::mem::MaybeUninit::<TunerWish>::uninit();
    // SAFETY: all pointers are valid; the wish is read after it was written.
    let usual = unsafe {
        assert_eq!(thetahat_tuner_usual(null_mut(), 1.0, 1.0, -1.0, 1.0), Error::NullPointer);
        assert_eq!(thetahat_tuner_usual(wish.as_mut_ptr(), 1.0, 1.0, 2.0, 9.0), Error::None);
        wish.assume_init()
    };
    assert_eq!((usual.first_input, usual.gain_sign, usual.longest_gap), (2.0, 0.0, 100));
    let mut init = |wish: TunerWish| {
        // SAFETY: all pointers are valid.
        unsafe {
            let size = &raw const thetahat_indirect_1_1;
            thetahat_tuner_init(&raw mut tuner, start, bytes, size, &raw const wish, null())
        }
    };
    assert_eq!(init(TunerWish { highest_input: Number::NAN, ..usual }), Error::OutOfRange);
    assert_eq!(
        init(TunerWish { lowest_measurement: 1.0, highest_measurement: 0.0, ..usual }),
        Error::OutOfRange
    );
    assert_eq!(init(TunerWish { first_input: 1.0, ..usual }), Error::OutOfRange);
    assert_eq!(init(TunerWish { frequency: 0.0, ..usual }), Error::OutOfRange);
    assert_eq!(init(TunerWish { amplitude: -1.0, ..usual }), Error::OutOfRange);
    assert_eq!(init(TunerWish { longest_gap: 65_536, ..usual }), Error::OutOfRange);
    assert_eq!(init(TunerWish { fallback: 3, ..usual }), Error::OutOfRange);
    assert_eq!(init(TunerWish { fallback: 2, fallback_input: Number::NAN, ..usual }), Error::OutOfRange);
    assert_eq!(init(TunerWish { refused: 65_536, ..usual }), Error::OutOfRange);
    assert_eq!(init(TunerWish { innovations: 0.5, ..usual }), Error::OutOfRange);
    assert_eq!(init(TunerWish { output_scale: 0.0, ..usual }), Error::OutOfRange);
    assert_eq!(init(usual), Error::None);
    // SAFETY: pointers are null or valid.
    unsafe {
        assert_eq!(thetahat_tuner_control(tuner, 1.0, 1.0, null_mut()), Error::NullPointer);
        assert_eq!(thetahat_tuner_probe(tuner, 2.0, 10), Error::OutOfRange);
        assert_eq!(thetahat_tuner_read(tuner, null_mut(), null_mut()), Error::None);
        assert_eq!(thetahat_tuner_trusted(tuner, null_mut(), null_mut(), null_mut()), Error::None);
        assert_eq!(thetahat_tuner_set_gain_sign(tuner, Number::NAN), Error::OutOfRange);
        assert_eq!(thetahat_tuner_set_fallback(tuner, 9, 0.0), Error::OutOfRange);
        assert_eq!(thetahat_tuner_set_fallback(tuner, Fallback::Input as i32, 2.5), Error::None);
    }
}

/// A tuner with a sign that is wrong says so, and does what was chosen for that; with another sign it controls.
#[test]
fn a_tuner_says_that_it_is_not_trusted() {
    let (mut memory, mut tuner) = (Memory::new(), null_mut());
    let (start, bytes) = (memory.start(), Memory::BYTES);
    let mut wish = core::mem::MaybeUninit::<TunerWish>::uninit();
    // SAFETY: all pointers are valid; the wish is read after it was written.
    unsafe {
        assert_eq!(thetahat_tuner_usual(wish.as_mut_ptr(), 1.0, 1.0, -4.0, 4.0), Error::None);
        let wish = TunerWish {
            frequency: 0.5,
            gain_sign: -1.0,
            fallback: Fallback::Input as i32,
            fallback_input: 1.0,
            ..wish.assume_init()
        };
        let size = &raw const thetahat_indirect_1_1;
        let made = thetahat_tuner_init(&raw mut tuner, start, bytes, size, &raw const wish, null());
        assert_eq!(made, Error::None);
        let (mut y, mut u): (Number, Number) = (0.0, 0.0);
        let (mut state, mut why, mut age) = (0, 0, 0);
        let mut told = core::mem::MaybeUninit::<Innovation>::uninit();
        for k in 0..800 {
            if k == 400 {
                assert_eq!(thetahat_tuner_set_gain_sign(tuner, 1.0), Error::None);
            }
            y = 0.75 * y + 0.5 * u + 0.01 * (k % 7) as Number;
            assert_eq!(thetahat_tuner_control(tuner, 1.0, y, &raw mut u), Error::None);
            if k == 399 {
                assert_eq!(thetahat_tuner_read(tuner, &raw mut state, null_mut()), Error::None);
                let read = thetahat_tuner_trusted(tuner, &raw mut why, told.as_mut_ptr(), &raw mut age);
                assert_eq!(read, Error::None);
                assert_eq!((state, why), (TunerState::Distrusted as i32, Distrust::Sign as i32));
                assert!((u - 1.0).abs() < 0.11 && age == 400 && told.assume_init().outputs == 1);
            }
        }
        assert_eq!(thetahat_tuner_trusted(tuner, &raw mut why, null_mut(), &raw mut age), Error::None);
        assert_eq!((why, age), (Distrust::None as i32, 0));
        assert!((y - 1.0).abs() < 0.2, "{y}");
        assert_eq!(thetahat_tuner_trust(tuner), Error::None);
        assert_eq!(thetahat_tuner_trust(null_mut()), Error::NullPointer);
    }
}
