"""The image on memory that replaces the chip, in Unicorn."""

import struct

FLASH, RAM, CCM = (0x0800_0000, 512 << 10), (0x2000_0000, 128 << 10), (0x1000_0000, 32 << 10)
# Peripherals, the chip's identity, and the core's own registers.
REGISTERS = [(0x4000_0000, 0x2000_0000), (0x1FFF_0000, 0x1_0000), (0xE000_0000, 0x10_0000)]
RCC_CR, AIRCR = 0x4002_1000, 0xE000_ED0C

# Clock registers answer at once: (request bit, answer bit, width). Oscillators, PLL and the clock switch.
MIRRORED = {
    RCC_CR: [(8, 10, 1), (16, 17, 1), (24, 25, 1)],
    0x4002_1008: [(0, 2, 2)],
}
# Identification of the CAN controller (release, byte order), which its driver checks.
CONSTANTS = {0x4000_6400: 0x3214_1218, 0x4000_6404: 0x8765_4321}

# Consecutive reads of one register after which it counts as polled.
POLL_READS = 20
MAX_INSTRUCTIONS = 20_000_000


class Chip:
    """The image on memory that replaces the chip; it records every register write in order."""

    def __init__(self, image):
        import unicorn
        from unicorn import arm_const

        self.unicorn, self.arm, self.image = unicorn, arm_const, image
        self.core = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        self.core.ctl_set_cpu_model(arm_const.UC_CPU_ARM_CORTEX_M4)
        for start, size in [FLASH, RAM, CCM, *REGISTERS]:
            self.core.mem_map(start, size)
        for address, content in image.loaded:
            self.core.mem_write(address, content)
        for address, value in CONSTANTS.items():
            self.set_word(address, value)
        self.writes, self.last, self.until, self.watched = [], (None, None, 0), None, None
        self.polled = set()
        # Writes to RAM have no hook: with one, Unicorn 2.1.4 skips places in some loops that store, whatever the hook does. Without
        # it, the same image runs as on the emulated board.
        for start, size in REGISTERS:
            self.core.hook_add(unicorn.UC_HOOK_MEM_READ, self.on_read, begin=start, end=start + size - 1)
            self.core.hook_add(unicorn.UC_HOOK_MEM_WRITE, self.on_write, begin=start, end=start + size - 1)
        self.error = unicorn.UcError

    def watch(self, place):
        """Records writes to a part of RAM, too: its address and length."""
        self.watched = place
        self.core.hook_add(self.unicorn.UC_HOOK_MEM_WRITE, self.on_write, begin=place[0], end=sum(place) - 1)

    def word(self, address):
        return struct.unpack("<I", self.core.mem_read(address, 4))[0]

    def set_word(self, address, value):
        self.core.mem_write(address, struct.pack("<I", value))

    def on_write(self, core, kind, address, size, value, data):
        value &= (1 << 8 * size) - 1
        register = any(start <= address < start + length for start, length in REGISTERS)
        watched = self.watched and self.watched[0] <= address < sum(self.watched)
        if register or watched:
            self.writes.append((address, value))
            self.last = (None, None, 0)
        # A reset ends the run, and so does the write that the caller waits for.
        if address == AIRCR or self.until and self.until(address, value):
            core.emu_stop()

    def on_read(self, core, kind, address, size, value, data):
        place = core.reg_read(self.arm.UC_ARM_REG_PC)
        if address in MIRRORED:
            word = self.word(address)
            for asked, answers, width in MIRRORED[address]:
                mask = (1 << width) - 1
                word = word & ~(mask << answers) | (word >> asked & mask) << answers
            self.set_word(address, word)
            return
        known, at, count = self.last
        same = known == address
        self.last = (address, place, count + 1 if same else 1)
        if same and count >= POLL_READS:
            self.polled.add(address)
            # All ones for some reads, then all zeros, in turn.
            self.core.mem_write(address, (b"\xff" if count // POLL_READS % 2 else b"\0") * size)

    def run(self, address, stack=None, until=None, link=0xFFFF_FFF9, end=0):
        """Runs from an address until a reset, a write for which `until` is true, or the instruction at `end`."""
        self.until = until
        self.core.reg_write(self.arm.UC_ARM_REG_SP, stack or RAM[0] + (64 << 10))
        self.core.reg_write(self.arm.UC_ARM_REG_LR, link)
        try:
            self.core.emu_start(address | 1, end, count=MAX_INSTRUCTIONS)
        except self.error as error:
            # After the checked part the image may access missing hardware.
            self.writes.append((None, str(error)))
