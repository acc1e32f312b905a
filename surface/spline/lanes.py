"""SIMD vectors of eight float32 numbers inside compiled kernels, and pairs of these.

Sums over control points stay in registers this way, whatever the loop around them looks like. LLVM turns the
operations into AVX, SSE or NEON instructions. A pair is one register where the processor has AVX-512, else two.
"""

# mypy: allow-untyped-defs, allow-untyped-calls, allow-incomplete-defs
# mypy: disable-error-code="import-untyped, attr-defined"
from __future__ import annotations

from inspect import Parameter, Signature

from llvmlite import binding, ir
from numba.core import config, types
from numba.extending import intrinsic, models, register_model

LANES = 8
VECTOR = ir.VectorType(ir.FloatType(), LANES)
PAIR = ir.VectorType(ir.FloatType(), 2 * LANES)
INDEX = ir.IntType(32)
INDICES = ir.VectorType(INDEX, LANES)
SHORTS, PAIR_OF_SHORTS = (ir.VectorType(ir.IntType(16), count) for count in (LANES, 2 * LANES))
OCTETS, PAIR_OF_OCTETS = (ir.VectorType(ir.IntType(8), count) for count in (LANES, 2 * LANES))
BOTH = ir.Constant(ir.VectorType(INDEX, 2 * LANES), list(range(2 * LANES)))  # all lanes of two vectors, in order
PAIRS = [k // 2 + k % 2 * LANES for k in range(2 * LANES)]  # x0 y0 x1 y1 ... of two vectors


def _has(feature):
    """Whether numba compiles for a processor with this feature, by LLVM's name for it."""
    if config.CPU_NAME is not None or config.CPU_FEATURES is not None:
        return f"+{feature}" in (config.CPU_FEATURES or "").split(",")
    try:
        return bool(binding.get_host_cpu_features().get(feature))
    except RuntimeError:  # LLVM does not know this processor
        return False


PICKS_FAST = _has("avx2")  # whether :func:`pick` is one instruction
PAIRS_FAST = _has("avx512vl")  # whether a pair is one register, and there are registers for twelve of them
FLAGS = ("contract", "nsz", "arcp")  # a multiplication and an addition may become one instruction


class LanesType(types.Type):
    """numba's name for the vector."""

    def __init__(self) -> None:
        super().__init__(name="float32x8")


class PairType(types.Type):
    """numba's name for two vectors in one."""

    def __init__(self) -> None:
        super().__init__(name="float32x16")


lanes, pair = LanesType(), PairType()


@register_model(LanesType)
class LanesModel(models.PrimitiveModel):
    """The vector lives in an LLVM vector register."""

    def __init__(self, manager, kind) -> None:
        super().__init__(manager, kind, VECTOR)


@register_model(PairType)
class PairModel(models.PrimitiveModel):
    """The pair lives in one register, or in two."""

    def __init__(self, manager, kind) -> None:
        super().__init__(manager, kind, PAIR)


def _pointer(context, builder, kind, array, index):
    """Address of ``array[index]`` as a pointer to a vector."""
    data = context.make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [index]), VECTOR.as_pointer())


def _splat(builder, number):
    """A vector with the same number in every lane."""
    single = builder.insert_element(ir.Constant(VECTOR, ir.Undefined), number, ir.Constant(INDEX, 0))
    mask = ir.Constant(ir.VectorType(INDEX, LANES), [0] * LANES)
    return builder.shuffle_vector(single, ir.Constant(VECTOR, ir.Undefined), mask)


def _operation(result, *arguments):
    """Make an intrinsic of a function that builds its code; arguments that are None may be any array."""

    def wrap(build):
        def typed(typingctx, *given):
            kinds = [kind if wanted is None else wanted for wanted, kind in zip(arguments, given, strict=True)]
            signature = result(*kinds)
            return signature, lambda context, builder, _, args: build(context, builder, signature.args, args)

        names = "typingctx", *(f"argument{k}" for k in range(len(arguments)))
        typed.__signature__ = Signature([Parameter(name, Parameter.POSITIONAL_ONLY) for name in names])
        typed.__name__, typed.__doc__ = build.__name__, build.__doc__
        return intrinsic(typed)

    return wrap


@_operation(lanes)
def zero(context, builder, kinds, args):
    """All lanes 0."""
    return ir.Constant(VECTOR, [0.0] * LANES)


