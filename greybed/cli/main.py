"""Entry point of ``greybed``: finds the verb, runs it, turns errors into one sentence."""

from __future__ import annotations

import _thread
import argparse
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any, NoReturn

from greybed._version import __version__

# verb -> (module, one line for --help); a module is imported only when its verb is used,
# so that ``greybed --help`` answers at once.
VERBS = {
    "quickstart": ("quickstart", "from two settled beds to a trained, exported, running closure"),
    "info": ("info", "describe a packing: spheres, box, overlaps, coordination"),
    "convert": ("convert", "convert a packing: dump, CSV, HDF5, VTK, VTU, meshes"),
    "pack": ("pack", "generate a random packing at a given solid fraction"),
    "trace": ("trace", "ray trace a packing into view factors with error bars"),
    "dataset": ("dataset", "make a data set for training"),
    "train": ("train", "train a closure from a data set"),
    "check": ("check", "check a closure's limiting cases and golden rows"),
    "export": ("export", "export a closure to C++ or ONNX"),
    "campaign": ("campaign", "run a case with many values, on one machine or a cluster"),
    "host": ("host", "put a closure into LAMMPS, LIGGGHTS or OpenFOAM"),
    "simulate": ("simulate", "run a coupled case from a TOML file"),
    "calibrate": ("calibrate", "find parameters from measured bulk behaviour, and their ambiguity"),
    "diagnose": ("diagnose", "trace a residual to the effect that a model lacks"),
    "blindtest": ("blindtest", "test the residual analysis on sealed data sets"),
    "doctor": ("doctor", "check the installation, compilers and engines"),
    "completion": ("completion", "print completion for bash, zsh or fish"),
}


# What a newcomer sees without arguments.
FIRST = """Grey-box closures for particle beds. Three ways in:

  greybed doctor                              what is installed, and what each part is for
  greybed quickstart --out runs/quickstart    traced beds, trained closures, a page: two minutes
  greybed simulate CASE.toml --out runs/mine  a case; those below examples/ are there to start from

greybed --help lists the verbs, greybed VERB --help explains one.
"""


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one sentence, without the usage lines before it."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message}; {self.prog} --help explains.\n")


def _parser() -> argparse.ArgumentParser:
    lines = "\n".join(f"  {verb:<12}{text}" for verb, (_, text) in VERBS.items())
    parser = _Parser(
        prog="greybed",
        usage="greybed VERB [options]",
        description="Grey-box closures for particle beds.",
        epilog=f"verbs:\n{lines}\n\ngreybed VERB --help explains one verb, with an example.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"greybed {__version__}")
    parser.add_argument("verb", nargs="?", help=argparse.SUPPRESS)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb; returns 0 done, 1 a check failed, 2 bad input, 130 interrupted."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    parser = _parser()
    if not words:
        print(FIRST, end="")
        return 0
    if words[0].startswith("-"):
        parser.parse_args(words)
        parser.print_help()
        return 0
    verb, rest = words[0], words[1:]
    if verb not in VERBS:
        parser.error(f"unknown verb {verb!r}; one of: {', '.join(VERBS)}")
    before = sys.unraisablehook
    sys.unraisablehook = _keep_interrupt(before)
    known: tuple[type[Exception], ...] = ()
    try:
        with _interrupt_later():
            # Here, for numpy takes a while to load.
            from greybed.core.errors import GreybedError

            known = (GreybedError,)
            module = import_module(f"greybed.cli.{VERBS[verb][0]}")
        verb_parser = _Parser(
            prog=f"greybed {verb}",
            description=module.__doc__,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add_arguments(verb_parser)
        code = int(module.run(verb_parser.parse_args(rest)) or 0)
        sys.stdout.flush()  # here, where a full disk or a closed pipe can still be told
        return code
    except KeyboardInterrupt:
        print(f"greybed {verb}: interrupted; what was finished is kept.", file=sys.stderr)
        return 130
    except known as error:
        print(f"greybed {verb}: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:  # as in ``greybed info bed.dump | head -1``
        _forget_stdout()
        return 0
    except OSError as error:  # what no verb foresaw: quotas, lost mounts, names too long
        place = f"{error.filename}: " if error.filename else ""
        print(
            f"greybed {verb}: {place}the system refused ({error.strerror or error}); check the "
            "path, the free space and the permissions.",
            file=sys.stderr,
        )
        _forget_stdout()
        return 2
    except MemoryError as error:
        print(
            f"greybed {verb}: not enough memory ({error or 'no amount given'}); ask for fewer "
            "spheres or rays, or take a larger machine.",
            file=sys.stderr,
        )
        return 2
    finally:
        sys.unraisablehook = before


@contextmanager
def _interrupt_later() -> Iterator[None]:
    """Hold a Ctrl-C back until libraries are loaded: numpy makes an ImportError of it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.getsignal(signal.SIGINT)
    if before in (signal.SIG_IGN, None):
        yield
        return
    came: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if came:
        raise KeyboardInterrupt


def _forget_stdout() -> None:
    """Keep the interpreter from flushing, at its end, a standard output that takes nothing."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _keep_interrupt(otherwise: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Send Ctrl-C once more where it was swallowed, as by the callbacks of Numba's compiler."""

    def hook(unraisable: Any) -> None:
        if unraisable.exc_type is KeyboardInterrupt:
            again = threading.Timer(0.05, _thread.interrupt_main)
            again.daemon = True
            again.start()
        else:
            otherwise(unraisable)

    return hook
