//! The joint driver's own board: STM32G474RE at 170 MHz.
//!
//! ```text
//! priority   interrupt       does
//! 15         ADC1_2          the current loop, 20 kHz: counts -> LoopTask -> duties. Logs nothing, locks nothing
//!  8         FDCAN1_IT0      received frames -> queue
//!  4         TIM5            embassy's clock, microseconds
//!  idle      -               the driver: frames, objects, supervisor, slow sensors, flash, watchdog
//! ```
//! Between them go queues of whole values; nothing is shared and nothing is locked. The loop's state lies in
//! CCM, which the core reaches without waiting and nobody else does. Pins are in [`pins`], numbers of the
//! board's parts in [`scales`]. None of this has run on hardware yet; see docs/porting.md.

#![allow(unsafe_code)] // What RTIC's app expands to, embassy's bindings, and one exception.
#![allow(missing_docs)] // What RTIC generates.

mod can;
mod flash;
mod pins;
mod power_stage;
mod scales;
mod slow;
mod start;
mod watchdog;

use defmt_rtt as _;

defmt::timestamp!("{=u64:us}", embassy_time::Instant::now().as_micros());

/// Raised by flash whose check bits do not fit, and by nothing else that is in use here.
///
/// # Safety
/// Called by the processor alone.
#[cortex_m_rt::exception]
unsafe fn NonMaskableInt() {
    if !flash::ecc_error() {
        firmware::panic::keep_and_reset(&"flash: check bits do not fit in the image");
    }
}

/// An interrupt nobody waits for is a mistake of the firmware's own.
///
/// # Safety
/// Called by the processor alone.
#[cortex_m_rt::exception]
unsafe fn DefaultHandler(number: i16) -> ! {
    firmware::panic::keep_and_reset(&format_args!("interrupt {number} is nobody's"))
}

#[rtic::app(device = embassy_stm32, peripherals = false)]
mod app {
    use super::can::{self, Controller};
    use super::flash::StoreFlash;
    use super::power_stage::{self, Stage};
    use super::slow::SlowSensors;
    use super::{pins, scales, start, watchdog};
    use compensator_core::can::Frame;
    use cortex_m::peripheral::DWT;
    use embassy_stm32::gpio::{Level, Output, Pull, Speed};
    use embassy_stm32::interrupt::{InterruptExt, Priority};
    use embassy_stm32::mode::Blocking;
    use embassy_stm32::spi::mode::Master;
    use embassy_stm32::spi::{self, Spi};
    use embassy_time::Instant;
    use embedded_hal::delay::DelayNs;
    use embedded_hal_bus::spi::ExclusiveDevice;
    use firmware::control::PERIOD_S;
    use firmware::control::{Bridge, encoder_angle};
    use firmware::driver::{Boot, Driver, Identity, LoopOrders, LoopReport};
    use firmware::loop_task::{LoopLink, LoopTask, Parts};
    use firmware::sensors::Local as Sensed;
    use firmware::sensors::as504x::{ANGLE_BITS, As504x};
    use firmware::sensors::shunt::{OFFSET_SAMPLES, OffsetFinder, Shunt};
    use firmware::set::ParameterSet;
    use firmware::settings::Settings;
    use firmware::{panic, stack_guard};
    use heapless::spsc::{Consumer, Producer, Queue};

    /// Time between two ticks of the driver, us.
    const TICK_US: u64 = 1000;
    /// How long what is said last may take to be sent before a reset, us.
    const FAREWELL_US: u64 = 20_000;
    /// Received frames that wait: the background may be away for a transfer on the sensor bus, 1 ms.
    const FRAMES: usize = 64;
    /// Periods the gate driver's amplifiers have to wake up, 5 ms.
    const WAKING: u32 = 100;

    type Encoder = As504x<ExclusiveDevice<Spi<'static, Blocking, Master>, Output<'static>, Cycles>>;

    /// Waits by counting cycles.
    pub struct Cycles;

    impl DelayNs for Cycles {
        fn delay_ns(&mut self, ns: u32) {
            cortex_m::asm::delay(ns.saturating_mul(scales::CORE_HZ / 10_000_000) / 100);
        }
    }

    #[shared]
    struct Shared {}

    #[local]
    struct Local {
        // The loop's.
        #[unsafe(link_section = ".ccm.task")]
        task: LoopTask,
        stage: Stage,
        encoder: Encoder,
        shunts: [Option<Shunt>; 2],
        orders_in: Consumer<'static, LoopOrders>,
        parts_in: Consumer<'static, Parts>,
        reports_out: Producer<'static, LoopReport>,
        // The receive interrupt's.
        frames_out: Producer<'static, Frame>,
        // The background's.
        driver: Driver<StoreFlash>,
        controller: Controller,
        slow: SlowSensors,
        frames_in: Consumer<'static, Frame>,
        reports_in: Consumer<'static, LoopReport>,
        orders_out: Producer<'static, LoopOrders>,
        parts_out: Producer<'static, Parts>,
    }

