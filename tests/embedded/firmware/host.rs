//! The host's standard output and exit, by semihosting (Arm, Semihosting for AArch32 and AArch64).

use core::arch::asm;
use core::fmt::{self, Write};

const OPEN: usize = 0x01;
const WRITE: usize = 0x05;
const EXIT: usize = 0x18;

fn call(operation: usize, argument: *const usize) -> usize {
    let answer;
    #[expect(unsafe_code, reason = "the host reads what the callers below pass, and nothing else")]
    unsafe {
        asm!("bkpt #0xab", inout("r0") operation => answer, in("r1") argument);
    }
    answer
}

/// Ends the emulator: with exit code 0 if all is well, else with 1.
pub(crate) fn exit(well: bool) -> ! {
    let reason: usize = if well { 0x20026 } else { 0x20023 };
    loop {
        call(EXIT, reason as *const usize);
    }
}

/// The host's standard output. It collects text, for a call of the host is slow.
pub(crate) struct Output {
    file: usize,
    text: [u8; 1024],
    length: usize,
}

impl Output {
    pub(crate) fn new() -> Self {
        let (name, write) = (c":tt", 4);
        let file = call(OPEN, [name.as_ptr() as usize, write, name.count_bytes()].as_ptr());
        Output { file, text: [0; 1024], length: 0 }
    }

    pub(crate) fn flush(&mut self) {
        call(WRITE, [self.file, self.text.as_ptr() as usize, self.length].as_ptr());
        self.length = 0;
    }
}

impl Write for Output {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for &byte in text.as_bytes() {
            if self.length == self.text.len() {
                self.flush();
            }
            self.text[self.length] = byte;
            self.length += 1;
        }
        Ok(())
    }
}
