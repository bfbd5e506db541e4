"""The loop of a stage: it applies the formula of one item to all items, one group at a time, as vector code.

    results = local_array(RESULTS, position)  # rows of the results times GROUP
    for start in range(first, stop, GROUP):
        count = min(GROUP, stop - start)
        for item in range(count):
            keep(results, item, formula(column(position, 3, start + item), ...))
        write_group(results, start, count, out)

The results of a group are kept in a local array (`vectors`). Stores in the loop over the group therefore cannot alias
its inputs, and the compiler vectorises the loop without proving that two dozen arrays do not overlap. A formula maps
scalars and tuples of scalars to a tuple and has no array arguments (`jit_formula`).

As in `vectors`, each function has two forms: a plain Python function, which defines it and runs when the JIT is off,
and the instructions that replace it in compiled code.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload
from numba.np.arrayobj import make_array
from numpy.typing import NDArray

from endotsr.method.kernels.jit import jit_inline

GROUP = 64  # items whose results are kept in a local array
_instructions: Any = intrinsic  # typed as Any: the decorated function is called with a kernel's arguments


def column(table: NDArray[np.floating], size: int, item: Any) -> tuple[Any, ...]:
    """The first `size` numbers of a column of a two-dimensional array; in compiled code `size` is a constant.

    The column must exist; negative indices are not supported.
    """
    return tuple(table[row, item] for row in range(size))


def keep(results: NDArray[np.floating], item: int, values: tuple[Any, ...]) -> None:
    """Store the results of an item of the group, 0 ... GROUP - 1, in the local array, whose row k starts at k GROUP."""
    for k, value in enumerate(values):
        results[k * GROUP + item] = value


def keep_where(valid: Any, results: NDArray[np.floating], item: int, values: tuple[Any, ...]) -> None:
    """As `keep`, but zeros if not `valid`, even for NaN values: a select, not a branch."""
    keep(results, item, values if valid else (results.dtype.type(0),) * len(values))


def kept(results: NDArray[np.floating], size: int, item: Any) -> tuple[Any, ...]:
    """The first `size` numbers stored by `keep` for an item; in compiled code `size` is a constant."""
    return tuple(results[k * GROUP + item] for k in range(size))


def _write_group(results: NDArray[np.floating], start: int, count: int, out: NDArray[np.floating]) -> None:
    """Copy the rows of `results`, GROUP numbers each, to columns start ... start + count - 1 of `out`."""
    for row in range(out.shape[0]):
        for item in range(count):
            out[np.uint64(row), np.uint64(start + item)] = results[np.uint64(row * GROUP + item)]


write_group = jit_inline(_write_group)


def _place(builder: Any, data: Any, row: int, item: Any) -> Any:
    """Address of the number of an item in a row of a local array."""
    return builder.gep(data, [builder.add(item, ir.Constant(item.type, row * GROUP), flags=["nsw"])])


@_instructions(prefer_literal=True)
def _column(typing: Any, table: Any, size: Any, item: Any) -> Any:
    if not isinstance(size, types.IntegerLiteral):
        return None

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = make_array(table)(context, builder, arguments[0])
        rows = [context.get_constant(types.intp, row) for row in range(size.literal_value)]
        places = [cgutils.get_item_pointer(context, builder, table, array, [row, arguments[2]]) for row in rows]
        return context.make_tuple(builder, signature.return_type, [builder.load(place) for place in places])

    return types.UniTuple(table.dtype, size.literal_value)(table, size, types.intp), generate


@_instructions
def _keep_where(typing: Any, valid: Any, results: Any, item: Any, values: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data, zero = make_array(results)(context, builder, arguments[1]).data, context.get_constant(results.dtype, 0)
        for k, value in enumerate(cgutils.unpack_tuple(builder, arguments[3], len(values))):
            builder.store(builder.select(arguments[0], value, zero), _place(builder, data, k, arguments[2]))
        return context.get_dummy_value()

    kind = types.UniTuple(results.dtype, len(values))
    return types.void(types.boolean, results, types.intp, kind), generate


@_instructions(prefer_literal=True)
def _kept(typing: Any, results: Any, size: Any, item: Any) -> Any:
    if not isinstance(size, types.IntegerLiteral):
        return None

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = make_array(results)(context, builder, arguments[0]).data
        values = [builder.load(_place(builder, data, k, arguments[2])) for k in range(size.literal_value)]
        return context.make_tuple(builder, signature.return_type, values)

    return types.UniTuple(results.dtype, size.literal_value)(results, size, types.intp), generate


@overload(column, inline="always", prefer_literal=True)
def _compile_column(table, size, item):
    return lambda table, size, item: _column(table, size, item)


@overload(keep, inline="always")
def _compile_keep(results, item, values):
    return lambda results, item, values: _keep_where(True, results, item, values)


@overload(keep_where, inline="always")
def _compile_keep_where(valid, results, item, values):
    return lambda valid, results, item, values: _keep_where(valid, results, item, values)


@overload(kept, inline="always", prefer_literal=True)
def _compile_kept(results, size, item):
    return lambda results, size, item: _kept(results, size, item)
