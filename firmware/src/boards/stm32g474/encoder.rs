//! The encoder: two frames in each period, exchanged by a timer and DMA, without the processor.
//!
//! ```text
//! TIM3 counts        up ........................ top ........................ down
//! CH2, PA4: select   ‾‾‾\_______________________/‾‾‾\_______________________/‾‾‾
//! CH3: command                   | frame 1                      | frame 2
//!                                              latches         answers with that angle
//! ```
//! TIM3 counts up and down as TIM1 does and is started by it (trigger mode, ITR0 is TIM1_TRGO, the enable of
//! TIM1), so the phase between the two is constant. Its top is [`LEAD_CYCLES`] before that of TIM1, at which
//! the currents are sampled. Frame 2 is complete when the interrupt of the currents begins.
//!
//! Chip select is a compare output, because the encoder requires it high between two frames and the chip's
//! own pulse (NSSP) exists in the other clock phase only (RM0440, SPI: NSS pulse mode requires CPHA = 0).
//! It is high while the count is below CCR2 or not below CCR1 (combined PWM mode 1: OC2REFC is the OR of
//! OC1REF and OC2REF). Each compare event of channel 3, half way through chip select in either direction
//! (CMS = 11), is a DMA request that writes a command to the SPI. The SPI's receive request stores the
//! answer. Both DMA channels are circular over two words. The interrupt reads the answers and writes the
//! commands of the next period.
//!
//! Channel 4 starts the slow conversions; see [`super::slow`].
//!
//! An encoder with BiSS C has no chip select. Its frame is four words without a gap, which the compare events of channels 1 and
//! 3 request in both directions:
//!
//! ```text
//! CH1, CH3: word        1 | 2 | (top) 3 | 4
//! MA              ‾‾‾‾‾‾\_56 clocks_________/‾‾‾ idle until the next period
//! ```

use super::power_stage::since_top;
use super::scales::{
    BISS_INNER_CYCLES, BISS_OUTER_CYCLES, CORE_HZ, ENCODER_CLOCK, ENCODER_DIVIDER,
    FAST_CONVERSION_CYCLES, HALF_GAP_CYCLES, LEAD_CYCLES, PWM_TOP, SLOW_START_CYCLES,
};
use super::{incremental, pins};
use core::sync::atomic::{AtomicU16, Ordering};
use embassy_stm32::Peri;
use embassy_stm32::gpio::{OutputType, Pull};
use embassy_stm32::mode::Blocking;
use embassy_stm32::pac::bdma::vals as dma;
use embassy_stm32::pac::spi::vals as spi_values;
use embassy_stm32::pac::timer::vals;
use embassy_stm32::peripherals::{DMA1_CH1, DMA1_CH2, SPI1, TIM3};
use embassy_stm32::spi::mode::Master;
use embassy_stm32::spi::{self, Spi};
use embassy_stm32::timer::Ch2;
use embassy_stm32::timer::simple_pwm::PwmPin;
use embassy_stm32::{pac, rcc};
use firmware::sensors::as504x::{DESELECTED_NS, FramePairs, RELEASE_NS, SELECT_NS};
use firmware::sensors::biss;
use firmware::sensors::encoder::EncoderInputs;
use firmware::sensors::quadrature::Quadrature;

const TIMER: pac::timer::TimGp16 = pac::TIM3;
const BUS: pac::spi::Spi = pac::SPI1;

/// Channels of DMA1, and their requests (RM0440, table of DMAMUX requests).
const COMMAND_CHANNEL: usize = 0;
const ANSWER_CHANNEL: usize = 1;
/// Writes the first and the last word of a BiSS frame.
const OUTER_CHANNEL: usize = 2;
const TIM3_CH1_REQUEST: u8 = 61;
const TIM3_CH3_REQUEST: u8 = 63;
const SPI1_RX_REQUEST: u8 = 10;

/// Frames of a period.
const FRAMES: usize = 2;
/// Cycles of a word of a BiSS frame, and from the top of TIM1 to the end of the frame at the latest.
const WORD_CYCLES: u32 = biss::WORD_BITS * ENCODER_DIVIDER;
const BISS_COMPLETE_CYCLES: u32 =
    START_CYCLES + biss::WORDS as u32 * WORD_CYCLES - BISS_OUTER_CYCLES - LEAD_CYCLES;
