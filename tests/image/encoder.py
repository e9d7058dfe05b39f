"""Times of the encoder's frames and of the slow conversions, from the registers of the started image (RM0440).

Both timers are counted cycle by cycle from the moment at which TIM1 starts the other one.
"""

TIM1, TIM3, SPI1, DMA1, DMAMUX1 = 0x4001_2C00, 0x4000_0400, 0x4001_3000, 0x4002_0000, 0x4002_0800
ADC3_JSQR, ADC4_JSQR = 0x5000_044C, 0x5000_054C
CORE_HZ = 170_000_000
TRIGGER_ITR0, CENTER_ALIGNED_BOTH, TIM3_CH3_REQUEST, SPI1_RX_REQUEST, TIM3_TRGO = 6, 3, 63, 10, 12
PWM_1, PWM_2, COMBINED_1 = 0b0110, 0b0111, 0b1100
# Enabled, circular, increments memory, 16 bits on both sides, high priority; and from memory.
CHANNEL, FROM_MEMORY = 1 | 1 << 5 | 1 << 7 | 1 << 8 | 1 << 10 | 2 << 12, 1 << 4
# Data sheet of the encoder: select to clock, clock to release, time between two frames, ns.
SELECT_NS, RELEASE_NS, DESELECTED_NS = 350, 100, 350
# From the request to the first clock, at most: DMA, bus and the start of the SPI.
START_CYCLES = 72
# Currents and bus in converter cycles of four core cycles; slow ones.
FAST_CYCLES, SLOW_CYCLES = 62 * 4, 260 * 4


def mode(chip, channel):
    """Compare mode of a channel of TIM3."""
    register = chip.word(TIM3 + 0x18 + 4 * (channel // 2)) >> 8 * (channel % 2)
    return register >> 4 & 7 | register >> 13 & 8


def nanoseconds(cycles):
    return cycles * 1e9 / CORE_HZ


def events(chip):
    """Edges of chip select, requests and edges of the trigger, in cycles from the top of TIM1, over two periods."""
    top, above, below, command, slow = (chip.word(TIM3 + at) for at in (0x2C, 0x34, 0x38, 0x3C, 0x40))
    count, step = chip.word(TIM3 + 0x24), 1
    found, selected, trigger = [], None, None
    for cycle in range(-top, 4 * top):
        is_low = not (count < below or count >= above)
        is_high = count < slow
        if selected not in (None, is_low):
            found.append((cycle, "selected" if is_low else "released"))
        if trigger not in (None, is_high):
            found.append((cycle, "rises" if is_high else "falls"))
        if count == command:
            found.append((cycle, "command"))
        selected, trigger = is_low, is_high
        step = -1 if count >= top else 1 if count <= 0 else step
        count += step
    return found


def registers(chip):
    """Checks that timer, DMA and converters are connected as the times below assume."""
    assert chip.word(TIM3) >> 5 & 3 == CENTER_ALIGNED_BOTH and not chip.word(TIM3) & 1, "TIM3 runs before TIM1, or in one direction"
    assert chip.word(TIM3 + 0x08) == TRIGGER_ITR0, "TIM3 is not started by TIM1"
    assert chip.word(TIM1 + 0x04) >> 4 & 7 == 1, "TIM1_TRGO is not its enable"
    assert [mode(chip, channel) for channel in (0, 1, 3)] == [PWM_2, COMBINED_1, PWM_1], "compare modes"
    assert chip.word(TIM3 + 0x0C) == 1 << 11, "the request is not that of channel 3"
    assert chip.word(TIM3 + 0x04) >> 4 & 7 == 7, "TIM3_TRGO is not channel 4"
    assert chip.word(DMAMUX1) == TIM3_CH3_REQUEST and chip.word(DMAMUX1 + 4) == SPI1_RX_REQUEST, "DMA requests"
    for number, control in ((0, CHANNEL | FROM_MEMORY), (1, CHANNEL)):
        base = DMA1 + 8 + 20 * number
        assert chip.word(base) == control, f"DMA channel {number + 1}: {chip.word(base):#x}"
        assert chip.word(base + 4) == 2 and chip.word(base + 8) == SPI1 + 0x0C, f"DMA channel {number + 1}"
    assert chip.word(SPI1 + 0x04) & 0xF01 == 0xF01, "SPI: 16 bits, receive by DMA"
    for register, edge in ((ADC3_JSQR, 1), (ADC4_JSQR, 2)):
        assert chip.word(register) >> 2 & 0x7F == edge << 5 | TIM3_TRGO, f"trigger {chip.word(register):#x}"


def check(chip):
    """Checks all times; returns the age of the angle in cycles."""
    registers(chip)
    period = 2 * chip.word(TIM1 + 0x2C)
    assert 2 * chip.word(TIM3 + 0x2C) == period, "the timers have different periods"
    frame = 16 * (2 << (chip.word(SPI1) >> 3 & 7))
    # The second answer is complete before the currents are.
    at = {kind: [cycle for cycle, found in events(chip) if found == kind] for kind in ("selected", "released", "command", "rises", "falls")}
    commands = [cycle for cycle in at["command"] if cycle > -period // 2]
    assert len(commands) >= 4, "not two frames in a period"
    for command in commands[:4]:
        before = max(cycle for cycle in at["selected"] if cycle <= command)
        after = min(cycle for cycle in at["released"] if cycle > command)
        assert nanoseconds(command - before) >= SELECT_NS, f"selected {nanoseconds(command - before):.0f} ns before a frame"
        left = nanoseconds(after - command - START_CYCLES - frame)
        assert left >= RELEASE_NS, f"released {left:.0f} ns after a frame"
        following = min(cycle for cycle in at["selected"] if cycle > after)
        assert nanoseconds(following - after) >= DESELECTED_NS, f"{nanoseconds(following - after):.0f} ns between frames"
    second = max(cycle for cycle in commands if cycle < FAST_CYCLES)
    complete = second + START_CYCLES + frame
    assert complete < FAST_CYCLES, f"the answer is complete {complete} cycles after the top, the currents at {FAST_CYCLES}"
    rise = min(cycle for cycle in at["rises"] if cycle > 0)
    fall = min(cycle for cycle in at["falls"] if cycle > 0)
    assert FAST_CYCLES < rise and rise + 2 * SLOW_CYCLES < fall and fall + SLOW_CYCLES < period, f"slow conversions at {rise}, {fall}"
    return -max(cycle for cycle in at["released"] if cycle < second)