@_operation(lanes, None, types.intp)
def load(context, builder, kinds, args):
    """Load ``array[index : index + 8]``; of an int16 array, the same numbers as float32."""
    if kinds[0].dtype == types.int16:
        data = context.make_array(kinds[0])(context, builder, args[0]).data
        short = builder.bitcast(builder.gep(data, [args[1]]), SHORTS.as_pointer())
        return builder.sitofp(builder.load(short, align=2), VECTOR)
    return builder.load(_pointer(context, builder, kinds[0], *args), align=4)


@_operation(lanes, None, types.intp)
def load_fixed(context, builder, kinds, args):
    """Load the eight with number ``index`` of the fixed-point numbers in ``array`` of uint8: of each the whole part,
    rounded down, as 16 signed bits, the lower byte first, and what is to be added to it, in 256ths, as 8 bits. float32
    holds the sums exactly. Two eights lie together: whole parts of both, then what is to be added to both."""
    wide = ir.IntType(types.intp.bitwidth)
    second, first = builder.and_(args[1], wide(1)), builder.mul(builder.lshr(args[1], wide(1)), wide(6 * LANES))
    whole = builder.add(first, builder.mul(second, wide(2 * LANES)))
    rest = builder.add(first, builder.add(wide(4 * LANES), builder.mul(second, wide(LANES))))
    return _load_fixed(context, builder, kinds[0], args[0], whole, rest, (SHORTS, OCTETS, VECTOR))


@_operation(pair, None, types.intp)
def load_fixed_pair(context, builder, kinds, args):
    """Load two eights as :func:`load_fixed`, of which the first has the even number ``index``."""
    wide = ir.IntType(types.intp.bitwidth)
    whole = builder.mul(args[1], wide(3 * LANES))
    rest = builder.add(whole, wide(4 * LANES))
    return _load_fixed(context, builder, kinds[0], args[0], whole, rest, (PAIR_OF_SHORTS, PAIR_OF_OCTETS, PAIR))


def _load_fixed(context, builder, kind, array, whole, rest, forms):
    """Fixed-point numbers whose whole parts begin at byte ``whole`` of an array, and the rest at byte ``rest``."""
    data = context.make_array(kind)(context, builder, array).data
    parts = (
        builder.load(builder.bitcast(builder.gep(data, [at]), form.as_pointer()), align=1)
        for at, form in zip((whole, rest), forms, strict=False)
    )
    shorts, octets = parts
    step = ir.Constant(forms[2], [1.0 / 256.0] * forms[2].count)
    scaled = builder.fmul(builder.uitofp(octets, forms[2]), step, flags=FLAGS)
    return builder.fadd(scaled, builder.sitofp(shorts, forms[2]), flags=FLAGS)


@_operation(pair, None, types.intp)
def load_pair(context, builder, kinds, args):
    """Load ``array[index : index + 16]`` of int16 as float32."""
    data = context.make_array(kinds[0])(context, builder, args[0]).data
    shorts = builder.bitcast(builder.gep(data, [args[1]]), PAIR_OF_SHORTS.as_pointer())
    return builder.sitofp(builder.load(shorts, align=2), PAIR)


@_operation(pair)
def zero_pair(context, builder, kinds, args):
    """All lanes 0."""
    return ir.Constant(PAIR, [0.0] * (2 * LANES))


@_operation(pair, pair, None, types.intp, types.intp, pair)
def fma_pair(context, builder, kinds, args):
    """``a * b + c``, where the first eight lanes of b are ``array[i]`` and the others ``array[j]``, for
    ``a, array, i, j, c``."""
    data = context.make_array(kinds[1])(context, builder, args[1]).data
    halves = (_splat(builder, builder.load(builder.gep(data, [at]))) for at in args[2:4])
    product = builder.fmul(args[0], builder.shuffle_vector(*halves, BOTH), flags=FLAGS)
    return builder.fadd(product, args[4], flags=FLAGS)


@_operation(pair, pair, pair)
def add_pairs(context, builder, kinds, args):
    """The sums of two pairs, lane by lane."""
    return builder.fadd(args[0], args[1], flags=FLAGS)


def _half(first):
    @_operation(lanes, pair)
    def half(context, builder, kinds, args):
        order = ir.Constant(ir.VectorType(INDEX, LANES), list(range(first, first + LANES)))
        return builder.shuffle_vector(args[0], ir.Constant(PAIR, ir.Undefined), order)

    return half


first_of, second_of = _half(0), _half(LANES)  # eight of the sixteen lanes of a pair


