"""Registers and local memory of the kernels in a CUBIN, from its ``.nv.info`` section: no GPU, no tools of NVIDIA's."""

import struct
from dataclasses import dataclass
from pathlib import Path

# Attributes of .nv.info whose value is (symbol, number); a stack frame is local memory: spills, or arrays that are
# indexed at run time.
REGISTERS, FRAME = 0x2F, 0x11
SIZED = 4  # format of attributes that carry their size


@dataclass
class Usage:
    """What one function of a CUBIN takes."""

    registers: int = 0
    frame: int = 0


def usage(path: Path) -> dict[str, Usage]:
    """Registers and bytes of local memory per function."""
    data = path.read_bytes()
    assert data[:5] == b"\x7fELF\x02", "a 64-bit ELF file"
    (offset,) = struct.unpack_from("<Q", data, 0x28)
    size, count, names_at = struct.unpack_from("<HHH", data, 0x3A)
    headers = [struct.unpack_from("<IIQQQQIIQQ", data, offset + k * size) for k in range(count)]

    def text(table: tuple[int, ...], at: int) -> str:
        start = table[4] + at
        return data[start : data.index(b"\0", start)].decode()

    sections = {text(headers[names_at], header[0]): header for header in headers}
    symbols, strings = sections[".symtab"], sections[".strtab"]
    found: dict[str, Usage] = {}
    at, end = sections[".nv.info"][4], sections[".nv.info"][4] + sections[".nv.info"][5]
    while at < end:
        form, attribute, length = struct.unpack_from("<BBH", data, at)
        if form == SIZED and attribute in (REGISTERS, FRAME):
            symbol, value = struct.unpack_from("<II", data, at + 4)
            (name,) = struct.unpack_from("<I", data, symbols[4] + 24 * symbol)
            setattr(
                found.setdefault(text(strings, name), Usage()), "frame" if attribute == FRAME else "registers", value
            )
        at += 4 + (length if form == SIZED else 0)
    return found
