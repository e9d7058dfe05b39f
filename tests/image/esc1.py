"""Checks the image of the compact node for the B-G431B-ESC1: its place in the flash, its memory, and its start in Unicorn."""

import memory
from call_graph import CallGraph
from chip import AIRCR, Chip

# Layout of its flash (firmware/src/boards/b_g431b_esc1/memory.x): the image, then two pages of parameters.
FLASH_AT, IMAGE_BYTES, STORE_BYTES, CHIP_BYTES, RAM_BYTES = 0x0800_0000, 124 << 10, 4 << 10, 128 << 10, 32 << 10
TIM1_BDTR, TIM1_AF1, TIM1_CR1, MOE, LOCK = 0x4001_2C44, 0x4001_2C60, 0x4001_2C00, 1 << 15, 3 << 8
OPAMP1_CSR, COMP1_CSR, DAC3 = 0x4001_0300, 0x4001_0200, 0x5000_1000
# Gain 16 with bias, feedback by the internal resistors, first input, high speed, on (RM0440, OPAMP_CSR).
AMPLIFIER = 0b01011 << 14 | 1 << 7 | 0b10 << 5 | 1
# Comparators at the shunts: first input, level of the DAC, on and locked.
COMPARATORS, COMPARATOR = (1, 2, 4), 1 << 31 | 0b100 << 4 | 1
# Three resistors at the input of an amplifier, kohm: to the shunt, to ground, to 3.3 V. The shunt has 3 mohm.
SHUNT_KOHM, GROUND_KOHM, SUPPLY_KOHM, SHUNT_OHM, REFERENCE_V = 1.5, 2.2, 22.0, 0.003, 3.3
CEILING_A = 40
# A sample: the converters' flags and results (middle of the amplifiers, 24 V), no break.
SAMPLE = ((0x5000_0000, 1 << 6), (0x4001_2C10, 0), (0x5000_0080, 2553), (0x5000_0084, 1300), (0x5000_0180, 2553), (0x5000_0184, 2870))
ADC1_2_VECTOR, PERIODS = 16 + 18, 60


def level_a(counts):
    """Current out of the motor at which a comparator with this level acts."""
    conductances = 1 / SHUNT_KOHM, 1 / GROUND_KOHM, 1 / SUPPLY_KOHM
    at_input = counts / 4096 * REFERENCE_V
    return (at_input * sum(conductances) - REFERENCE_V * conductances[2]) / conductances[0] / SHUNT_OHM


def image_lies_in_front_of_the_store(image):
    end = max(at + len(content) for at, content in image.loaded)
    assert image.vectors == FLASH_AT and end <= FLASH_AT + IMAGE_BYTES, f"the image ends at {end:#x}"
    assert IMAGE_BYTES + STORE_BYTES == CHIP_BYTES
    print(f"  measured: image of the B-G431B-ESC1, {end - FLASH_AT} of {IMAGE_BYTES} bytes")


def statics_and_worst_stack_fit_the_ram(image):
    assert image.symbols["_stack_start"][0] == 0x2000_0000 + RAM_BYTES
    used, available = memory.check(image, CallGraph(image), "esc1")
    print(f"  measured: worst stack of the B-G431B-ESC1 {used} of {available} bytes")


def started(image, until):
    chip = Chip(image)
    chip.run(image.word_of_vector(1), stack=image.word_of_vector(0), until=until)
    return chip


def comparators_and_amplifiers_are_on_before_the_bridge_may_close(image):
    chip = started(image, lambda address, value: address == TIM1_BDTR and value & LOCK)
    assert chip.writes[-1][0] == TIM1_BDTR and not chip.writes[-1][1] & MOE, f"the break is never locked: {chip.writes[-4:]}"
    # Without the pin of a gate driver, whose polarity does not matter.
    sources = chip.word(TIM1_AF1) & 0xFF
    assert sources == sum(1 << number for number in COMPARATORS), f"sources of the break: {sources:#x}"
    for number in COMPARATORS:
        register = chip.word(COMP1_CSR + 4 * (number - 1))
        assert register == COMPARATOR, f"COMP{number}: {register:#x}"
    for offset in (0x08, 0x14):
        amperes = level_a(chip.word(DAC3 + offset) & 0xFFF)
        assert CEILING_A - 1 < amperes <= CEILING_A, f"comparators at {amperes:.1f} A"
    chip = started(image, lambda address, value: address == TIM1_CR1 and value & 1)
    for number in range(2):
        register = chip.word(OPAMP1_CSR + 4 * number)
        assert register == AMPLIFIER, f"OPAMP{number + 1}: {register:#x}"
    closed = [value for address, value in chip.writes if address == TIM1_BDTR and value & MOE]
    assert not closed, "the bridge is closed at the start"


def hard_fault_opens_the_bridge_first(image):
    chip = Chip(image)
    for running, content, _ in image.segments:
        chip.core.mem_write(running, content)
    chip.set_word(TIM1_BDTR, MOE | 85)
    chip.run(image.word_of_vector(3))
    assert chip.writes[0][0] == TIM1_BDTR and not chip.writes[0][1] & MOE, f"the bridge is not opened first: {chip.writes[:3]}"
    assert chip.writes[-1][0] == AIRCR, f"the fault does not end with a reset: {chip.writes[-3:]}"


def start_reaches_the_background_and_periods_keep_the_bridge_open(image):
    chip, idle = Chip(image), image.find("3app4idle")[0] & ~1
    core, arm = chip.core, chip.arm
    chip.run(image.word_of_vector(1), stack=image.word_of_vector(0), end=idle)
    assert core.reg_read(arm.UC_ARM_REG_PC) == idle, f"the image does not reach its background: {chip.writes[-2:]}"
    stack, before = core.reg_read(arm.UC_ARM_REG_SP), len(chip.writes)
    for address, value in SAMPLE:
        chip.set_word(address, value)
    counts = []
    core.hook_add(chip.unicorn.UC_HOOK_CODE, lambda *call: counts.append(0))
    periods = []
    for _ in range(PERIODS):
        counts.clear()
        chip.run(image.word_of_vector(ADC1_2_VECTOR), stack=stack, link=idle | 1, end=idle)
        assert core.reg_read(arm.UC_ARM_REG_PC) == idle, "the interrupt does not return"
        periods.append(len(counts))
    closed = [value for address, value in chip.writes[before:] if address == TIM1_BDTR and value & MOE]
    assert not closed, "the bridge is closed although the joint is not armed"
    print(f"  measured: one interrupt of the B-G431B-ESC1 takes {min(periods)} to {max(periods)} instructions, bridge off")


CHECKS = (
    start_reaches_the_background_and_periods_keep_the_bridge_open,
    image_lies_in_front_of_the_store,
    statics_and_worst_stack_fit_the_ram,
    comparators_and_amplifiers_are_on_before_the_bridge_may_close,
    hard_fault_opens_the_bridge_first,
)
