"""Call graph and stack frames of an image, from its instructions.

Only the instructions that call, jump or move the stack pointer are decoded (ARMv7-M, Thumb-2). A frame is the sum of all
pushes and subtractions in a function, which is an upper bound. A call through a register has no target here; it is recorded
as indirect, and the caller of this module names its possible targets.
"""

import bisect


class Function:
    """A function: its name, place, length, calls, addresses that it uses as values, and stack frame in bytes."""

    def __init__(self, name, address, size):
        self.name, self.address, self.size = name, address, size
        self.calls, self.indirect, self.values, self.frame, self.unbounded = set(), [], set(), 0, False


def expand(imm12):
    """Constant of a modified immediate (ThumbExpandImm)."""
    if imm12 >> 10 == 0:
        low, kind = imm12 & 0xFF, imm12 >> 8 & 3
        return low * (1, 0x0001_0001, 0x0100_0100, 0x0101_0101)[kind]
    value, turn = 0x80 | imm12 & 0x7F, imm12 >> 7
    return value >> turn | value << 32 - turn & 0xFFFF_FFFF


def signed(value, bits):
    return value - (1 << bits) if value >> bits - 1 & 1 else value


def branch(at, first, second):
    """Target of a 32-bit branch, or None."""
    if first & 0xF800 != 0xF000 or second & 0x8000 == 0:
        return None
    sign, low = first >> 10 & 1, second & 0x7FF
    one, two = second >> 13 & 1, second >> 11 & 1
    if second & 0x1000:
        high = (sign << 2) | (1 ^ one ^ sign) << 1 | (1 ^ two ^ sign)
        return at + 4 + signed(high << 22 | (first & 0x3FF) << 12 | low << 1, 25)
    if second & 0x4000 or first >> 7 & 7 == 7:
        return None
    return at + 4 + signed(sign << 20 | two << 19 | one << 18 | (first & 0x3F) << 12 | low << 1, 21)


def pushed(first, second):
    """Bytes by which an instruction moves the stack pointer down, or None if it is not known."""
    if first & 0xFE00 == 0xB400:
        return 4 * (first & 0x1FF).bit_count()
    if first & 0xFF80 == 0xB080:
        return 4 * (first & 0x7F)
    if first == 0xE92D:
        return 4 * second.bit_count()
    if first & 0xFFBF == 0xED2D:
        return 4 * (second & 0xFF)
    if first == 0xF84D and second & 0x0F00 == 0x0D00:
        return second & 0xFF
    if first == 0xE96D:
        return 4 * (second & 0xFF)
    if first & 0xFBFF == 0xF1AD and second & 0x0F00 == 0x0D00:
        return expand((first >> 10 & 1) << 11 | (second >> 12 & 7) << 8 | second & 0xFF)
    if first & 0xFBFF == 0xF2AD and second & 0x0F00 == 0x0D00:
        return (first >> 10 & 1) << 11 | (second >> 12 & 7) << 8 | second & 0xFF
    if first & 0xFFEF == 0xEBAD and second & 0x0F00 == 0x0D00:
        return None
    return 0


class CallGraph:
    """Functions of an image by address, with their calls."""

    def __init__(self, image):
        self.image, self.functions = image, {}
        for name, address, size in image.functions:
            known = self.functions.get(address & ~1)
            if known is None or known.size < size:
                self.functions[address & ~1] = Function(name, address & ~1, size)
        self.starts = sorted(self.functions)
        for function in self.functions.values():
            self.decode(function)

    def at(self, address):
        """The function that contains an address, or None."""
        index = bisect.bisect_right(self.starts, address) - 1
        found = self.functions[self.starts[index]] if index >= 0 else None
        return found if found and address < found.address + max(found.size, 2) else None

    def decode(self, function):
        at, end, moved = function.address, function.address + function.size, {}
        while at < end:
            if self.image.is_data(at):
                if at % 4 == 0 and at + 4 <= end:
                    function.values.add(self.image.half(at) | self.image.half(at + 2) << 16)
                at += 2
                continue
            first = self.image.half(at)
            wide = first >> 11 in (0b11101, 0b11110, 0b11111)
            second = self.image.half(at + 2) if wide else 0
            self.follow(function, at, first, second, wide, moved)
            frame = pushed(first, second)
            if frame is None:
                # The length is in a register: the constant that was moved into it.
                frame = moved.get(second & 0xF)
                function.unbounded |= frame is None
            function.frame += frame or 0
            at += 4 if wide else 2

    def follow(self, function, at, first, second, wide, moved):
        """Records a call, a jump out of the function, and the constants from which a long jump is made."""
        target = branch(at, first, second) if wide else None
        if not wide and first & 0xF800 == 0xE000:
            target = at + 4 + signed(first & 0x7FF, 11) * 2
        if target is not None and not function.address <= target < function.address + function.size:
            function.calls.add(target & ~1)
        if wide and first & 0xFBF0 in (0xF240, 0xF2C0) and not second & 0x8000:
            register = second >> 8 & 0xF
            value = (first & 0xF) << 12 | (first >> 10 & 1) << 11 | (second >> 12 & 7) << 8 | second & 0xFF
            moved[register] = moved.get(register, 0) & 0xFFFF | value << 16 if first & 0x80 else value
            function.values.add(moved[register])
        register = first >> 3 & 0xF
        if not wide and (first & 0xFF87 == 0x4780 or first & 0xFF87 == 0x4700 and register != 14):
            # A long call by the linker moves the address into a register first.
            if register == 12 and 12 in moved:
                function.calls.add(moved[12] & ~1)
            else:
                function.indirect.append(at)

    def reachable(self, start, targets=lambda function: (), ends=lambda function: False):
        """All functions that a run from `start` may enter.

        `targets` gives those of indirect calls. Calls of a function for which `ends` is true are not followed.
        """
        found, waiting = {}, [start & ~1]
        while waiting:
            function = self.at(waiting.pop())
            if function is None or function.address in found:
                continue
            found[function.address] = function
            if not ends(function):
                waiting += function.calls
                waiting += targets(function) if function.indirect else ()
        return list(found.values())
