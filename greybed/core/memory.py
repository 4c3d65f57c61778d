"""Memory that a run will take, part by part, before it takes it; refused where it cannot fit."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from greybed.core.errors import InputError

# Interpreter, libraries and compiled loops, whatever the case [bytes].
LIBRARIES = 230 << 20
# Measured as the slope of the peak between two sizes (docs/hardening.md) [bytes].
PER_GAS_CELL = 650
PER_TWO_FLUID_CELL = 750
PER_PARTICLE = 2200
# While a bed is traced in blocks, for each sphere; its factors stay on disk.
PER_TRACED_SPHERE = 6500


def available_memory() -> int | None:
    """Bytes that this process may still take: of the machine, or of its container; None unknown."""
    found = []
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                found.append(int(line.split()[1]) * 1024)
        limit = Path("/sys/fs/cgroup/memory.max")
        used = Path("/sys/fs/cgroup/memory.current")
        if limit.exists() and limit.read_text().strip() != "max":
            found.append(int(limit.read_text()) - int(used.read_text()))
    except (OSError, ValueError):
        pass
    return min(found) if found else None


def check_memory(parts: Mapping[str, int], remedy: str, *, most: int | None = None) -> list[str]:
    """Lines of a table of what a run will take, or a refusal.

    Parameters
    ----------
    parts : mapping of str to int
        Bytes of each part, without the libraries.
    remedy : str
        What to do where it is too much.
    most : int, optional
        Bytes that there are; by default those of :func:`available_memory`.

    Raises
    ------
    InputError
        If it is more than there is.
    """
    rows = {"libraries and compiled loops": LIBRARIES, **parts}
    total = sum(rows.values())
    have = available_memory() if most is None else most
    if have is not None and total > have:
        largest = max(rows, key=lambda name: rows[name])
        raise InputError(
            f"memory: the run needs about {_shown(total)} ({largest}: {_shown(rows[largest])}), "
            f"and {_shown(have)} are available; {remedy}."
        )
    lines = [f"memory: {name}: {_shown(size)}" for name, size in rows.items()]
    there = "" if have is None else f" of {_shown(have)} available"
    return [*lines, f"memory: about {_shown(total)}{there}"]


def _shown(size: int) -> str:
    return f"{size / 1e9:.2f} GB" if size >= 1e9 else f"{size / 1e6:.0f} MB"
