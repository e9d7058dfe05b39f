"""An ELF file of the microcontroller: loaded segments, symbols, functions."""

import bisect
import struct

FUNCTION = 2


class Image:
    """An ELF file: its loaded segments and symbols."""

    def __init__(self, path):
        self.data = path.read_bytes()
        program, sections = struct.unpack_from("<II", self.data, 28)
        entry, count = struct.unpack_from("<HH", self.data, 42)
        # Loaded content: address while running, content, address in flash from which it is copied.
        self.segments = []
        for index in range(count):
            kind, offset, running, loaded, length = struct.unpack_from("<5I", self.data, program + index * entry)
            if kind == 1 and length:
                self.segments.append((running, self.data[offset : offset + length], loaded))
        self.loaded = [(loaded, content) for _, content, loaded in self.segments]
        entry, count = struct.unpack_from("<HH", self.data, 46)
        headers = [struct.unpack_from("<10I", self.data, sections + index * entry) for index in range(count)]
        self.symbols, self.functions, marks = {}, [], []
        for header in (header for header in headers if header[1] == 2):
            names = headers[header[6]][4]
            for at in range(header[4], header[4] + header[5], 16):
                name, value, size, kind = struct.unpack_from("<IIIB", self.data, at)
                end = self.data.index(b"\0", names + name)
                name = self.data[names + name : end].decode()
                if name[:2] in ("$t", "$d"):
                    marks.append((value, name[:2]))
                    continue
                self.symbols[name] = (value, size)
                if kind & 0xF == FUNCTION:
                    self.functions.append((name, value, size))
        # Start of the vector table, which is that of the image.
        self.vectors = self.symbols["__vector_table"][0]
        # At one address the mark of code comes last and holds.
        marks.sort()
        self.mark_places, self.mark_kinds = [place for place, _ in marks], [kind for _, kind in marks]

    def find(self, part):
        found = [place for name, place in self.symbols.items() if part in name]
        assert found, f"no symbol with {part}"
        return found[0]

    def is_data(self, address):
        """True if constants, not instructions, lie there."""
        index = bisect.bisect_right(self.mark_places, address) - 1
        return index >= 0 and self.mark_kinds[index] == "$d"

    def word(self, address):
        """The word at an address while running."""
        return self.half(address) | self.half(address + 2) << 16

    def word_of_vector(self, number):
        """A word of the vector table: 0 is the start of the stack, 1 the reset handler."""
        return self.word(self.vectors + 4 * number)

    def is_panic_place(self, address):
        """True if a panic's location lies there: a pointer to the name of a source file, its length, line, column."""
        place, length = self.word(address), self.word(address + 4)
        if length not in range(4, 200):
            return False
        try:
            name = bytes(self.half(at) & 0xFF for at in range(place, place + length))
        except LookupError:
            return False
        return name.endswith(b".rs")

    def half(self, address):
        """The half word at an address while running."""
        for start, content, _ in self.segments:
            if start <= address < start + len(content) - 1:
                return content[address - start] | content[address - start + 1] << 8
        raise LookupError(hex(address))
