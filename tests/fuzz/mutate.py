"""Mutations of files that know the structure of their format: checksums and lengths fit again after a change.

Every function takes a seeded `random.Random` and the bytes of a good file, and returns the bytes of a mutated one. One
mutation in four is of plain bytes, which breaks the structure instead.
"""

import io
import json
import random
import struct
import zlib
from collections.abc import Callable
from typing import Any

import numpy as np

NUMBERS = [
    0, 1, -1, 2, 3, 7, 255, 256, 65535, 1 << 31, (1 << 31) - 1, -(1 << 31), 1 << 53, 1 << 63, 1 << 64, 10**40,
    10**400,
]  # fmt: skip
FLOATS = [0.0, -0.0, 0.5, 1e-300, 1e300, -1e300, 3.4e38, float("nan"), float("inf"), float("-inf")]
TEXTS = ["", "..", "../EVIL", "/etc/passwd", "a/b", "a\\b", "NUL", "con.png", "\0", "\x1b[2J", "\ud800",
         "ü" * 200, "x" * 5000, "simulated", "1", "nan", "true", "[[[[", "{}", "\u202e"]  # fmt: skip
DTYPES = ["<f4", "<f8", "<f2", "<c16", "|O", "<U5", "<i8", "|b1", ">f4", "|V8", "<M8[s]", "|S3", "<i4", "|u1"]


