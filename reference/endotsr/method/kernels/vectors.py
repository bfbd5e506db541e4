"""Small arrays in a kernel's registers, which plain NumPy arrays cannot express.

Memory from `np.empty` may alias other arrays, so the compiler reloads and stores it at every step and guards each loop
against overlap. A local array aliases nothing: sums over a loop stay in vector registers without a guard. The loop
over the eight lanes of a float64 register is too short for guards. `kernels.groups` is built on local arrays.

Each function below has two forms: a plain Python function, which defines it and runs when the JIT is off, and the
instructions that replace it in compiled code. A local array must not leave the function that created it. It may be
passed to functions inlined there (`jit_inline`), but must not be returned, stored, or passed to others.
"""

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from llvmlite.binding import get_host_cpu_features
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload
from numba.np.arrayobj import make_array, populate_array
from numpy.typing import NDArray

FEWEST_LANES = 8  # lanes; shorter loops do not vectorise
_INT32 = ir.IntType(32)
_instructions: Any = intrinsic  # typed as Any: the decorated function is called with a kernel's arguments


def _register_bytes() -> int:
    """64 with AVX-512; otherwise 32, which also suits sixteen registers of 16 bytes."""
    features = numba.config.CPU_FEATURES  # type: ignore[attr-defined]  # the target that Numba compiles for
    if features is None:
        try:
            features = get_host_cpu_features().flatten()
        except RuntimeError:  # LLVM does not know this processor
            features = ""
    return 64 if "+avx512f" in features else 32


REGISTER = _register_bytes()


def lanes(like: NDArray[np.floating]) -> int:
    """Numbers in one vector: 16 of float32 with AVX-512, else 8; 8 of float64."""
    return _lanes(like.itemsize)


def _lanes(bytes_each: int) -> int:
    return max(FEWEST_LANES, REGISTER // bytes_each)


def vector(like: NDArray[np.floating]) -> NDArray[np.floating]:
    """A local array of `lanes(like)` numbers, not initialised."""
    return np.empty(lanes(like), like.dtype)


def local_array(size: int, like: NDArray[np.floating]) -> NDArray[np.floating]:
    """A local array of `size` numbers, not initialised; in compiled code `size` is a named constant of the module."""
    return np.empty(size, like.dtype)


def fold(values: NDArray[np.floating]) -> np.floating:
    """Sum of the lanes of a vector in a fixed order: the upper half is added to the lower until one is left."""
    while values.size > 1:
        half = values.size // 2
        values = values[:half] + values[half:]
    return values[0]


def lowest_bit(bits: np.uint64) -> np.uint64:
    """Index of the lowest set bit; at least one bit must be set."""
    return np.uint64((int(bits) & -int(bits)).bit_length() - 1)


def prefetch(table: NDArray[Any], row: int) -> None:
    """Load a row of a C-ordered table into the cache ahead of its use. No value changes; the row must exist."""


def _lanes_of(like: Any) -> int:
    return _lanes(like.dtype.bitwidth // 8)


def _make_local(context: Any, builder: Any, kind: Any, size: int) -> Any:
    """A one-dimensional array on the stack, without an owner.

    `cgutils.alloca_once` would zero it number by number, which costs seconds of compilation for a tile.
    """
    number = context.get_data_type(kind.dtype)
    with builder.goto_entry_block():
        place = builder.alloca(ir.ArrayType(number, size))
    place.align = 64
    array = make_array(kind)(context, builder)
    shape, stride = context.get_constant(types.intp, size), context.get_constant(types.intp, kind.dtype.bitwidth // 8)
    data = builder.bitcast(place, number.as_pointer())
    populate_array(array, data=data, shape=[shape], strides=[stride], itemsize=stride, meminfo=None)
    return array._getvalue()


@_instructions(prefer_literal=True)
def _local_array(typing: Any, size: Any, like: Any) -> Any:
    if not isinstance(size, types.IntegerLiteral):
        return None
    kind, count = types.Array(like.dtype, 1, "C"), size.literal_value
    return kind(size, like), lambda context, builder, signature, arguments: _make_local(context, builder, kind, count)


@_instructions
def _vector(typing: Any, like: Any) -> Any:
    kind = types.Array(like.dtype, 1, "C")
    return kind(like), lambda context, builder, signature, arguments: _make_local(
        context, builder, kind, _lanes_of(like)
    )


@_instructions
def _fold(typing: Any, values: Any) -> Any:
    """The vector is loaded once; its halves are shuffles of the register."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        number, count = context.get_data_type(values.dtype), _lanes_of(values)
        array = make_array(values)(context, builder, arguments[0])
        place = builder.bitcast(array.data, ir.VectorType(number, count).as_pointer())
        folded = builder.load(place, align=values.dtype.bitwidth // 8)
        while count > 1:
            count //= 2
            halves = [ir.Constant(ir.VectorType(_INT32, count), list(range(k, k + count))) for k in (0, count)]
            nothing = ir.Constant(folded.type, ir.Undefined)
            folded = builder.fadd(*(builder.shuffle_vector(folded, nothing, half) for half in halves))
        return builder.extract_element(folded, ir.Constant(_INT32, 0))

    return values.dtype(values), generate


@_instructions
def _lowest_bit(typing: Any, bits: Any) -> Any:
    return types.uint64(types.uint64), lambda context, builder, signature, arguments: builder.cttz(
        arguments[0], ir.Constant(ir.IntType(1), 1)
    )


@_instructions
def _prefetch(typing: Any, table: Any, row: Any) -> Any:
    """Prefetch the first and last number: a row may span two cache lines (of three, hardware loads the middle)."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = make_array(table)(context, builder, arguments[0])
        stride = cgutils.unpack_tuple(builder, array.strides, table.ndim)[0]
        byte = ir.IntType(8).as_pointer()
        start = builder.gep(builder.bitcast(array.data, byte), [builder.mul(arguments[1], stride)])
        last = builder.sub(stride, ir.Constant(stride.type, table.dtype.bitwidth // 8))
        kind = ir.FunctionType(ir.VoidType(), [byte, _INT32, _INT32, _INT32])
        instruction = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        for place in (start, builder.gep(start, [last])):
            builder.call(instruction, [place, *(ir.Constant(_INT32, v) for v in (0, 3, 1))])  # read, keep, data
        return context.get_dummy_value()

    return types.void(table, types.intp), generate


def _compiled(function: Callable[..., Any], **options: Any) -> Callable[..., Any]:
    return overload(function, inline="always", **options)


@_compiled(lanes)
def _compile_lanes(like):
    return {16: lambda like: 16, 8: lambda like: 8}[_lanes_of(like)]


@_compiled(vector)
def _compile_vector(like):
    return lambda like: _vector(like)


@_compiled(local_array, prefer_literal=True)
def _compile_local_array(size, like):
    return lambda size, like: _local_array(size, like)


@_compiled(fold)
def _compile_fold(values):
    return lambda values: _fold(values)


@_compiled(lowest_bit)
def _compile_lowest_bit(bits):
    return lambda bits: _lowest_bit(bits)


@_compiled(prefetch)
def _compile_prefetch(table, row):
    return lambda table, row: _prefetch(table, row)
