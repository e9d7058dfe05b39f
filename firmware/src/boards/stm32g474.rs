//! The joint driver's board: STM32G474RE at 170 MHz.
//!
//! ```text
//! priority   interrupt       does
//! 15         ADC1_2          the current loop, 20 kHz: LoopTask on the motor stage. Logs nothing, locks nothing
//!  8         FDCAN1_IT0      received frames -> queue
//!  idle      -               the library's background loop: frames, supervisor, slow sensors, flash, watchdog
//! ```
//! Queues of complete values connect them; they share no state and take no lock. The code of the loop is in
//! CCM, which the core reads without wait states ([`fast_code`]), and its state in SRAM. Pins are in
//! [`pins`], the values of the board's parts in [`scales`]. This has not run on hardware yet; see docs/src/how-to/porting.md.

#![allow(unsafe_code)] // Expansion of RTIC's app, embassy's bindings, and one exception handler.
#![allow(missing_docs)] // Code that RTIC generates.

mod banks;
#[path = "stm32g4/can.rs"]
mod can;
mod can_fd;
#[path = "stm32g4/clocks.rs"]
mod clocks;
#[path = "stm32g4/comparators.rs"]
mod comparators;
#[path = "stm32g4/converters.rs"]
mod converters;
#[cfg(not(feature = "without-incremental"))]
#[path = "stm32g4/counter.rs"]
mod counter;
mod encoder;
mod fast_code;
#[path = "stm32g4/flash.rs"]
mod flash;
mod gate_driver;
#[cfg_attr(feature = "without-incremental", path = "stm32g474/no_incremental.rs")]
mod incremental;
#[path = "stm32g4/joint_board.rs"]
mod joint_board;
#[cfg_attr(feature = "without-joint-encoder", path = "stm32g474/no_joint_encoder.rs")]
mod joint_encoder;
#[path = "stm32g4/microseconds.rs"]
mod microseconds;
#[path = "stm32g4/motor_stage.rs"]
mod motor_stage;
mod overcurrent;
mod pins;
#[path = "stm32g4/power_stage.rs"]
mod power_stage;
#[path = "stm32g4/prefetch.rs"]
mod prefetch;
mod pressure_bus;
mod random;
#[path = "stm32g4/rates.rs"]
mod rates;
mod sampling;
mod scales;
mod slow;
#[path = "stm32g4/start.rs"]
mod start;
#[path = "stm32g4/stops.rs"]
mod stops;
#[path = "stm32g4/watchdog.rs"]
mod watchdog;

use defmt_rtt as _;

defmt::timestamp!("{=u64:us}", microseconds::now_us());

pub use power_stage::open_bridge;

/// The board and its wiring, which `host-sim sign` reads from the file of the image.
// SAFETY: the linker script keeps this section out of the flash.
#[unsafe(link_section = ".board_identity")]
#[used]
static BOARD_IDENTITY: [u32; 2] = [banks::BOARD.number, banks::BOARD.wiring];

#[rtic::app(device = embassy_stm32, peripherals = false)]
mod app {
    use super::banks::PROGRAM;
    use super::can::Controller;
    use super::encoder::{self, Encoder};
    use super::flash::ChipFlash;
    use super::joint_board::{JointBoard, Periphery, receive_frames, run_background};
    use super::joint_encoder::JointEncoder;
    use super::motor_stage::{MotorStage, measure_offsets, run_period};
    use super::power_stage::Stage;
    use super::slow::SlowSensors;
    use super::{
        can_fd, clocks, fast_code, microseconds, overcurrent, pins, power_stage, prefetch, random,
        scales, start, watchdog,
    };
    use compensator_core::can::{FdTelemetry, Frame};
    use core::mem::MaybeUninit;
    use embassy_stm32::gpio::{Flex, Pull, Speed};
    use firmware::background::{Background, BoardState};
    use firmware::driver::{Boot, Device, Driver, Identity};
    use firmware::joint_node::Equipment;
    use firmware::loop_link::{LoopPort, LoopQueues};
    use firmware::loop_task::LoopTask;
    use firmware::node_settings::{BusSettings, NodeSettings};
    use firmware::sensors::SensorParameters;
    use firmware::sensors::encoder::{EncoderKind, MotorEncoder};
    use firmware::supervisor::SelfTest;
    use heapless::spsc::{Producer, Queue};

    /// Capacity of the queue of received frames. The background may be away while it evaluates parameters or saves them.
    const RECEIVE_QUEUE_FRAMES: usize = 64;

