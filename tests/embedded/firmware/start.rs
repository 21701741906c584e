//! From power-up to `main`. The module above brings `main`, and `fault` for what the processor cannot go on from.
#![expect(unsafe_code, reason = "a processor looks for the table at address 4, and `reset` is all assembly")]

use core::arch::naked_asm;

/// What follows the first stack pointer: where an Arm processor goes on reset, and on its first five faults.
#[cfg(target_arch = "arm")]
#[unsafe(link_section = ".vectors")]
#[used]
static VECTORS: [unsafe extern "C" fn() -> !; 6] =
    [reset, super::fault, super::fault, super::fault, super::fault, super::fault];

/// Turns the floating-point unit on: it is coprocessors 10 and 11 in the register CPACR.
#[cfg(target_abi = "eabihf")]
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
        main = sym super::main,
    )
}

/// A Cortex-M0+ has nothing to turn on.
#[cfg(all(target_arch = "arm", not(target_abi = "eabihf")))]
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn reset() -> ! {
    naked_asm!("bl {main}", main = sym super::main)
}

/// A RISC-V processor does not load its stack pointer.
#[cfg(target_arch = "riscv32")]
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn reset() -> ! {
    naked_asm!("la sp, stack", "j {main}", main = sym super::main)
}
