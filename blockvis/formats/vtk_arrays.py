"""Numbers in the arrays of VTK's XML files, read without VTK, which would reserve memory for any count."""

from __future__ import annotations

import base64
import re
import zlib

import numpy as np

_TYPES = {f"{sign}Int{bits}": f"{'u' if sign else 'i'}{bits // 8}" for sign in ("", "U") for bits in (8, 16, 32, 64)}


def largest_number(text: bytes, attributes: dict[str, str], file: dict[str, str], most: int) -> int:
    """Find the largest absolute value in an array of whole numbers, of at most so many bytes.

    ``text`` is the content of the array, or the file's appended data from the beginning of the array on; attributes are
    those of XML, of the array, with ``format`` "ascii", "binary" (base64) or "raw", and of the file.
    """
    if attributes.get("format", "ascii") == "ascii":
        numbers = np.array(re.findall(rb"-?\d{1,18}", text), dtype=np.int64)
    else:
        word = _word(file)
        data = _unpacked(text, attributes["format"] == "raw", word, file.get("compressor", ""), most)
        kind = np.dtype(_TYPES[attributes.get("type", "Int64")]).newbyteorder(word.byteorder)
        numbers = np.frombuffer(data[: len(data) // kind.itemsize * kind.itemsize], kind)
    return max((abs(int(numbers.max())), abs(int(numbers.min()))), default=0) if len(numbers) else 0


def announced_bytes(text: bytes, attributes: dict[str, str], file: dict[str, str]) -> int:
    """Read how many bytes the header of a binary array announces; VTK reserves as much memory.

    Given are the beginning of the array's content, and attributes as of :func:`largest_number`.
    """
    raw, word = attributes.get("format") == "raw", _word(file)
    size = _words(text, raw, word, 1)[0]
    if not file.get("compressor", "") or size == 0:
        return size
    count, chunk, last = _words(text, raw, word, 3)
    return count * max(chunk, last)


def _word(file: dict[str, str]) -> np.dtype:
    order = "<" if file.get("byte_order", "LittleEndian") == "LittleEndian" else ">"
    return np.dtype(order + ("u8" if file.get("header_type") == "UInt64" else "u4"))


def _unpacked(text: bytes, raw: bool, word: np.dtype, compressor: str, most: int) -> bytes:
    """Unpack an array: a header of words, then the data, in one piece or in compressed chunks."""
    if not compressor:
        size = _words(text, raw, word, 1)[0]
        if size > most:
            raise ValueError(f"an array of {size} bytes")
        return _bytes(text, raw, word.itemsize + size)[word.itemsize :]
    count = _words(text, raw, word, 1)[0]
    if count > len(text):
        raise ValueError(f"an array of {count} chunks")
    header = _words(text, raw, word, 3 + count)
    chunk, sizes = header[1], header[3:]
    if count * chunk > most or sum(sizes) > len(text):
        raise ValueError(f"an array of {count} chunks of {chunk} bytes")
    if compressor != "vtkZLibDataCompressor":
        raise ValueError(f"the compressor {compressor}")
    start = (3 + count) * word.itemsize
    packed = text[start:] if raw else _bytes(text[4 * -(-start // 3) :], False, sum(sizes))
    found, place = [], 0
    for size in sizes:
        found.append(zlib.decompressobj().decompress(packed[place : place + size], max(chunk, header[2], 1)))
        place += size
    return b"".join(found)


def _words(text: bytes, raw: bool, word: np.dtype, count: int) -> list[int]:
    return [int(value) for value in np.frombuffer(_bytes(text, raw, count * word.itemsize), word)]


def _bytes(text: bytes, raw: bool, count: int) -> bytes:
    """Read the first bytes of plain data or of base 64."""
    data = text[:count] if raw else base64.b64decode(text[: 4 * -(-count // 3)])[:count]
    if len(data) < count:
        raise ValueError(f"{len(data)} bytes where {count} should be")
    return data
