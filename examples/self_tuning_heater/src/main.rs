#![no_std]
#![no_main]
//! A heater that learns its plant and designs its controller for it. One task samples and controls, the other one
//! changes the set point and evaluates the temperature.

mod clock;
mod heater;

use cortex_m_semihosting::debug::{self, EXIT_SUCCESS};
use cortex_m_semihosting::hprintln;
use embassy_executor::Spawner;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Instant, Ticker, Timer};
use panic_semihosting as _;
use thetahat_core::nalgebra::Const;
use thetahat_core::{Error, Forgetting, IndirectSelfTuner, ResponseWanted, TunerOrders, TunerSettings};

use crate::heater::Heater;

/// Second order with up to three samples of dead time, losses that are not known, and a controller that integrates.
const ORDERS: TunerOrders = TunerOrders { na: 2, nb: 5, nc: 0, constant: true, integrator: true };
type Tuner = IndirectSelfTuner<f32, Const<{ ORDERS.parameters() }>, Const<{ ORDERS.size() }>>;

const PERIOD: Duration = Duration::from_secs(2);

/// In °C, one after the other. After `SETTLES` the temperature is within `BOUND` K of each, for `EVALUATED` samples.
const SET_POINTS: [f32; 6] = [60.0, 80.0, 65.0, 75.0, 55.0, 70.0];
const SETTLES: Duration = Duration::from_secs(300);
const BOUND: f32 = 0.5;
const EVALUATED: u32 = 50;

type Latest<T> = Signal<CriticalSectionRawMutex, T>;
static SET_POINT: Latest<f32> = Signal::new();
/// The temperature in °C, and the power in %.
static SAMPLE: Latest<(f32, f32)> = Signal::new();

fn tuner() -> Result<Tuner, Error> {
    // Frequencies in rad per sample: settled about 50 samples after a step.
    let response = ResponseWanted { frequency: 0.15, damping: 0.9, observer: 0.3 };
    // More power makes it warmer. It starts with 30 %, and tries out what a few per cent more or less do.
    let settings =
        TunerSettings { gain_sign: 1.0, input: 30.0, ..TunerSettings::new(response, 0.0..=100.0, 20.0) };
    // Temperatures are about 50 °C, changes of the power about 10 %.
    Tuner::new(&ORDERS, &settings, 50.0, 10.0, Forgetting::Exponential { factor: 0.99 })
}

/// Measures, learns, computes and applies, once in each period.
#[embassy_executor::task]
async fn control(mut tuner: Tuner, mut heater: Heater) {
    let mut set_point = SET_POINT.wait().await;
    let mut ticker = Ticker::every(PERIOD);
    loop {
        set_point = SET_POINT.try_take().unwrap_or(set_point);
        let power = tuner.control(set_point, heater.measure());
        SAMPLE.signal((heater.temperature(), power));
        heater.apply(power, PERIOD.as_secs() as f32);
        ticker.next().await;
    }
}

/// Changes the set point, and evaluates the temperature.
#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let core = cortex_m::Peripherals::take().expect("they are taken once");
    clock::start(core.SYST);
    let tuner = tuner().expect("the settings are in range");
    spawner.spawn(control(tuner, Heater::new()).expect("it is spawned once"));

    for set_point in SET_POINTS {
        SET_POINT.signal(set_point);
        Timer::after(SETTLES).await;
        let (mut worst, mut sum) = (0.0_f32, 0.0);
        for _ in 0..EVALUATED {
            let (temperature, power) = SAMPLE.wait().await;
            let deviation = (temperature - set_point).abs();
            assert!(deviation < BOUND, "{temperature:.2} °C is not within {BOUND} K of {set_point} °C");
            worst = worst.max(deviation);
            sum += power;
        }
        let (seconds, power) = (Instant::now().as_secs(), sum / EVALUATED as f32);
        hprintln!("{seconds:4} s: {set_point} °C within {worst:.2} K, at {power:.0} %");
    }
    debug::exit(EXIT_SUCCESS);
}
