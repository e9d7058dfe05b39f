//! The B-G431B-ESC1 of STMicroelectronics as a joint driver: STM32G431CB at 170 MHz.
//!
//! ```text
//! priority   interrupt       does
//! 15         ADC1_2          the current loop, 20 kHz: LoopTask on the motor stage. Logs nothing, locks nothing
//!  8         FDCAN1_IT0      received frames -> queue
//!  idle      -               the library's background loop: frames, supervisor, flash, watchdog
//! ```
//! The whole driver does not fit, so it runs the compact node ([`firmware::compact`]). Everything executes from flash: CCM is
//! used as RAM. Pins are in [`pins`], the values of the board's parts in [`scales`]. This has not run on hardware; see
//! docs/src/how-to/b-g431b-esc1.md.

#![allow(unsafe_code)] // Expansion of RTIC's app, embassy's bindings, and one exception handler.
#![allow(missing_docs)] // Code that RTIC generates.

mod banks;
#[path = "stm32g4/can.rs"]
mod can;
#[path = "stm32g4/clocks.rs"]
mod clocks;
#[path = "stm32g4/comparators.rs"]
mod comparators;
#[path = "stm32g4/converters.rs"]
mod converters;
#[path = "stm32g4/counter.rs"]
mod counter;
mod encoder;
#[path = "stm32g4/flash.rs"]
mod flash;
mod gate_driver;
#[path = "stm32g4/joint_board.rs"]
mod joint_board;
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
#[path = "stm32g4/rates.rs"]
mod rates;
mod sampling;
mod scales;
#[path = "stm32g4/start.rs"]
mod start;
#[path = "stm32g4/stops.rs"]
mod stops;
#[path = "stm32g4/watchdog.rs"]
mod watchdog;

use defmt_rtt as _;

defmt::timestamp!("{=u64:us}", microseconds::now_us());

pub use power_stage::open_bridge;

/// The board and its wiring, as in the file of another board's image.
// SAFETY: the linker script keeps this section out of the flash.
#[unsafe(link_section = ".board_identity")]
#[used]
static BOARD_IDENTITY: [u32; 2] = [u32::from_be_bytes(*b"ESC1"), pins::WIRING];

#[rtic::app(device = embassy_stm32, peripherals = false)]
mod app {
    use super::can::Controller;
    use super::encoder::Encoder;
    use super::flash::ChipFlash;
    use super::joint_board::{JointBoard, Periphery, receive_frames, run_background};
    use super::motor_stage::{MotorStage, measure_offsets, run_period};
    use super::power_stage::Stage;
    use super::{
        clocks, microseconds, overcurrent, pins, power_stage, prefetch, sampling, scales, start,
        watchdog,
    };
    use compensator_core::can::Frame;
    use core::mem::MaybeUninit;
    use embassy_stm32::gpio::{Level, Output, Speed};
    use firmware::background::{Background, BoardState};
    use firmware::compact::{CompactNode, Device};
    use firmware::driver::Identity;
    use firmware::loop_link::{LoopPort, LoopQueues};
    use firmware::loop_task::LoopTask;
    use firmware::node_settings::{BusSettings, NodeSettings};
    use firmware::sensors::SensorParameters;
    use firmware::sensors::encoder::MotorEncoder;
    use firmware::sensors::thermistor::Thermistor;
    use firmware::supervisor::SelfTest;
    use heapless::spsc::{Producer, Queue};

    /// Capacity of the queue of received frames. The background may be away while it evaluates parameters.
    const RECEIVE_QUEUE_FRAMES: usize = 32;

