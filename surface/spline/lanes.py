"""Eight float32 numbers as one value inside compiled kernels.

Sums over control points stay in registers this way, whatever the loop around them looks like. LLVM turns the
operations into AVX, SSE or NEON instructions.
"""

# mypy: allow-untyped-defs, allow-untyped-calls, allow-incomplete-defs, disable-error-code="import-untyped"
from __future__ import annotations

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic, models, register_model

LANES = 8
VECTOR = ir.VectorType(ir.FloatType(), LANES)
INDEX = ir.IntType(32)
FLAGS = ("contract", "nsz", "arcp")  # a multiplication and an addition may become one instruction


class LanesType(types.Type):
    """numba's name for the vector."""

    def __init__(self) -> None:
        super().__init__(name="float32x8")


lanes = LanesType()


@register_model(LanesType)
class LanesModel(models.PrimitiveModel):
    """The vector lives in an LLVM vector register."""

    def __init__(self, manager, kind) -> None:
        super().__init__(manager, kind, VECTOR)


def _pointer(context, builder, kind, array, index):
    """Address of ``array[index]`` as a pointer to a vector."""
    data = context.make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [index]), VECTOR.as_pointer())


def _splat(builder, number):
    """A vector with the same number in every lane."""
    single = builder.insert_element(ir.Constant(VECTOR, ir.Undefined), number, ir.Constant(INDEX, 0))
    mask = ir.Constant(ir.VectorType(INDEX, LANES), [0] * LANES)
    return builder.shuffle_vector(single, ir.Constant(VECTOR, ir.Undefined), mask)


@intrinsic
def zero(typingctx):
    """All lanes 0."""

    def generate(context, builder, signature, args):
        return ir.Constant(VECTOR, [0.0] * LANES)

    return lanes(), generate


@intrinsic
def load(typingctx, array, index):
    """``array[index : index + 8]``."""

    def generate(context, builder, signature, args):
        return builder.load(_pointer(context, builder, signature.args[0], *args), align=4)

    return lanes(array, types.intp), generate


@intrinsic
def prefetch(typingctx, array, index):
    """Ask for the cache line of ``array[index]``, which may lie beyond the array's end."""

    def generate(context, builder, signature, args):
        data = context.make_array(signature.args[0])(context, builder, args[0]).data
        pointer = builder.bitcast(builder.gep(data, [args[1]]), ir.IntType(8).as_pointer())
        kind = ir.FunctionType(ir.VoidType(), [pointer.type, INDEX, INDEX, INDEX])
        flags = [ir.Constant(INDEX, number) for number in (0, 3, 1)]  # read, keep in all caches, data
        builder.call(builder.module.declare_intrinsic("llvm.prefetch", (pointer.type,), kind), [pointer, *flags])
        return context.get_dummy_value()

    return types.void(array, types.intp), generate


@intrinsic
def store(typingctx, array, index, value):
    """``array[index : index + 8] = value``."""

    def generate(context, builder, signature, args):
        builder.store(args[2], _pointer(context, builder, signature.args[0], *args[:2]), align=4)
        return context.get_dummy_value()

    return types.void(array, types.intp, lanes), generate


@intrinsic
def store3(typingctx, array, index, x, y, z):
    """``array[index : index + 24] = x0 y0 z0 x1 y1 z1 ...``."""

    def generate(context, builder, signature, args):
        wide = ir.Constant(ir.VectorType(INDEX, 2 * LANES), list(range(2 * LANES)))
        pair = builder.shuffle_vector(args[2], args[3], wide)
        third = builder.shuffle_vector(args[4], args[4], wide)
        order = [2 * LANES + k // 3 if k % 3 == 2 else k % 3 * LANES + k // 3 for k in range(3 * LANES)]
        mixed = builder.shuffle_vector(pair, third, ir.Constant(ir.VectorType(INDEX, 3 * LANES), order))
        pointer = _pointer(context, builder, signature.args[0], *args[:2])
        target = builder.bitcast(pointer, ir.VectorType(ir.FloatType(), 3 * LANES).as_pointer())
        builder.store(mixed, target, align=4)
        return context.get_dummy_value()

    return types.void(array, types.intp, lanes, lanes, lanes), generate


@intrinsic
def fma(typingctx, a, number, c):
    """``a * number + c`` for a vector a, one number and a vector c."""

    def generate(context, builder, signature, args):
        product = builder.fmul(args[0], _splat(builder, args[1]), flags=FLAGS)
        return builder.fadd(product, args[2], flags=FLAGS)

    return lanes(lanes, types.float32, lanes), generate


def _binary(operation):
    @intrinsic
    def combine(typingctx, a, b):
        def generate(context, builder, signature, args):
            return getattr(builder, operation)(args[0], args[1], flags=FLAGS)

        return lanes(lanes, lanes), generate

    return combine


add, sub, mul, div = _binary("fadd"), _binary("fsub"), _binary("fmul"), _binary("fdiv")


@intrinsic
def root(typingctx, a):
    """Square root of every lane."""

    def generate(context, builder, signature, args):
        kind = ir.FunctionType(VECTOR, [VECTOR])
        return builder.call(builder.module.declare_intrinsic(f"llvm.sqrt.v{LANES}f32", fnty=kind), args)

    return lanes(lanes), generate


@intrinsic
def splat(typingctx, number):
    """One number in every lane."""

    def generate(context, builder, signature, args):
        return _splat(builder, args[0])

    return lanes(types.float32), generate
