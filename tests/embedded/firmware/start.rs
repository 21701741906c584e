//! From power-up to `main`. The image brings `main`, and `fault` for what the processor cannot go on from.
#![expect(
    unsafe_code,
    reason = "the processor looks for the table at address 4, and `reset` is all assembly"
)]

use core::arch::naked_asm;

/// What follows the first stack pointer: where the processor goes on reset, and on its first five faults.
#[unsafe(link_section = ".vectors")]
#[used]
static VECTORS: [unsafe extern "C" fn() -> !; 6] =
    [reset, crate::fault, crate::fault, crate::fault, crate::fault, crate::fault];

/// Turns the floating-point unit on: it is coprocessors 10 and 11 in the register CPACR.
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn reset() -> ! {
    naked_asm!(
        "ldr r0, =0xe000ed88",
        "ldr r1, [r0]",
        "orr r1, r1, #0xf00000",
        "str r1, [r0]",
        "dsb",
        "isb",
        "b {main}",
        main = sym crate::main,
    )
}