@_operation(lanes, None, types.intp, None, types.intp)
def pick(context, builder, kinds, args):
    """Lane k is ``array[index + picks[first + k]]``; the int32 ``picks`` must be 0 to 7."""
    values = builder.load(_pointer(context, builder, kinds[0], *args[:2]), align=4)
    data = context.make_array(kinds[2])(context, builder, args[2]).data
    picks = builder.load(builder.bitcast(builder.gep(data, [args[3]]), INDICES.as_pointer()), align=4)
    if PICKS_FAST:
        kind = ir.FunctionType(VECTOR, [VECTOR, INDICES])
        return builder.call(builder.module.declare_intrinsic("llvm.x86.avx2.permps", fnty=kind), [values, picks])
    return _pick_each(builder, values, picks)


def _pick_each(builder, values, picks):
    """Lane by lane, for processors without such an instruction."""
    out = ir.Constant(VECTOR, ir.Undefined)
    for k in range(LANES):
        lane = ir.Constant(INDEX, k)
        out = builder.insert_element(out, builder.extract_element(values, builder.extract_element(picks, lane)), lane)
    return out


def _loader3(part):
    @_operation(lanes, None, types.intp)
    def load_part(context, builder, kinds, args):
        pointer = _pointer(context, builder, kinds[0], *args)
        source = builder.bitcast(pointer, ir.VectorType(ir.FloatType(), 3 * LANES).as_pointer())
        values = builder.load(source, align=4)
        order = ir.Constant(ir.VectorType(INDEX, LANES), [3 * k + part for k in range(LANES)])
        return builder.shuffle_vector(values, values, order)

    return load_part


load_x, load_y, load_z = (_loader3(part) for part in range(3))  # of eight vectors x0 y0 z0 x1 y1 z1 ... from an index


@_operation(types.void, None, types.intp)
def prefetch(context, builder, kinds, args):
    """Prefetch the cache line of ``array[index]``, which may lie beyond the array's end."""
    data = context.make_array(kinds[0])(context, builder, args[0]).data
    pointer = builder.bitcast(builder.gep(data, [args[1]]), ir.IntType(8).as_pointer())
    kind = ir.FunctionType(ir.VoidType(), [pointer.type, INDEX, INDEX, INDEX])
    flags = [ir.Constant(INDEX, number) for number in (0, 3, 1)]  # read, keep in all caches, data
    builder.call(builder.module.declare_intrinsic("llvm.prefetch", (pointer.type,), kind), [pointer, *flags])
    return context.get_dummy_value()


@_operation(types.void, None, types.intp, lanes)
def store(context, builder, kinds, args):
    """Store ``array[index : index + 8] = value``."""
    builder.store(args[2], _pointer(context, builder, kinds[0], *args[:2]), align=4)
    return context.get_dummy_value()