    #[init(local = [
        frames: Queue<Frame, FRAMES> = Queue::new(),
        orders: Queue<LoopOrders, 4> = Queue::new(),
        parts: Queue<Parts, 2> = Queue::new(),
        reports: Queue<LoopReport, 4> = Queue::new(),
    ])]
    fn init(mut context: init::Context) -> (Shared, Local) {
        let stack_overflowed = stack_guard::take_overflow();
        stack_guard::paint();
        let panicked = panic::take();
        let cause = start::reset_cause();
        let wired = pins::wiring(embassy_stm32::init(start::clocks()));
        // All that follows takes 30 ms, and from then on it is fed.
        watchdog::start(wired.inside.watchdog);
        // embassy leaves it at the highest priority, beside the loop.
        embassy_stm32::interrupt::TIM5.set_priority(Priority::P12);
        context.core.DCB.enable_trace();
        context.core.DWT.enable_cycle_counter();

        let mut stage = Stage::new(wired.bridge, wired.currents);
        let duties_in_time = stage.start();
        let shunts = find_offsets(&mut stage);
        let self_test_passed = duties_in_time && shunts.iter().all(Option::is_some);

        let now_us = Instant::now().as_micros();
        let identity = Identity { hardware: "STM32G474 joint driver", serial: start::serial() };
        let boot = Boot { cause, panic: panicked.as_deref(), stack_overflowed, self_test_passed };
        let store = StoreFlash::new(wired.inside.flash);
        let driver = Driver::boot(Settings::default(), store, identity, &boot, now_us);
        let task = LoopTask::new(first_parts(driver.set()), scales::LIMITS);
        let controller = Controller::start(wired.can, driver.node());
        let slow = SlowSensors::new(wired.slow, wired.pressure);
        let encoder = encoder(wired.encoder);

        let (frames_out, frames_in) = context.local.frames.split();
        let (orders_out, orders_in) = context.local.orders.split();
        let (parts_out, parts_in) = context.local.parts.split();
        let (reports_out, reports_in) = context.local.reports.split();
        let local = Local {
            task,
            stage,
            encoder,
            shunts,
            orders_in,
            parts_in,
            reports_out,
            frames_out,
            driver,
            controller,
            slow,
            frames_in,
            reports_in,
            orders_out,
            parts_out,
        };
        (Shared {}, local)
    }

    /// Amplifiers' offsets: the bridge is off, so what is measured is no current.
    fn find_offsets(stage: &mut Stage) -> [Option<Shunt>; 2] {
        let mut finders = [OffsetFinder::default(); 2];
        for _ in 0..WAKING {
            stage.wait();
        }
        for _ in 0..OFFSET_SAMPLES {
            let counts = stage.wait();
            for (finder, counts) in finders.iter_mut().zip([counts.phase_a, counts.phase_b]) {
                finder.take(counts);
            }
        }
        // The fault a gate driver shows while it wakes is forgotten.
        stage.off();
        finders.map(|finder| finder.shunt(scales::AMPERES_PER_COUNT))
    }

    /// What the loop starts with: what is stored, or else something to measure with and never drive.
    fn first_parts(set: &ParameterSet) -> Parts {
        Parts::build(set, PERIOD_S).unwrap_or_else(|refused| {
            defmt::error!("stored parameters cannot be built: {=str}", refused.field);
            match Parts::build(&ParameterSet::default(), PERIOD_S) {
                Ok(parts) => parts.measuring_only(),
                Err(refused) => panic!("default parameters: {refused}"),
            }
        })
    }

    fn encoder(wired: pins::Encoder) -> Encoder {
        let mut config = spi::Config::default();
        config.mode = spi::MODE_1;
        config.frequency = scales::ENCODER_CLOCK;
        config.miso_pull = Pull::Up;
        let bus = Spi::new_blocking(wired.spi, wired.clock, wired.out, wired.back, config);
        let select = Output::new(wired.select, Level::High, Speed::VeryHigh);
        match ExclusiveDevice::new(bus, select, Cycles) {
            Ok(device) => As504x::new(device),
            Err(never) => match never {},
        }
    }

    /// One period of the current loop.
    #[task(binds = ADC1_2, priority = 15, local = [
        task, stage, encoder, shunts, orders_in, parts_in, reports_out,
    ])]
    fn current_loop(context: current_loop::Context) {
        let local = context.local;
        let now = DWT::cycle_count();
        let triggered = now.wrapping_sub(local.stage.since_trigger());
        if !local.stage.is_due() {
            return;
        }
        watchdog::beat();
        let counts = local.stage.counts();
        let angle = local.encoder.angle().ok();
        let angle = angle.map(|counts| encoder_angle(u32::from(counts), ANGLE_BITS));
        // Parts first: orders to drive come after those they are for.
        if let Some(parts) = local.parts_in.dequeue() {
            local.task.swap(parts);
        }
        while let Some(orders) = local.orders_in.dequeue() {
            local.task.order(orders);
        }
        let sample = power_stage::sample(counts, local.shunts, angle);
        let broke = local.stage.broke();
        match local.task.period(&sample, broke, triggered, now) {
            Bridge::Drive(duty) => local.stage.drive(duty),
            Bridge::Off => local.stage.off(),
        }
        local.task.end(DWT::cycle_count());
        if let Some(report) = local.task.report()
            && local.reports_out.enqueue(report).is_ok()
        {
            local.task.reported();
        }
    }

    /// Frames off the controller, before it has no place for the next.
    #[task(binds = FDCAN1_IT0, priority = 8, local = [frames_out])]
    fn receive(context: receive::Context) {
        let queue = context.local.frames_out;
        can::receive(|frame| {
            if queue.enqueue(frame).is_err() {
                can::count_lost();
            }
        });
    }

    /// Everything that has time.
    #[idle(local = [
        driver, controller, slow, frames_in, reports_in, orders_out, parts_out,
    ])]
    fn idle(context: idle::Context) -> ! {
        let idle::LocalResources {
            driver,
            controller,
            slow,
            frames_in,
            reports_in,
            orders_out,
            parts_out,
            ..
        } = context.local;
        let mut due_us = Instant::now().as_micros();
        let mut link = LoopLink::new(due_us);
        let mut sensed = Sensed::default();
        loop {
            let now_us = Instant::now().as_micros();
            while let Some(frame) = frames_in.dequeue() {
                driver.receive(&frame, now_us);
                send(driver, controller);
            }
            if now_us >= due_us {
                // Late ticks are not made up for.
                due_us = (due_us + TICK_US).max(now_us);
                slow.poll(&mut sensed, now_us);
                let [bridge_c, motor_c] = slow.temperatures_c();
                let mut tell = |report: LoopReport| {
                    driver.report(&LoopReport {
                        bridge_temperature_c: Some(bridge_c),
                        motor_temperature_c: Some(motor_c),
                        stack_intact: stack_guard::is_intact(),
                        ..report
                    });
                };
                match reports_in.dequeue() {
                    Some(report) => {
                        tell(link.hear(report, now_us));
                        while let Some(report) = reports_in.dequeue() {
                            tell(link.hear(report, now_us));
                        }
                    }
                    None => tell(link.silence(now_us)),
                }
                driver.bus_state(controller.take_overrun(), controller.state());
                driver.tick(now_us);
                order(driver, &sensed, &mut link, now_us, parts_out, orders_out);
                if link.is_alive(now_us) {
                    watchdog::feed();
                }
            }
            send(driver, controller);
            if driver.reset_wanted() {
                restart(driver, controller);
            }
            cortex_m::asm::wfi();
        }
    }

    /// Orders for the loop, and parts where the parameters have changed.
    fn order(
        driver: &Driver<StoreFlash>,
        sensed: &Sensed,
        link: &mut LoopLink,
        now_us: u64,
        parts_out: &mut Producer<'static, Parts>,
        orders_out: &mut Producer<'static, LoopOrders>,
    ) {
        let mut orders = driver.orders(now_us);
        sensed.complete(&mut orders.covariates, now_us);
        if !parts_out.ready() {
            // The loop has not taken the last parts: it does not run, and orders would be for the old ones.
            return;
        }
        if link.wants_parts(&orders) {
            match Parts::build(driver.set(), PERIOD_S) {
                Ok(parts) => drop(parts_out.enqueue(parts)),
                // The driver built them before it took them: a mistake of the firmware's own.
                Err(refused) => panic!("committed parameters: {refused}"),
            }
        }
        // A full queue is a loop that does not run; its set-point grows old there.
        let _ = orders_out.enqueue(orders);
    }

    fn send(driver: &mut Driver<StoreFlash>, controller: &mut Controller) {
        while controller.has_room() {
            match driver.transmit() {
                Some(frame) => controller.send(&frame),
                None => return,
            }
        }
    }

    /// Sends what is still to be said, and resets. The reset opens the bridge.
    fn restart(driver: &mut Driver<StoreFlash>, controller: &mut Controller) -> ! {
        let until = Instant::now().as_micros() + FAREWELL_US;
        while Instant::now().as_micros() < until {
            send(driver, controller);
            if controller.is_idle() {
                break;
            }
        }
        cortex_m::peripheral::SCB::sys_reset()
    }
}