    /// The joint behind its node.
    type Joint = Device<ChipFlash>;

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
        background: &'static mut Background<Joint>,
        board: JointBoard<BridgeThermistor>,
    }

    #[init(local = [
        place: MaybeUninit<Background<Joint>> = MaybeUninit::uninit(),
        frames: Queue<Frame, RECEIVE_QUEUE_FRAMES> = Queue::new(),
        queues: LoopQueues = LoopQueues::new(),
    ])]
    fn init(mut context: init::Context) -> (Shared, Local) {
        let previous = start::previous_run();
        start::wait_for_crystal();
        let peripherals = embassy_stm32::init(clocks::clocks(pins::CRYSTAL));
        let connections = pins::connections(&peripherals);
        let wired = pins::wiring(peripherals);
        prefetch::enable();
        watchdog::start(wired.inside.watchdog);
        microseconds::start();
        context.core.DCB.enable_trace();
        context.core.DWT.enable_cycle_counter();
        // They stay as they are.
        core::mem::forget((
            Output::new(wired.transceiver.shutdown, Level::Low, Speed::Low),
            Output::new(wired.transceiver.termination, pins::TERMINATES_BUS.into(), Speed::Low),
        ));

        let mut stage = Stage::new(wired.bridge, wired.currents, wired.overcurrent);
        let are_duties_at_top = stage.start();
        let shunts = measure_offsets(&mut stage);
        watchdog::refresh_if_loop_runs();
        start::check_brown_out_level();

        let [has_a, has_b] = shunts.each_ref().map(Option::is_some);
        let failed_self_test =
            overcurrent::self_test(power_stage::clear_breaks).or(SelfTest::first_failed(&[
                (SelfTest::Wiring, pins::wiring::are_connected(connections.as_ref())),
                (SelfTest::Duties, are_duties_at_top),
                (SelfTest::OffsetA, has_a),
                (SelfTest::OffsetB, has_b),
            ]));
        let boot = previous.boot(failed_self_test);
        let store = ChipFlash::new(wired.inside.flash);
        let background = place_background(context.local.place, store);
        background.load(&boot, microseconds::now_us());
        watchdog::refresh_if_loop_runs();
        let task = background.loop_task(scales::LIMITS);
        let BusSettings { node, bit_rate_kbit, data_bit_rate_kbit } = background.bus_settings();
        let values = background.start_values();
        let inputs = Encoder::connect(values.kind(), wired.lines);
        overcurrent::follow(values.overcurrent_a);
        let controller = Controller::start(wired.can, node, bit_rate_kbit, data_bit_rate_kbit);
        let sign = values.shunt_sign;
        let shunts = shunts.map(|shunt| shunt.map(|shunt| shunt.with_sign(sign)));
        let encoder = MotorEncoder::new(values);
        // Before its first reading, the background sets the constants in use.
        let periphery = BridgeThermistor(SensorParameters::default().bridge_thermistor());
        let stage = MotorStage { stage, encoder, inputs, shunts, touch: None };

        let (frames_out, frames) = context.local.frames.split();
        let now_us = microseconds::now_us();
        let (port, link) = context.local.queues.split(scales::STAGE, now_us);
        let board = JointBoard { controller, frames, link, periphery };
        (Shared {}, Local { task, stage, port, frames_out, background, board })
    }

    /// Creates the background loop with defaults.
    // Not inlined: only then the node loads its parameters, and both take much of the stack.
    #[inline(never)]
    fn place_background(
        place: &'static mut MaybeUninit<Background<Joint>>,
        store: ChipFlash,
    ) -> &'static mut Background<Joint> {
        let now_us = microseconds::now_us();
        let identity =
            Identity { hardware: "B-G431B-ESC1", serial: clocks::serial(), stage: scales::STAGE };
        let node = CompactNode::with_defaults(NodeSettings::default(), store, identity, now_us);
        place.write(Background::new(node, now_us))
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

    /// The thermistor at the bridge.
    pub struct BridgeThermistor(Thermistor);

    impl Periphery for BridgeThermistor {
        fn state(&mut self, _now_us: u64) -> BoardState {
            let bridge_c = self.0.temperature_c(sampling::thermistor_share());
            BoardState { bridge_temperature_c: Some(bridge_c), ..BoardState::default() }
        }

        fn apply_sensors(&mut self, sensors: &SensorParameters) {
            self.0 = sensors.bridge_thermistor();
        }
    }
}
