//! An image with one estimator: its set-up, then steps for ever. It does not link if anything in it can panic.

mod start;

use core::convert::Infallible;
use core::hint::{black_box, spin_loop};
use core::panic::PanicInfo;

use thetahat_core::Error;

/// A measurement, of which the compiler knows nothing.
pub(crate) fn measurement() -> f32 {
    black_box(0.0)
}

/// What the control of the plant would use.
pub(crate) fn uses<R>(result: R) {
    black_box(result);
}

/// Like most firmware, it asks whether there was an error, and not which.
extern "C" fn main() -> ! {
    let estimated: Result<Infallible, Error> = crate::estimate();
    black_box(estimated.is_err());
    fault()
}

extern "C" fn fault() -> ! {
    loop {
        spin_loop();
    }
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    #[expect(unsafe_code, reason = "nothing defines this function: a call to it cannot be linked")]
    unsafe {
        unsafe extern "C" {
            fn this_firmware_can_panic() -> !;
        }
        this_firmware_can_panic()
    }
}