@_operation(types.void, None, types.intp, lanes, lanes, lanes)
def store3(context, builder, kinds, args):
    """``array[index : index + 24] = x0 y0 z0 x1 y1 z1 ...``."""
    wide = ir.Constant(ir.VectorType(INDEX, 2 * LANES), list(range(2 * LANES)))
    pair = builder.shuffle_vector(args[2], args[3], wide)
    third = builder.shuffle_vector(args[4], args[4], wide)
    order = [2 * LANES + k // 3 if k % 3 == 2 else k % 3 * LANES + k // 3 for k in range(3 * LANES)]
    mixed = builder.shuffle_vector(pair, third, ir.Constant(ir.VectorType(INDEX, 3 * LANES), order))
    pointer = _pointer(context, builder, kinds[0], *args[:2])
    target = builder.bitcast(pointer, ir.VectorType(ir.FloatType(), 3 * LANES).as_pointer())
    builder.store(mixed, target, align=4)
    return context.get_dummy_value()


@_operation(lanes, lanes, types.float32, lanes)
def fma(context, builder, kinds, args):
    """``a * number + c`` for a vector a, one number and a vector c."""
    product = builder.fmul(args[0], _splat(builder, args[1]), flags=FLAGS)
    return builder.fadd(product, args[2], flags=FLAGS)


def _binary(instruction):
    @_operation(lanes, lanes, lanes)
    def combine(context, builder, kinds, args):
        return getattr(builder, instruction)(args[0], args[1], flags=FLAGS)

    return combine


add, sub, mul, div = _binary("fadd"), _binary("fsub"), _binary("fmul"), _binary("fdiv")


@_operation(lanes, lanes)
def root(context, builder, kinds, args):
    """Square root of every lane."""
    kind = ir.FunctionType(VECTOR, [VECTOR])
    return builder.call(builder.module.declare_intrinsic(f"llvm.sqrt.v{LANES}f32", fnty=kind), args)


@_operation(lanes, lanes, lanes, lanes)
def most_of(context, builder, kinds, args):
    """Return the greatest absolute value of three numbers, and at least 1e-37, in every lane."""
    kind = ir.FunctionType(VECTOR, [VECTOR])
    size = builder.module.declare_intrinsic(f"llvm.fabs.v{LANES}f32", fnty=kind)
    most = ir.Constant(VECTOR, [1e-37] * LANES)
    for vector in args:
        most = builder.select(builder.fcmp_ordered(">", found := builder.call(size, [vector]), most), found, most)
    return most


@_operation(types.boolean, lanes, types.float32)
def reaches(context, builder, kinds, args):
    """Whether any lane holds a number of at least this one, or NaN."""
    found = builder.fcmp_unordered(">=", args[0], _splat(builder, args[1]))
    return builder.icmp_unsigned("!=", builder.bitcast(found, ir.IntType(LANES)), ir.IntType(LANES)(0))


@_operation(lanes, types.float32)
def splat(context, builder, kinds, args):
    """One number in every lane."""
    return _splat(builder, args[0])


@_operation(lanes, lanes, None, types.intp, lanes)
def fma_at(context, builder, kinds, args):
    """``a * array[index] + c`` as :func:`fma`; the index counts single numbers and is not checked."""
    data = context.make_array(kinds[1])(context, builder, args[1]).data
    product = builder.fmul(args[0], _splat(builder, builder.load(builder.gep(data, [args[2]]))), flags=FLAGS)
    return builder.fadd(product, args[3], flags=FLAGS)


@_operation(types.intp, None, types.intp)
def item(context, builder, kinds, args):
    """The integer ``array[index]``; the index must not be negative, which is not checked."""
    found = builder.load(builder.gep(context.make_array(kinds[0])(context, builder, args[0]).data, [args[1]]))
    if found.type.width == types.intp.bitwidth:
        return found
    widen = builder.sext if kinds[0].dtype.signed else builder.zext
    return widen(found, ir.IntType(types.intp.bitwidth))


@_operation(types.void, None, types.intp, None, types.intp, None, types.intp)
def store_difference(context, builder, kinds, args):
    """``out[k : k + 4] = a[i : i + 4] - b[j : j + 4]`` for ``out, k, a, i, b, j``; a and b are float64, out float32."""
    ends = [
        builder.gep(context.make_array(kinds[at])(context, builder, args[at]).data, [args[at + 1]]) for at in (0, 2, 4)
    ]
    wide = ir.VectorType(ir.DoubleType(), 4)
    a, b = (builder.load(builder.bitcast(end, wide.as_pointer()), align=8) for end in ends[1:])
    narrow = ir.VectorType(ir.FloatType(), 4)
    single = builder.fptrunc(builder.fsub(a, b), narrow)
    builder.store(single, builder.bitcast(ends[0], narrow.as_pointer()), align=4)
    return context.get_dummy_value()


@_operation(types.void, None, types.intp, None, types.intp, lanes, lanes, lanes)
def store3_at(context, builder, kinds, args):
    """``out[index + 3 * order[first + k] : ][: 3] = x[k], y[k], z[k]`` for ``out, index, order, first, x, y, z``; the
    order is uint16."""
    out = context.make_array(kinds[0])(context, builder, args[0]).data
    order = context.make_array(kinds[2])(context, builder, args[2]).data
    pairs = builder.shuffle_vector(args[4], args[5], ir.Constant(ir.VectorType(INDEX, 2 * LANES), PAIRS))
    double = ir.IntType(64)
    pairs = builder.bitcast(pairs, ir.VectorType(double, LANES))  # x and y of a vertex are stored at once
    wide = ir.IntType(types.intp.bitwidth)
    for k in range(LANES):
        place = builder.zext(builder.load(builder.gep(order, [builder.add(args[3], wide(k))])), wide)
        start = builder.gep(out, [builder.add(args[1], builder.mul(place, wide(3)))])
        pair = builder.extract_element(pairs, ir.Constant(INDEX, k))
        builder.store(pair, builder.bitcast(start, double.as_pointer()), align=4)
        builder.store(builder.extract_element(args[6], ir.Constant(INDEX, k)), builder.gep(start, [wide(2)]))
    return context.get_dummy_value()
