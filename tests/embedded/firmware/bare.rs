#![no_std]
#![no_main]
//! Firmware that steps every estimator and reads every result. It does not link if anything in it can panic.

mod start;

use core::hint::{black_box, spin_loop};
use core::panic::PanicInfo;

use scenarios::{Scenario, Visitor, play, visit_all};

struct Steps;

impl Visitor for Steps {
    fn visit<S: Scenario>(&mut self) {
        let played = play::<S>(|_, _, scenario, input| {
            if let Ok(output) = scenario.step(black_box(input)) {
                scenario.numbers(&output, &mut |number| {
                    black_box(number);
                });
            }
        });
        black_box(played.is_ok());
    }
}

extern "C" fn main() -> ! {
    visit_all(&mut Steps);
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
