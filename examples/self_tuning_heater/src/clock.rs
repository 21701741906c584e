//! Embassy's clock on the timer that every Cortex-M has. A board's own crate (embassy-stm32, embassy-rp, …) brings a
//! better one, and this file goes.

use core::cell::{Cell, RefCell};
use core::task::Waker;

use cortex_m::peripheral::{SYST, syst::SystClkSource};
use cortex_m_rt::exception;
use embassy_sync::blocking_mutex::CriticalSectionMutex;
use embassy_time_driver::{Driver, TICK_HZ};
use embassy_time_queue_utils::Queue;

/// The processor of the emulator's machine, in Hz.
const PROCESSOR: u32 = 25_000_000;
/// How much faster the clock goes than it should: nobody waits for a simulated heater. (At twice this some samples are
/// not computed in time.)
const SPEED_UP: u32 = 500;

struct Clock {
    ticks: CriticalSectionMutex<Cell<u64>>,
    queue: CriticalSectionMutex<RefCell<Queue>>,
}

embassy_time_driver::time_driver_impl!(static CLOCK: Clock = Clock {
    ticks: CriticalSectionMutex::new(Cell::new(0)),
    queue: CriticalSectionMutex::new(RefCell::new(Queue::new())),
});

impl Driver for Clock {
    fn now(&self) -> u64 {
        self.ticks.lock(Cell::get)
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        // What has expired already is woken by the next tick.
        self.queue.lock(|queue| queue.borrow_mut().schedule_wake(at, waker));
    }
}

/// From now on time passes.
pub fn start(mut timer: SYST) {
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(PROCESSOR / TICK_HZ as u32 / SPEED_UP - 1);
    timer.clear_current();
    timer.enable_counter();
    timer.enable_interrupt();
}

#[exception]
fn SysTick() {
    let now = CLOCK.ticks.lock(|ticks| {
        ticks.set(ticks.get() + 1);
        ticks.get()
    });
    CLOCK.queue.lock(|queue| queue.borrow_mut().next_expiration(now));
}