const _: () = {
    let (outer, inner) = (BISS_OUTER_CYCLES, BISS_INNER_CYCLES);
    assert!(outer - inner <= WORD_CYCLES && outer + inner <= 2 * WORD_CYCLES, "a gap in a frame");
    assert!(2 * outer <= 3 * WORD_CYCLES, "a gap before the last word");
    assert!(BISS_COMPLETE_CYCLES < FAST_CONVERSION_CYCLES, "the frame ends too late");
};
/// Cycles of the 16 clocks of a frame.
const FRAME_CYCLES: u32 = 16 * ENCODER_DIVIDER;
/// Maximum cycles from the compare event to the first clock: the DMA transfer, and the start of the SPI.
const START_CYCLES: u32 = 40 + ENCODER_DIVIDER;
/// Cycles from chip select to the command, and from the command to the release of chip select.
const HALF_SELECT_CYCLES: u32 = 620;
/// Cycles after the top of TIM1 at which the second answer is stored at the latest.
const COMPLETE_CYCLES: u32 =
    HALF_GAP_CYCLES + HALF_SELECT_CYCLES + START_CYCLES + FRAME_CYCLES - LEAD_CYCLES;
const _: () = {
    assert!(HALF_SELECT_CYCLES >= cycles_of(SELECT_NS), "the first clock is too early");
    let frame_end = START_CYCLES + FRAME_CYCLES;
    assert!(HALF_SELECT_CYCLES >= frame_end + cycles_of(RELEASE_NS), "the release is too early");
    assert!(2 * HALF_GAP_CYCLES >= cycles_of(DESELECTED_NS), "the frames are too close");
    assert!(
        COMPLETE_CYCLES < FAST_CONVERSION_CYCLES,
        "the interrupt begins when the currents are converted, before the angle is there"
    );
};

/// Counts of the timer at which chip select rises or falls, and at which a command is written.
const SELECT_ABOVE: u16 = PWM_TOP - HALF_GAP_CYCLES as u16;
const COMMAND_AT: u16 = SELECT_ABOVE - HALF_SELECT_CYCLES as u16;
const SELECT_BELOW: u16 = COMMAND_AT - HALF_SELECT_CYCLES as u16;
/// Count while counting down at which slow conversions start; see [`super::slow`].
const SLOW_AT: u16 = PWM_TOP - (LEAD_CYCLES + SLOW_START_CYCLES) as u16;
/// Maximum deviation of the phase between both timers, cycles: the reads of both counters and the start.
const MAX_PHASE_ERROR_CYCLES: u32 = 60;

/// A word with wrong parity: the place of an answer that has not come yet.
const NO_ANSWER: u16 = 1;
/// Periods without an answer after which the exchange is restarted.
const RESTART_AFTER_PERIODS: u8 = 100;

static COMMANDS: [AtomicU16; FRAMES] =
    [const { AtomicU16::new(FramePairs::FIRST_COMMANDS[0]) }; FRAMES];
/// Two answers, or the words of a BiSS frame.
static ANSWERS: [AtomicU16; biss::WORDS] = [const { AtomicU16::new(NO_ANSWER) }; biss::WORDS];
/// A word with more bits than one of a BiSS frame.
const NO_WORD: u16 = u16::MAX;

const fn cycles_of(ns: u32) -> u32 {
    (ns as u64 * CORE_HZ as u64).div_ceil(1_000_000_000) as u32
}

/// The encoder's timer and bus, and the other inputs of the kinds of an encoder.
pub struct Encoder {
    missing_periods: u8,
    is_biss: bool,
    _bus: Spi<'static, Blocking, Master>,
    _timer: Peri<'static, TIM3>,
    _channels: (Peri<'static, DMA1_CH1>, Peri<'static, DMA1_CH2>),
}

impl Encoder {
    /// Sets up bus, DMA and timer. The first frame is exchanged when TIM1 starts.
    pub fn new(wired: pins::Encoder) -> Self {
        let mut config = spi::Config::default();
        config.mode = spi::MODE_1;
        config.frequency = ENCODER_CLOCK;
        config.miso_pull = Pull::Up;
        let bus = Spi::new_blocking(wired.spi, wired.clock, wired.out, wired.back, config);
        set_up_timer();
        // Connected once the timer holds it high, and it stays connected.
        core::mem::forget(PwmPin::<TIM3, Ch2>::new(wired.select, OutputType::PushPull));
        set_up_bus();
        start_exchange(false);
        Self {
            missing_periods: 0,
            is_biss: false,
            _bus: bus,
            _timer: wired.timer,
            _channels: (wired.command, wired.answer),
        }
    }

