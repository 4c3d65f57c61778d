"""Mutations of files for ``hardening.py``: of bytes, and of what archives and HDF5 files hold."""

from __future__ import annotations

import hashlib
import io
import json
import random
import re
import sqlite3
import zipfile
from pathlib import Path

import h5py
import numpy as np

NUMBER = re.compile(rb"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
# What numbers turn into when something goes wrong, or when somebody wants it to.
EVIL_NUMBERS = (
    b"nan", b"NaN", b"inf", b"-inf", b"-1", b"0", b"-0.0", b"1e400", b"-1e400", b"1e308",
    b"1e-320", b"99999999999999999999999", b"18446744073709551616", b"2147483648",
    b"-9223372036854775809", b"0x10", b"1_000", b"1e", b"true", b"\xd9\xa3", b'""', b"[]", b"{}",
    b"9" * 5000,
)  # fmt: skip
TOKENS = (
    b"", b" ", b"\n", b"\r", b"\r\n", b"\t", b",", b";", b'"', b"'", b"=", b"[", b"]", b"{", b"}",
    b"#", b"\x00", b"\xff", b"\xef\xbb\xbf", "é".encode(), "\u202e".encode(), "𝟛".encode(),
    b"\xed\xa0\x80", b"%s%n", b"${HOME}", b"../../../etc/passwd", b"/dev/zero", b"\\u0000",
    b"__import__('os')", b"cos\nsystem\n(S'touch owned'\ntR.", b"A" * 3000,
)  # fmt: skip
DEEP = (b"[" * 4000, b"a = " + b"[" * 3000, b"a" + b".a" * 3000 + b" = 1\n", b"{a=" * 2000,
        b"[" + b"a." * 3000 + b"a]\n", b'{"a":' * 3000, b"(" * 3000)  # fmt: skip


def mutated(content: bytes, rng: random.Random) -> bytes:
    """One file with one to eight faults in its bytes."""
    out = bytearray(content)
    for _ in range(rng.choice((1, 1, 1, 2, 4, 8))):
        out = _BYTES[rng.randrange(len(_BYTES))](out, rng)
    return bytes(out)


def _at(out: bytearray, rng: random.Random) -> int:
    return rng.randrange(len(out) + 1)


def _bit(out: bytearray, rng: random.Random) -> bytearray:
    if out:
        out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)
    return out


def _byte(out: bytearray, rng: random.Random) -> bytearray:
    at = _at(out, rng)
    out[at : at + 1] = bytes([rng.randrange(256)])
    return out


def _cut(out: bytearray, rng: random.Random) -> bytearray:
    return out[: _at(out, rng)]


def _drop(out: bytearray, rng: random.Random) -> bytearray:
    at = _at(out, rng)
    del out[at : at + rng.choice((1, 4, 30, 300))]
    return out


def _repeat(out: bytearray, rng: random.Random) -> bytearray:
    at = _at(out, rng)
    block = out[at : at + rng.choice((1, 8, 60, 600))]
    out[at:at] = block * rng.choice((1, 1, 3, 50))
    return out


def _swap(out: bytearray, rng: random.Random) -> bytearray:
    a, b = sorted((_at(out, rng), _at(out, rng)))
    size = min(rng.choice((1, 8, 60)), b - a)
    out[a : a + size], out[b : b + size] = out[b : b + size], out[a : a + size]
    return out


def _noise(out: bytearray, rng: random.Random) -> bytearray:
    at = _at(out, rng)
    out[at:at] = rng.randbytes(rng.choice((1, 4, 64)))
    return out


def _token(out: bytearray, rng: random.Random) -> bytearray:
    at = _at(out, rng)
    out[at : at + rng.randrange(4)] = rng.choice(TOKENS)
    return out


def _number(out: bytearray, rng: random.Random) -> bytearray:
    found = list(NUMBER.finditer(out[:20_000]))
    if found:
        one = rng.choice(found)
        out[one.start() : one.end()] = rng.choice(EVIL_NUMBERS)
    return out


