"""Counters that threads share: numbers in memory that one thread changes while others look on."""

import platform
import sys

from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.extending import intrinsic

_X86 = platform.machine().lower() in ("x86_64", "amd64", "i686")


def _address(context, builder, kind, array, at):
    return builder.gep(context.make_array(kind)(context, builder, array).data, [at])


def _add(typing, array, index, number):
    """Add to ``array[index]`` in one piece; returns what was there."""

    def emit(context, builder, signature, arguments):
        where = _address(context, builder, signature.args[0], *arguments[:2])
        return builder.atomic_rmw("add", where, arguments[2], "acq_rel")

    return types.int64(array, types.int64, types.int64), emit


def _look(typing, array, index):
    """``array[index]`` as it is now; what its writer wrote before it is seen after this."""

    def emit(context, builder, signature, arguments):
        where = _address(context, builder, signature.args[0], *arguments)
        return builder.load_atomic(where, "acquire", 8)

    return types.int64(array, types.int64), emit


def _put(typing, array, index, number):
    """Write ``array[index]``, after all that this thread has written before."""

    def emit(context, builder, signature, arguments):
        where = _address(context, builder, signature.args[0], *arguments[:2])
        builder.store_atomic(arguments[2], where, "release", 8)
        return context.get_dummy_value()

    return types.void(array, types.int64, types.int64), emit


def _rest(typing, long):
    """Wait for a moment; where it has been long, let other programs use the processor."""

    def emit(context, builder, signature, arguments):
        if sys.platform != "win32":
            with builder.if_then(arguments[0], likely=False):
                kind = ir.FunctionType(ir.IntType(32), [])
                call = cgutils.get_or_insert_function(builder.module, kind, "sched_yield")
                builder.call(call, [])
        if _X86:
            kind = ir.FunctionType(ir.VoidType(), [])
            name = "llvm.x86.sse2.pause"
            builder.call(cgutils.get_or_insert_function(builder.module, kind, name), [])
        return context.get_dummy_value()

    return types.void(types.boolean), emit


# Where kernels are plain Python, one thread does everything.
def _plain_add(array, index, number):
    array[index] += number
    return array[index] - number


def _plain_look(array, index):
    return array[index]


def _plain_put(array, index, number):
    array[index] = number


def _plain_rest(long):
    return None


if config.DISABLE_JIT:
    add, look, put, rest = _plain_add, _plain_look, _plain_put, _plain_rest
else:
    add, look, put, rest = map(intrinsic, (_add, _look, _put, _rest))