    /// Values that the scope holds: the SRAM that statics and worst stack leave, but for 5 KB.
    const SCOPE_VALUES: usize = 6144;

    #[shared]
    struct Shared {}

    #[local]
    struct Local {
        // Owned by the current loop.
        task: LoopTask,
        stage: MotorStage,
        port: LoopPort<'static>,
        // Owned by the receive interrupt.
        frames_out: Producer<'static, Frame>,
        // Owned by the background.
        background: &'static mut Background<Device<ChipFlash>>,
        board: JointBoard<DriverPeriphery>,
    }

    #[init(local = [
        place: MaybeUninit<Background<Device<ChipFlash>>> = MaybeUninit::uninit(),
        frames: Queue<Frame, RECEIVE_QUEUE_FRAMES> = Queue::new(),
        queues: LoopQueues = LoopQueues::new(),
        scope: [f32; SCOPE_VALUES] = [0.0; SCOPE_VALUES],
    ])]
    fn init(mut context: init::Context) -> (Shared, Local) {
        let previous = start::previous_run();
        start::wait_for_crystal();
        let mut config = clocks::clocks(pins::CRYSTAL);
        // Of the converters that the other chips of the family do not have.
        config.rcc.mux.adc345sel = embassy_stm32::rcc::mux::Adcsel::SYS;
        let peripherals = embassy_stm32::init(config);
        let connections = pins::connections(&peripherals);
        let wired = pins::wiring(peripherals);
        prefetch::enable();
        fast_code::protect();
        // Refreshed after each part of the start, of which the longest, the load, takes 30 ms; then by the background.
        watchdog::start(wired.inside.watchdog);
        microseconds::start();
        context.core.DCB.enable_trace();
        context.core.DWT.enable_cycle_counter();

        let mut stage = Stage::new(wired.bridge, wired.currents, wired.overcurrent);
        // Both are triggered by the timers and therefore set up before these start.
        let mut inputs = Encoder::new(wired.encoder);
        let slow = SlowSensors::new(wired.slow, wired.pressure, wired.torque_off);
        let are_duties_at_top = stage.start();
        let shunts = measure_offsets(&mut stage);
        watchdog::refresh_if_loop_runs();
        let counts = stage.counts();
        let counts = [counts.phase_a, counts.phase_b];
        let [has_a, has_b] = shunts.each_ref().map(Option::is_some);
        let failed_comparator = overcurrent::self_test(counts, power_stage::clear_breaks);
        let failed_self_test = failed_comparator.or(SelfTest::first_failed(&[
            (SelfTest::Wiring, pins::wiring::are_connected(connections.as_ref())),
            (SelfTest::Duties, are_duties_at_top),
            (SelfTest::EncoderClock, encoder::is_set_up_correctly()),
            (SelfTest::OffsetA, has_a),
            (SelfTest::OffsetB, has_b),
        ]));
        start::check_brown_out_level();

        let boot = Boot { program: Some(PROGRAM), ..previous.boot(failed_self_test) };
        let store = ChipFlash::new(wired.inside.flash);
        let background = boot_background(context.local.place, store, &boot);
        watchdog::refresh_if_loop_runs();
        let seed = random::seed();
        background.equip(Equipment { sends_fd: true, scope: Some(context.local.scope), seed });
        let task = background.loop_task(scales::LIMITS);
        let BusSettings { node, bit_rate_kbit, data_bit_rate_kbit } = background.bus_settings();
        let values = background.start_values();
        overcurrent::follow(values.overcurrent_a);
        let controller = Controller::start(wired.can, node, bit_rate_kbit, data_bit_rate_kbit);
        let sign = values.shunt_sign;
        let shunts = shunts.map(|shunt| shunt.map(|shunt| shunt.with_sign(sign)));
        let encoder = MotorEncoder::new(values);
        let kind = values.kind();
        #[cfg(not(feature = "without-incremental"))]
        super::incremental::connect(kind, wired.incremental);
        if kind == EncoderKind::Biss {
            inputs.use_biss();
        }
        #[cfg(not(feature = "without-joint-encoder"))]
        let joint_encoder =
            values.has_joint_encoder().then(|| JointEncoder::connect(wired.joint_encoder));
        #[cfg(feature = "without-joint-encoder")]
        let joint_encoder = None;
        #[cfg(not(feature = "without-touch"))]
        let touch = Some(embassy_stm32::gpio::Input::new(wired.touch.input, Pull::Down));
        #[cfg(feature = "without-touch")]
        let touch = None;
        let stage = MotorStage { stage, encoder, inputs, shunts, touch };

        let (frames_out, frames) = context.local.frames.split();
        let now_us = microseconds::now_us();
        let (port, link) = context.local.queues.split(scales::STAGE, now_us);
        // Analog since the reset, so that it is not driven.
        let brake = Flex::new(wired.brake.output);
        let periphery = DriverPeriphery { slow, joint_encoder, brake, brake_output: None };
        let board = JointBoard { controller, frames, link, periphery };
        (Shared {}, Local { task, stage, port, frames_out, background, board })
    }

    /// Starts the driver and its background loop in place.
    fn boot_background(
        place: &'static mut MaybeUninit<Background<Device<ChipFlash>>>,
        store: ChipFlash,
        boot: &Boot<'_>,
    ) -> &'static mut Background<Device<ChipFlash>> {
        let now_us = microseconds::now_us();
        // The compiler must not know the address. Otherwise it replaces a pointer to each part of the driver by the address of
        // the whole, and the large offsets of the fields take 7 KB of flash.
        let place = core::hint::black_box(place);
        let background = place_background(place, store, now_us);
        background.load(boot, now_us);
        background
    }

    /// Creates the background loop with defaults.
    ///
    /// It is not inlined, and only then the driver loads its parameters: both a value of 14 KB and the loading take
    /// much of the stack.
    #[inline(never)]
    fn place_background(
        place: &'static mut MaybeUninit<Background<Device<ChipFlash>>>,
        store: ChipFlash,
        now_us: u64,
    ) -> &'static mut Background<Device<ChipFlash>> {
        let identity = Identity {
            hardware: "STM32G474 joint driver",
            serial: clocks::serial(),
            stage: scales::STAGE,
        };
        let driver = Driver::with_defaults(NodeSettings::default(), store, identity, now_us);
        place.write(Background::new(driver, now_us))
    }

    /// Runs one period of the current loop.
    #[task(binds = ADC1_2, priority = 15, local = [task, stage, port])]
    fn current_loop(context: current_loop::Context) {
        let local = context.local;
        run_period(local.task, local.stage, local.port);
    }

    /// Moves frames from the controller to the queue, before its FIFO is full.
    #[task(binds = FDCAN1_IT0, priority = 8, local = [frames_out])]
    fn receive(context: receive::Context) {
        receive_frames(context.local.frames_out);
    }

    /// Runs the background loop.
    #[idle(local = [background, board])]
    fn idle(context: idle::Context) -> ! {
        run_background(context.local.background, context.local.board)
    }

    /// Slow sensors and holding brake.
    pub struct DriverPeriphery {
        slow: SlowSensors,
        joint_encoder: Option<JointEncoder>,
        /// Output of the holding brake; an input until the joint has one.
        brake: Flex<'static>,
        brake_output: Option<bool>,
    }

    impl Periphery for DriverPeriphery {
        fn state(&mut self, now_us: u64) -> BoardState {
            let sensors = self.slow.poll(now_us);
            let [bridge_c, motor_c] = self.slow.temperatures_c();
            BoardState {
                bridge_temperature_c: Some(bridge_c),
                motor_temperature_c: Some(motor_c),
                sensors,
                enclosure: self.slow.enclosure(now_us),
                biss: Some(encoder::biss_words()),
                hall: super::incremental::hall_levels(),
                joint_words: self.joint_encoder.as_mut().map(JointEncoder::read),
                ..BoardState::default()
            }
        }

        fn apply_sensors(&mut self, sensors: &SensorParameters) {
            self.slow.constants = *sensors;
        }

        fn set_holding_brake(&mut self, output: Option<bool>) {
            // A change of the pin stops all interrupts for some cycles.
            if output == self.brake_output {
                return;
            }
            self.brake_output = output;
            match output {
                None => self.brake.set_as_input(Pull::None),
                Some(level) => {
                    // The level first, so that the pin does not show another one.
                    self.brake.set_level(level.into());
                    self.brake.set_as_output(Speed::Low);
                }
            }
        }

        fn read_joint_encoder(&mut self) -> bool {
            self.joint_encoder.as_mut().is_some_and(JointEncoder::start)
        }

        fn send_fd(controller: &mut Controller, frame: &FdTelemetry) {
            can_fd::send(controller, frame);
        }
    }
}
