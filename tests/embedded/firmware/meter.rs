//! What a call costs: instructions by the system timer, stack by paint.

use core::arch::asm;

/// The timer's registers: control, reload value and current value.
const CONTROL: *mut u32 = 0xe000_e010 as *mut u32;
const RELOAD: *mut u32 = 0xe000_e014 as *mut u32;
const CURRENT: *mut u32 = 0xe000_e018 as *mut u32;

/// The timer counts 24 bits down, a tick every 40 ns. The emulator is told that an instruction takes 1024 ns
/// (`-icount shift=10`). So an instruction is 25.6 ticks, and the timer holds 655,360 of them.
const LARGEST: u32 = 0x00ff_ffff;

/// What is painted below the stack pointer, and how many words of it.
const PAINT: u32 = 0xdead_beef;
const PAINTED: usize = 2048;

pub(crate) struct Cost {
    /// From the call to the return, both included.
    pub(crate) instructions: u32,
    /// Bytes written below the caller's stack pointer.
    pub(crate) stack: usize,
}

pub(crate) struct Meter {
    /// The ticks between two measurements with nothing in between.
    nothing: u32,
}

impl Meter {
    pub(crate) fn new() -> Self {
        write(RELOAD, LARGEST);
        // On, by the processor's clock, without interrupts.
        write(CONTROL, 0b101);
        Meter { nothing: ticks(|| ()).1 }
    }

    /// Calls `work`.
    #[inline(never)]
    pub(crate) fn measure<A>(&self, work: impl FnOnce() -> A) -> (A, Cost) {
        let top: usize;
        #[expect(unsafe_code, reason = "it reads a register")]
        unsafe {
            asm!("mov {}, sp", out(reg) top);
        }
        // Nothing lives below the stack pointer, as no interrupt is on.
        let painted = || (0..PAINTED).map(|word| (top - 4 * (word + 1)) as *mut u32);
        painted().for_each(|word| write(word, PAINT));
        let (answer, ticks) = ticks(work);
        let stack = painted().rposition(|word| read(word) != PAINT).map_or(0, |lowest| 4 * (lowest + 1));
        (answer, Cost { instructions: self.instructions(ticks), stack })
    }

    /// The number of instructions in a loop, and what the timer makes of it.
    pub(crate) fn measure_known_loop(&self) -> (u32, u32) {
        let turns = 10_000;
        #[expect(unsafe_code, reason = "it counts a register down")]
        let ((), ticks) = ticks(|| unsafe {
            asm!("2:", "subs {0}, {0}, #1", "bne 2b", inout(reg) turns => _);
        });
        (2 * turns, self.instructions(ticks))
    }

    fn instructions(&self, ticks: u32) -> u32 {
        (ticks.saturating_sub(self.nothing) * 10 + 128) / 256
    }
}

/// The ticks that `work` takes: at most as many as the timer holds.
#[inline(always)]
fn ticks<A>(work: impl FnOnce() -> A) -> (A, u32) {
    // Any value starts the timer anew.
    write(CURRENT, 0);
    let before = read(CURRENT);
    let answer = work();
    let after = read(CURRENT);
    let wrapped = read(CONTROL) & 1 << 16 != 0;
    (answer, if wrapped { LARGEST } else { before.wrapping_sub(after) & LARGEST })
}

#[inline(always)]
fn read(register: *mut u32) -> u32 {
    #[expect(unsafe_code, reason = "the callers pass the timer's registers and unused stack")]
    unsafe {
        register.read_volatile()
    }
}

#[inline(always)]
fn write(register: *mut u32, value: u32) {
    #[expect(unsafe_code, reason = "the callers pass the timer's registers and unused stack")]
    unsafe {
        register.write_volatile(value);
    }
}
