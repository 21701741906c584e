#![no_std]
#![no_main]
//! Firmware that prints what every step answers, bit for bit, and what it cost.
//!
//! ```text
//! clock;instructions of a known loop;instructions measured
//! step;name;bytes of RAM;address;whether the worst step must cost more than the typical one
//! bits;name;case;step; the bits of each number, or an error
//! cost;name;case;step;instructions;bytes of stack
//! ```

mod host;
mod meter;
mod start;

use core::fmt::{self, Write};
use core::hint::black_box;
use core::panic::PanicInfo;

use scenarios::{Scenario, Visitor, play, visit_all, write_bits};

use crate::host::Output;
use crate::meter::Meter;

struct Report {
    output: Output,
    meter: Meter,
    result: fmt::Result,
}

impl Report {
    fn print<S: Scenario>(&mut self) -> fmt::Result {
        let Report { output, meter, .. } = self;
        let step = black_box(S::step as fn(&mut S, &S::Input) -> _);
        // The lowest bit of a function pointer says Thumb.
        writeln!(output, "step;{};{};{};{}", S::NAME, size_of::<S>(), step as usize & !1, S::DETOUR)?;
        let mut result = Ok(());
        let played = play::<S>(|case, k, scenario, input| {
            let (outcome, cost) = meter.measure(|| step(scenario, input));
            result = result.and_then(|()| write_bits(output, (case, k), scenario, &outcome)).and_then(|()| {
                writeln!(output, "cost;{};{case:?};{k};{};{}", S::NAME, cost.instructions, cost.stack)
            });
        });
        result.and_then(|()| played.map_err(|_| fmt::Error))
    }
}

impl Visitor for Report {
    fn visit<S: Scenario>(&mut self) {
        self.result = self.result.and_then(|()| self.print::<S>());
    }
}

fn report() -> fmt::Result {
    let mut report = Report { output: Output::new(), meter: Meter::new(), result: Ok(()) };
    let (known, measured) = report.meter.measure_known_loop();
    writeln!(report.output, "clock;{known};{measured}")?;
    visit_all(&mut report);
    report.output.flush();
    report.result
}

extern "C" fn main() -> ! {
    host::exit(report().is_ok())
}

extern "C" fn fault() -> ! {
    host::exit(false)
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    let mut output = Output::new();
    // If this fails too, the exit code still says that something went wrong.
    let _ = writeln!(output, "{info}");
    output.flush();
    host::exit(false)
}