    /// Exchanges frames of BiSS C from now on. Call it while the timer runs.
    pub fn use_biss(&mut self) {
        self.is_biss = true;
        // Between two pairs of frames.
        while TIMER.cr1().read().dir() == vals::Dir::DOWN || TIMER.cnt().read().cnt() > PWM_TOP / 4
        {
        }
        TIMER.dier().write(|_| {});
        BUS.cr1().modify(|w| w.set_spe(false));
        // The clock is high at rest, and SLO is read at its rising edges.
        BUS.cr1().modify(|w| {
            w.set_cpol(spi_values::Cpol::IDLE_HIGH);
            w.set_cpha(spi_values::Cpha::SECOND_EDGE);
        });
        BUS.cr2().modify(|w| w.set_ds(spi_values::Ds::BITS14));
        BUS.cr1().modify(|w| w.set_spe(true));
        for (channel, cycles) in [(0, BISS_OUTER_CYCLES), (2, BISS_INNER_CYCLES)] {
            TIMER.ccr(channel).write(|w| w.set_ccr(PWM_TOP - cycles as u16));
        }
        start_exchange(true);
        TIMER.dier().write(|w| {
            w.set_ccde(0, true);
            w.set_ccde(2, true);
        });
    }

    #[cold]
    #[inline(never)]
    fn count_missing(&mut self) {
        self.missing_periods += 1;
        if self.missing_periods >= RESTART_AFTER_PERIODS {
            self.missing_periods = 0;
            start_exchange(self.is_biss);
        }
    }
}

impl EncoderInputs for Encoder {
    #[inline(always)]
    fn frames(&mut self) -> Option<[u16; FRAMES]> {
        let [first, second, ..] = &ANSWERS;
        // Both answers are stored, and no further one.
        let is_complete = pac::DMA1.ch(ANSWER_CHANNEL).ndtr().read().ndt() == FRAMES as u16;
        let answers = [first.load(Ordering::Relaxed), second.load(Ordering::Relaxed)];
        second.store(NO_ANSWER, Ordering::Relaxed);
        let answers = (is_complete && answers[1] != NO_ANSWER).then_some(answers);
        if answers.is_some() {
            self.missing_periods = 0;
        } else {
            self.count_missing();
        }
        answers
    }

    #[inline(always)]
    fn set_commands(&mut self, [first, second]: [u16; FRAMES]) {
        COMMANDS[0].store(first, Ordering::Relaxed);
        COMMANDS[1].store(second, Ordering::Relaxed);
    }

    #[inline(always)]
    fn biss(&mut self) -> Option<[u16; biss::WORDS]> {
        let is_complete = pac::DMA1.ch(ANSWER_CHANNEL).ndtr().read().ndt() == biss::WORDS as u16;
        let [first, second, third, fourth] = &ANSWERS;
        let words = [first, second, third, fourth].map(|word| word.load(Ordering::Relaxed));
        fourth.store(NO_WORD, Ordering::Relaxed);
        if is_complete && words[biss::WORDS - 1] != NO_WORD {
            self.missing_periods = 0;
            return Some(words);
        }
        self.count_missing();
        None
    }

    #[inline(always)]
    fn quadrature(&mut self) -> Quadrature {
        incremental::counts()
    }

    #[inline(always)]
    fn hall(&mut self) -> u8 {
        incremental::hall_levels()
    }
}

/// Returns the first words of the last frame of BiSS C. With another encoder they have no meaning.
pub fn biss_words() -> [u16; biss::TURN_WORDS] {
    let [first, second, third, _] = &ANSWERS;
    [first, second, third].map(|word| word.load(Ordering::Relaxed))
}

/// Returns true if divider and source of the encoder's clock have the expected values, and the timer runs in
/// the expected phase. Call it while both timers run.
pub fn is_set_up_correctly() -> bool {
    let divider = 2 << BUS.cr1().read().br().to_bits();
    let has_clock = divider == ENCODER_DIVIDER && rcc::frequency::<SPI1>().0 == CORE_HZ;
    // A counter that turns between the reads of its count and of its direction gives another phase, which the next one does
    // not.
    has_clock && (0..3).any(|_| is_in_phase())
}