def _line(out: bytearray, rng: random.Random) -> bytearray:
    lines = out.split(b"\n")
    a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
    if rng.randrange(2):
        lines[a], lines[b] = lines[b], lines[a]
    else:
        lines[a:a] = [lines[b]] * rng.choice((1, 2, 100))
    return bytearray(b"\n".join(lines))


def _deep(out: bytearray, rng: random.Random) -> bytearray:
    at = out.find(b"\n", _at(out, rng)) + 1
    out[at:at] = rng.choice(DEEP)
    return out


# Numbers are what most formats are made of.
_BYTES = (
    _bit, _byte, _cut, _drop, _repeat, _swap, _noise, _token, _token, _number, _number, _number,
    _line, _deep,
)  # fmt: skip


def odd_array(array: np.ndarray, rng: random.Random) -> np.ndarray:
    """An array that is not what it was: other numbers, size, shape or type."""
    kind = rng.randrange(9)
    out = np.array(array)
    if kind <= 2 and out.size and out.dtype.kind in "fiub":
        flat = out.reshape(-1).astype(np.float64) if out.dtype.kind == "b" else out.reshape(-1)
        evil = (
            (np.nan, np.inf, -np.inf, -1.0, 0.0, 1e308, 1e-320)
            if flat.dtype.kind == "f"
            else (-1, 0, 2**31 - 1, np.iinfo(flat.dtype).max, np.iinfo(flat.dtype).min)
        )
        where = slice(None) if kind == 0 else rng.randrange(flat.size)
        with np.errstate(all="ignore"):
            flat[where] = np.array(rng.choice(evil)).astype(flat.dtype)
        return flat.reshape(out.shape)
    if kind == 3:
        return out.reshape(-1)[: out.size // 2]
    if kind == 4:
        return out[..., None] if out.ndim < 4 else out.reshape(-1)
    if kind == 5:
        with np.errstate(all="ignore"):
            return out.astype(rng.choice(("f4", "i8", "u1", "c16"))) if out.dtype.kind in "fiu" \
                else np.zeros(3)  # fmt: skip
    if kind == 6:
        return np.array(["text"] * max(1, min(out.size, 5)))
    if kind == 7:
        return np.empty(0)
    return np.concatenate([out, out]) if out.ndim else np.array([out, out])


class _Touches:
    """What a pickle may do when it is loaded: leave a file behind."""

    def __reduce__(self) -> tuple:
        return (Path.touch, (Path("owned"),))


def odd_archive(content: bytes, rng: random.Random) -> bytes:
    """An ``.npz`` whose check sums are right but whose members are not what they were."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = rng.choice(sorted(members))
    kind = rng.randrange(8)
    if kind == 0:
        del members[name]
    elif kind == 1:
        members[name] = members[rng.choice(sorted(members))]
    elif kind == 2:  # a pickle in the place of an array
        stream = io.BytesIO()
        np.save(stream, np.array([_Touches()], dtype=object), allow_pickle=True)
        members[name] = stream.getvalue()
    elif kind == 3:  # a size that the file does not have
        members[name] = re.sub(
            rb"'shape': \([^)]*\)", rng.choice((b"'shape': (99999999999,)",
            b"'shape': (-1,)", b"'shape': (4294967296, 4294967296)")), members[name],
        )  # fmt: skip
    elif kind == 4:
        members[name] = mutated(members[name], rng)
    else:
        stream = io.BytesIO()
        array = np.load(io.BytesIO(members[name]), allow_pickle=False)
        if array.dtype.kind == "U" and array.ndim == 0:  # JSON
            array = np.array(mutated(str(array).encode(), rng).decode("utf-8", "replace"))
        else:
            array = odd_array(array, rng)
        np.save(stream, array, allow_pickle=False)
        members[name] = stream.getvalue()
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for key, value in members.items():
            archive.writestr(key, value)
    return stream.getvalue()


def odd_closure(content: bytes, rng: random.Random) -> bytes:
    """A ``.closure`` with a right seal over a wrong archive."""
    magic, seal, payload = content.split(b"\n", 2)
    del seal
    payload = odd_archive(payload, rng) if rng.randrange(4) else mutated(payload, rng)
    return magic + b"\n" + hashlib.sha256(payload).hexdigest().encode() + b"\n" + payload


def odd_json(content: bytes, rng: random.Random) -> bytes:
    """JSON with a value that is not what it was."""
    table = json.loads(content)
    here, key = table, None
    while isinstance(here, dict | list) and here and (key is None or rng.randrange(4)):
        holder = here
        key = rng.choice(list(here)) if isinstance(here, dict) else rng.randrange(len(here))
        here = here[key]
    values = (None, "x", -1, 0, 1e308, float("nan"), float("inf"), [], {}, [[]], True, "9" * 400)
    holder[key] = rng.choice(values)
    return json.dumps(table).encode()


def odd_hdf5(content: bytes, rng: random.Random) -> bytes:
    """An HDF5 file with right check sums, in which an object or an attribute is another one."""
    stream = io.BytesIO(content)
    with h5py.File(stream, "r+") as root:
        names: list[str] = []
        root.visit(names.append)
        name = rng.choice(names) if names else None
        kind = rng.randrange(10)
        if kind <= 3 or name is None:
            _odd_attribute(root if name is None or rng.randrange(2) else root[name], rng)
        else:
            item = root[name]
            before = item[()] if isinstance(item, h5py.Dataset) else None
            marks = dict(item.attrs)
            del root[name]
            if kind == 4:
                pass
            elif kind == 5:
                root.create_group(name)
            elif kind == 6:
                root[name] = rng.choice((
                    h5py.SoftLink("/"), h5py.SoftLink(f"/{name}"), h5py.SoftLink("/nothing"),
                    h5py.ExternalLink("/etc/passwd", "/"),
                ))  # fmt: skip
            elif kind == 7:  # declared, never written
                root.create_dataset(name, (rng.choice((10**8, 10**12)),), "f8", chunks=(1024,))
            elif kind == 8:  # bytes of another file
                root.create_dataset(
                    name, (8,), "f8", external=[("/etc/passwd", 0, h5py.h5f.UNLIMITED)]
                )
            elif before is not None:
                value = np.asarray(before)
                odd = odd_array(value, rng) if value.dtype.kind in "fiu" else np.zeros(3)
                root[name] = odd.astype("S4") if odd.dtype.kind == "U" else odd
            if name in root and kind in (5, 7, 9):
                for key, value in marks.items():
                    root[name].attrs[key] = value
    return stream.getvalue()


def _odd_attribute(item: h5py.Group | h5py.Dataset, rng: random.Random) -> None:
    if not len(item.attrs):
        return
    key = rng.choice(sorted(item.attrs))
    old = item.attrs[key]
    text = old if isinstance(old, bytes) else str(old).encode()
    kind = rng.randrange(5)
    if kind == 0:
        del item.attrs[key]
    elif kind == 1:
        item.attrs[key] = rng.choice((-1, 2**62, np.nan, np.inf, np.zeros((2, 2))))
    else:
        changed = mutated(text, rng).replace(b"\x00", b"")[:60_000] or b"x"
        item.attrs[key] = np.bytes_(changed)


def odd_store(content: bytes, rng: random.Random, folder: Path) -> bytes:
    """A SQLite store in which a cell is another one."""
    path = folder / "odd.sqlite"
    path.write_bytes(content)
    with sqlite3.connect(path) as file:
        column = rng.choice(("experiment", "parameters", "seed", "results", "error", "seconds"))
        value = rng.choice((None, "x", b"\xff\x00", "{", "[]", "{}", -1, 2**62, 1e308, "null"))
        if rng.randrange(6) == 0:
            file.execute(f"ALTER TABLE runs RENAME COLUMN {column} TO other")
        else:
            file.execute(f"UPDATE runs SET {column} = ?", (value,))
    file.close()
    return path.read_bytes()
