import pathlib
import re
import struct


def texts(table="refusals.tsv"):
    """Texts of refusals by their numbers."""
    rows = (line.split("\t") for line in pathlib.Path(table).read_text().splitlines())
    return {int(number, 16): text for number, text in rows}


def reason(value, texts):
    """The value of object 2028h in words."""
    number, *words = struct.unpack("<5I", value)
    rest = iter(words)

    def at_place(found):
        word = next(rest)
        if found[1] == "f32":
            return f"{struct.unpack('<f', struct.pack('<I', word))[0]:.7g}"
        if found[1] == "i32":
            return str(struct.unpack("<i", struct.pack("<I", word))[0])
        return texts.get(word, "?") if found[1] == "name" else f"{word:08x}" if found[1] == "hex" else str(word)

    return re.sub(r"\{(\w+)\}", at_place, texts.get(number, ""))
