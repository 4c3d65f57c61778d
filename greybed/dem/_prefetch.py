"""Tell the processor which rows of an array come next, where no pattern foretells it."""

from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.extending import intrinsic


def _prefetch(typing, array, index):
    """Bring ``array[index]``, flat, near to the processor; has no other effect."""

    def emit(context, builder, signature, arguments):
        data, at = arguments
        view = context.make_array(signature.args[0])(context, builder, data)
        place = builder.bitcast(builder.gep(view.data, [at]), ir.IntType(8).as_pointer())
        number = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [place.type, number, number, number])
        call = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0i8")
        # To read, into every level, data.
        builder.call(call, [place, number(0), number(3), number(1)])
        return context.get_dummy_value()

    return types.void(array, index), emit


def _nothing(array, index):
    """Stands in where kernels are plain Python, as to find a fault in them."""


prefetch = _nothing if config.DISABLE_JIT else intrinsic(_prefetch)