fn is_in_phase() -> bool {
    let period = 2 * u32::from(PWM_TOP);
    let motor = since_top();
    let (top, count) = (u32::from(PWM_TOP), u32::from(TIMER.cnt().read().cnt()));
    let phase = if TIMER.cr1().read().dir() == vals::Dir::DOWN { top - count } else { top + count };
    let lead = (phase + period - motor) % period;
    lead.abs_diff(LEAD_CYCLES) <= MAX_PHASE_ERROR_CYCLES
}

fn set_up_timer() {
    rcc::enable_and_reset::<TIM3>();
    // It stops with TIM1 when a debugger halts the core.
    pac::DBGMCU.apb1lfzr().modify(|w| w.set_tim3(true));
    TIMER.cr1().write(|w| w.set_cms(vals::Cms::CENTER_ALIGNED3));
    TIMER.psc().write_value(0);
    TIMER.arr().write(|w| w.set_arr(PWM_TOP));
    TIMER.ccmr_output(0).write(|w| {
        w.set_ocm(0, vals::Ocm::PWM_MODE2);
        w.set_ocm(1, vals::Ocm::COMBINED_PWM_MODE_1);
    });
    TIMER.ccmr_output(1).write(|w| {
        w.set_ocm(0, vals::Ocm::FROZEN);
        w.set_ocm(1, vals::Ocm::PWM_MODE1);
    });
    for (channel, count) in
        [SELECT_ABOVE, SELECT_BELOW, COMMAND_AT, SLOW_AT].into_iter().enumerate()
    {
        TIMER.ccr(channel).write(|w| w.set_ccr(count));
    }
    TIMER.cr2().write(|w| w.set_mms(vals::Mms::COMPARE_OC4));
    TIMER.ccer().write(|w| {
        w.set_cce(1, true);
        w.set_cce(3, true);
    });
    TIMER.dier().write(|w| w.set_ccde(2, true));
    // TIM1 starts at the bottom, half a period before its top.
    TIMER.cnt().write(|w| w.set_cnt(LEAD_CYCLES as u16));
    TIMER.smcr().write(|w| {
        w.set_ts(vals::Ts::ITR0);
        w.set_sms(vals::Sms::TRIGGER_MODE);
    });
}

/// Sets frames of 16 bits, whose answers DMA reads.
fn set_up_bus() {
    BUS.cr1().modify(|w| w.set_spe(false));
    BUS.cr2().modify(|w| {
        w.set_ds(spi_values::Ds::BITS16);
        w.set_frxth(spi_values::Frxth::HALF);
        w.set_rxdmaen(true);
    });
    BUS.cr1().modify(|w| w.set_spe(true));
}

/// Starts the DMA channels at their first word. Between two pairs of frames it also restarts them.
#[inline(never)]
fn start_exchange(is_biss: bool) {
    for channel in [COMMAND_CHANNEL, ANSWER_CHANNEL, OUTER_CHANNEL] {
        pac::DMA1.ch(channel).cr().write(|w| w.set_en(false));
    }
    // Empties the receive FIFO of the bus, which holds two words.
    for _ in 0..FRAMES {
        let _ = BUS.dr16().read();
    }
    set_up_channel(COMMAND_CHANNEL, TIM3_CH3_REQUEST, dma::Dir::FROM_MEMORY, &COMMANDS);
    let (answers, _) = ANSWERS.split_at(if is_biss { biss::WORDS } else { FRAMES });
    set_up_channel(ANSWER_CHANNEL, SPI1_RX_REQUEST, dma::Dir::FROM_PERIPHERAL, answers);
    if is_biss {
        set_up_channel(OUTER_CHANNEL, TIM3_CH1_REQUEST, dma::Dir::FROM_MEMORY, &COMMANDS);
    }
}

fn set_up_channel(number: usize, request: u8, dir: dma::Dir, words: &'static [AtomicU16]) {
    pac::DMAMUX1.ccr(number).write(|w| w.set_dmareq_id(request));
    let channel = pac::DMA1.ch(number);
    channel.par().write_value(BUS.dr16().as_ptr() as u32);
    channel.mar().write_value(words.as_ptr() as u32);
    channel.ndtr().write(|w| w.set_ndt(words.len() as u16));
    channel.cr().write(|w| {
        w.set_dir(dir);
        w.set_circ(true);
        w.set_minc(true);
        w.set_msize(dma::Size::BITS16);
        w.set_psize(dma::Size::BITS16);
        w.set_pl(dma::Pl::HIGH);
        w.set_en(true);
    });
}