def plain(rng: random.Random, data: bytes) -> bytes:
    """Bytes changed, removed, repeated or inserted, without regard to any structure."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 4, 16))):
        at = rng.randrange(len(out) + 1)
        kind = rng.randrange(6)
        if kind == 0 and at < len(out):
            out[at] ^= 1 << rng.randrange(8)
        elif kind == 1 and at < len(out):
            out[at] = rng.choice((0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256)))
        elif kind == 2:
            del out[at : at + rng.choice((1, 2, 4, 64, len(out)))]
        elif kind == 3:
            out[at:at] = out[at : at + rng.choice((1, 4, 64))] * rng.choice((1, 2, 50))
        elif kind == 4:
            out[at:at] = bytes(rng.randrange(256) for _ in range(rng.choice((1, 4, 9))))
        else:
            form, number = rng.choice((("<I", 32), (">I", 32), ("<H", 16), ("<Q", 64)))
            packed = struct.pack(form, rng.choice(NUMBERS) % (1 << number))
            out[at : at + len(packed)] = packed
    return bytes(out)


def png(rng: random.Random, data: bytes) -> bytes:
    """Chunks changed, reordered, repeated or removed, with checksums that fit; pixels are packed again."""
    chunks, position = [], 8
    while position < len(data):
        (length,) = struct.unpack_from(">I", data, position)
        chunks.append([data[position + 4 : position + 8], data[position + 8 : position + 8 + length]])
        position += 12 + length
    for _ in range(rng.choice((1, 1, 2, 3))):
        chunk = rng.choice(chunks)
        kind = rng.randrange(6)
        if kind == 0 and chunk[0] == b"IDAT":
            chunk[1] = zlib.compress(plain(rng, zlib.decompress(chunk[1])) if _unpacks(chunk[1]) else b"")
        elif kind == 0 and chunk[0] == b"IHDR" and len(chunk[1]) == 13:
            fields = list(struct.unpack(">IIBBBBB", chunk[1]))
            k = rng.randrange(7)
            fields[k] = (
                rng.choice((0, 1, 2, 3, 4, 6, 8, 16, fields[k] + 1)) if k > 1 else abs(rng.choice(NUMBERS)) % (1 << 32)
            )
            chunk[1] = struct.pack(">IIBBBBB", *fields)
        elif kind == 1:
            chunk[1] = plain(rng, chunk[1])
        elif kind == 2:
            chunk[0] = rng.choice(
                (b"IDAT", b"IHDR", b"PLTE", b"tRNS", b"iCCP", b"acTL", b"fdAT", b"gAMA", b"eXIf", b"sBIT", b"zTXt")
            )
        elif kind == 3:
            chunks.insert(rng.randrange(len(chunks)), list(rng.choice(chunks)))
        elif kind == 4 and len(chunks) > 1:
            chunks.remove(chunk)
        else:
            rng.shuffle(chunks)
    return data[:8] + b"".join(
        struct.pack(">I", len(c)) + k + c + struct.pack(">I", zlib.crc32(k + c)) for k, c in chunks
    )


def _unpacks(data: bytes) -> bool:
    try:
        return bool(zlib.decompress(data))
    except zlib.error:
        return False


def npy(rng: random.Random, data: bytes) -> bytes:
    """Another dtype, order or shape in the header, of right or wrong length; or other numbers in the data."""
    start = 10 + int.from_bytes(data[8:10], "little")
    header, body = data[10:start].decode("latin-1"), data[start:]
    kind = rng.randrange(5)
    if kind == 0:
        header = header.replace(header.split("'")[3], rng.choice(DTYPES))
    elif kind == 1:
        left, _, right = header.partition("(")
        shape = ", ".join(str(rng.choice([*NUMBERS[:14], 5, 17])) for _ in range(rng.randrange(5)))
        header = f"{left}({shape}{right[right.index(')') :]}"
    elif kind == 2:
        header = header.replace("False", rng.choice(("True", "None", "0", "()", "__import__('os')", "[" * 50)))
    elif kind == 3 and len(body) >= 8:
        at = rng.randrange(len(body) // 8) * 8
        body = body[:at] + struct.pack("<d", rng.choice(FLOATS)) + body[at + 8 :]
    else:
        header = plain(rng, header.encode("latin-1")).decode("latin-1")
    raw = header.encode("latin-1")[:65535]
    return data[:8] + struct.pack("<H", len(raw)) + raw + body


def tree(rng: random.Random, data: bytes) -> bytes:
    """A value of a JSON tree replaced, removed, repeated or put somewhere else."""
    return json.dumps(changed_tree(rng, json.loads(data))).encode("utf-8", "surrogatepass")


def changed_tree(rng: random.Random, value: Any) -> Any:
    """The tree with one to three places changed."""
    root = [value]
    for _ in range(rng.choice((1, 1, 2, 3))):
        places: list[tuple[Any, Any]] = []
        _places(root, places, 400)
        place, key = rng.choice(places)
        kind = rng.randrange(5)
        if kind == 0:
            place[key] = rng.choice(
                (None, True, [], {}, rng.choice(NUMBERS[:-1]), rng.choice(FLOATS), rng.choice(TEXTS))
            )
        elif kind == 1 and isinstance(place[key], int | float):
            place[key] = rng.choice(
                (-place[key], place[key] + 1, str(place[key]), [place[key]], rng.choice(NUMBERS[:-1]))
            )
        elif kind == 2 and place is not root:
            del place[key]
        elif kind == 3 and isinstance(place, list) and place is not root:
            place.insert(key, place[key])
        else:
            other, name = rng.choice(places)
            place[key] = json.loads(json.dumps(other[name]))
    return root[0] if root else None


def _places(value: Any, found: list[tuple[Any, Any]], most: int) -> None:
    for key in list(value) if isinstance(value, dict) else range(len(value)):
        if len(found) < most:
            found.append((value, key))
            if isinstance(value[key], dict | list):
                _places(value[key], found, most)


def lines(rng: random.Random, data: bytes) -> bytes:
    """Lines of a text removed, repeated or exchanged, and values replaced."""
    rows = data.decode("utf-8", "replace").split("\n")
    for _ in range(rng.choice((1, 1, 2, 3))):
        k = rng.randrange(len(rows))
        kind = rng.randrange(5)
        if kind == 0 and " = " in rows[k]:
            value = rng.choice(
                [*map(str, NUMBERS), *map(str, FLOATS), *(json.dumps(t) for t in TEXTS), "1979-05-27", "[1, 2]", "{}"]
            )
            rows[k] = rows[k].split(" = ")[0] + " = " + value
        elif kind == 1:
            rows.insert(k, rng.choice(rows))
        elif kind == 2 and len(rows) > 1:
            del rows[k]
        elif kind == 3:
            words = rows[k].split(" ")
            words[rng.randrange(len(words))] = rng.choice([*TEXTS, *map(str, NUMBERS)])
            rows[k] = " ".join(words)
        else:
            rows[k] = plain(rng, rows[k].encode("utf-8", "replace")).decode("utf-8", "replace")
    return "\n".join(rows).encode("utf-8", "replace")


def jsonl(rng: random.Random, data: bytes) -> bytes:
    """One line of a log changed as a tree."""
    rows = data.split(b"\n")
    k = rng.randrange(len(rows))
    rows[k] = tree(rng, rows[k]) if rows[k].startswith(b"{") else plain(rng, rows[k])
    return b"\n".join(rows)


def npz(rng: random.Random, data: bytes) -> bytes:
    """Arrays of an .npz changed, cast, reshaped, exchanged or removed."""
    entries = _entries(data)
    for _ in range(rng.choice((1, 1, 2))):
        change_array(rng, entries)
    return _packed(entries)


def change_array(rng: random.Random, entries: dict[str, np.ndarray]) -> None:
    """One entry changed in place."""
    name = rng.choice(list(entries))
    array, kind = entries[name], rng.randrange(6)
    if kind == 0 and array.size and array.dtype.kind == "f":
        entries[name] = array = array.copy()
        with np.errstate(over="ignore"):
            array.reshape(-1)[rng.randrange(array.size)] = rng.choice(FLOATS)
    elif kind == 1:
        with np.errstate(all="ignore"):
            entries[name] = array.astype(rng.choice(("<f4", "<f8", "<f2", "<i8", "|b1", ">f4", "|u1")))
    elif kind == 2:
        entries[name] = (
            array.reshape(rng.choice(((-1,), (1, -1), (-1, 1), array.shape[::-1]))) if array.size else array[None]
        )
    elif kind == 3:
        entries[name] = array[..., : rng.randrange(3)] if array.ndim else array[None]
    elif kind == 4 and len(entries) > 1:
        del entries[name]
    else:
        entries[rng.choice([*entries, "../EVIL", "x"])] = array


def checkpoint(rng: random.Random, data: bytes) -> bytes:
    """A checkpoint whose arrays or header are changed, mostly with the checksums that then fit."""
    from endotsr.training.fitting.checkpoint import digest

    entries = _entries(data)
    header = json.loads(entries.pop("header").tobytes())
    if rng.randrange(2):
        change_array(rng, entries)
    else:
        header = changed_tree(rng, header)
    if rng.randrange(4) and isinstance(header, dict):
        header["arrays"] = {name: [a.dtype.str, list(a.shape), digest(a)] for name, a in entries.items()}
    text = json.dumps(header).encode("utf-8", "surrogatepass")
    return _packed({"header": np.frombuffer(text, np.uint8), **entries})


def _entries(data: bytes) -> dict[str, np.ndarray]:
    with np.load(io.BytesIO(data)) as file:
        return {name: file[name] for name in file.files}


def _packed(entries: dict[str, np.ndarray]) -> bytes:
    out = io.BytesIO()
    np.savez(out, **entries)
    return out.getvalue()


def mat(rng: random.Random, data: bytes) -> bytes:
    """The content of an element of a MAT-file changed, which is packed again, or its length and kind."""
    elements, place = [], 128
    while place + 8 <= len(data):
        kind, size = struct.unpack_from("<II", data, place)
        elements.append([kind, data[place + 8 : place + 8 + size]])
        place += 8 + size
    one = rng.choice(elements)
    content = zlib.decompress(one[1]) if one[0] == 15 else one[1]
    if rng.randrange(3):
        content = _one_word(rng, content)
    else:
        content = plain(rng, content)
    one[1] = zlib.compress(content) if one[0] == 15 else content
    if not rng.randrange(4):
        elements.insert(rng.randrange(len(elements)), list(rng.choice(elements)))
    return data[:128] + b"".join(struct.pack("<II", kind, len(part)) + part for kind, part in elements)


def _one_word(rng: random.Random, data: bytes) -> bytes:
    """One aligned word replaced: lengths, kinds, flags, dimensions and halves of numbers are words."""
    at = 4 * rng.randrange(max(len(data) // 4, 1))
    word = rng.choice((0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 13, 14, 15, 16, 17, 0xFF, 1 << 16, 0x7FF00000, 0xFFFFFFFF))
    return data[:at] + struct.pack("<I", word) + data[at + 4 :]


def riff(rng: random.Random, data: bytes) -> bytes:
    """A chunk of an AVI file changed, removed, repeated or renamed; the lengths of the lists around it fit again."""

    def changed(part: bytes, depth: int) -> bytes:
        chunks, place = [], 0
        while place + 8 <= len(part):
            size = struct.unpack_from("<I", part, place + 4)[0]
            chunks.append([part[place : place + 4], part[place + 8 : place + 8 + size]])
            place += 8 + size + size % 2
        k = rng.randrange(len(chunks)) if chunks else 0
        kind = rng.randrange(5)
        if chunks and chunks[k][0] in (b"RIFF", b"LIST") and depth < 4 and rng.randrange(8):
            chunks[k][1] = chunks[k][1][:4] + changed(chunks[k][1][4:], depth + 1)
        elif chunks and kind < 2:
            chunks[k][1] = plain(rng, chunks[k][1]) if kind else _one_word(rng, chunks[k][1])
        elif chunks and kind == 2:
            del chunks[k]
        elif chunks and kind == 3:
            chunks.insert(k, list(chunks[k]))
        elif chunks:
            chunks[k][0] = rng.choice(
                (b"LIST", b"strh", b"strf", b"vprp", b"idx1", b"JUNK", b"00dc", b"indx", b"\0\0\0\0")
            )
        return b"".join(n + struct.pack("<I", len(c)) + c + b"\0" * (len(c) % 2) for n, c in chunks)

    return changed(data, 0)


def rearranged(
    rng: random.Random, found: list[bytes], first: int, kinds: int, changed: Callable[[bytes, int], bytes]
) -> list[bytes]:
    """Pieces from `first` on removed, repeated, exchanged, or changed in one of `kinds` - 3 ways."""
    for _ in range(rng.choice((1, 1, 2, 4))):
        k, other = rng.randrange(first, len(found)), rng.randrange(first, len(found))
        kind = rng.randrange(kinds)
        if kind == 0 and len(found) > first + 1:
            del found[k]
        elif kind == 1:
            found.insert(other, found[k])
        elif kind == 2:
            found[k], found[other] = found[other], found[k]
        else:
            found[k] = changed(found[k], kind)
    return found


def packets(rng: random.Random, data: bytes) -> bytes:
    """Packets of a transport stream removed, repeated, exchanged, or changed behind their first byte."""

    def changed(packet: bytes, _: int) -> bytes:
        at = rng.randrange(1, rng.choice((5, 24, 188)))
        return (packet[:at] + bytes([rng.choice((0, 1, 0x40, 0x7F, 0xFF, rng.randrange(256)))]))[:188] + packet[
            at + 1 :
        ]

    return b"".join(rearranged(rng, [data[k : k + 188] for k in range(0, len(data), 188)], 0, 6, changed))


def parts(rng: random.Random, data: bytes) -> bytes:
    """Parts of an MPEG stream, which begin with 0 0 1, removed, repeated, exchanged, renumbered or changed."""

    def changed(part: bytes, kind: int) -> bytes:
        if kind == 3:
            number = rng.choice((0, 1, 0xB3, 0xB5, 0xB8, 0xB9, 0xBA, 0xBB, 0xBC, 0xBD, 0xBE, 0xE0, 0xFF))
            return bytes([number]) + part[1:]
        return plain(rng, part[:24]) + part[24:]

    return b"\0\0\1".join(rearranged(rng, data.split(b"\0\0\1"), 1, 5, changed))


def ply(rng: random.Random, data: bytes) -> bytes:
    """Lines of the header changed, or numbers of the body."""
    head, mark, body = data.partition(b"end_header\n")
    if rng.randrange(2):
        return lines(rng, head) + mark + body
    return head + mark + plain(rng, body)
