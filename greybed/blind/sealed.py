"""Hands sets over as folders with nothing but a study and a table; answers are sealed elsewhere."""

from __future__ import annotations

import hashlib
import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from greybed.blind.generate import BlindSet
from greybed.core.files import atomic_path

# column -> units that a laboratory writes it in, with the factor from SI and the offset
UNITS = {
    "diameter": (("mm", 1e3, 0.0), ("um", 1e6, 0.0), ("m", 1.0, 0.0)),
    "particle_diameter": (("mm", 1e3, 0.0), ("um", 1e6, 0.0)),
    "tube_diameter": (("mm", 1e3, 0.0), ("cm", 1e2, 0.0)),
    "mean_free_path": (("nm", 1e9, 0.0), ("um", 1e6, 0.0)),
    "wall_distance": (("mm", 1e3, 0.0),),
    "bed_length": (("m", 1.0, 0.0), ("cm", 1e2, 0.0)),
    "particle_density": (("kg/m3", 1.0, 0.0), ("g/cm3", 1e-3, 0.0)),
    "fluid_density": (("kg/m3", 1.0, 0.0),),
    "temperature": (("K", 1.0, 0.0), ("degC", 1.0, -273.15)),
    "superficial_velocity": (("m/s", 1.0, 0.0), ("cm/s", 1e2, 0.0)),
    "velocity": (("m/s", 1.0, 0.0), ("mm/s", 1e3, 0.0), ("cm/s", 1e2, 0.0)),
    "pressure_gradient": (("Pa/m", 1.0, 0.0), ("kPa/m", 1e-3, 0.0)),
    "outlet_pressure": (("Pa", 1.0, 0.0), ("kPa", 1e-3, 0.0), ("bar", 1e-5, 0.0)),
    "gas_pressure": (("Pa", 1.0, 0.0), ("mbar", 1e-2, 0.0)),
    "stress": (("kPa", 1e-3, 0.0), ("MPa", 1e-6, 0.0)),
    "conductivity": (("W/m/K", 1.0, 0.0), ("mW/m/K", 1e3, 0.0)),
    "gas_conductivity": (("W/m/K", 1.0, 0.0),),
}
DIGITS = 7


def write_set(folder: Path, made: BlindSet, seed: int, index: int) -> None:
    """Write ``study.toml`` and ``data.csv``, in units that differ from set to set."""
    rng = np.random.default_rng([seed, 3, index])
    folder.mkdir(parents=True, exist_ok=True)
    headers, columns = [], []
    for name, values in made.columns.items():
        choices = UNITS.get(name)
        if choices is None:
            headers.append(name)
            columns.append([f"{v:.{DIGITS}g}" for v in values])
            continue
        unit, factor, offset = choices[int(rng.integers(len(choices)))]
        headers.append(f"{name} [{unit}]")
        columns.append([f"{v * factor + offset:.{DIGITS}g}" for v in values])
    for name, words in made.labels.items():
        headers.append(name)
        columns.append(words)
    order = rng.permutation(len(headers))
    with atomic_path(folder / "data.csv") as temporary, open(temporary, "w") as stream:
        stream.write(",".join(headers[i] for i in order) + "\n")
        for row in zip(*(columns[i] for i in order), strict=True):
            stream.write(",".join(row) + "\n")
    with atomic_path(folder / "study.toml") as temporary, open(temporary, "wb") as stream:
        tomli_w.dump(made.study, stream)


def _stream(seed: int, size: int) -> bytes:
    blocks = (hashlib.sha256(f"{seed}:{k}".encode()).digest() for k in range(size // 32 + 1))
    return b"".join(blocks)[:size]


def seal(path: Path, answers: list[dict[str, Any]], seed: int) -> None:
    """Write the answers so that no search of the files finds them."""
    plain = zlib.compress(json.dumps(answers).encode())
    mask = np.frombuffer(_stream(seed, len(plain)), dtype=np.uint8)
    with atomic_path(path) as temporary:
        temporary.write_bytes((np.frombuffer(plain, dtype=np.uint8) ^ mask).tobytes())


def unseal(path: Path, seed: int) -> list[dict[str, Any]]:
    """Read the answers of a finished test."""
    hidden = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    mask = np.frombuffer(_stream(seed, len(hidden)), dtype=np.uint8)
    answers: list[dict[str, Any]] = json.loads(zlib.decompress((hidden ^ mask).tobytes()))
    return answers
