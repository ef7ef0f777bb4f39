"""Arithmetic of Numba's kernels: intrinsics of vectors, which its compiler would not find in loops over a few lanes,
and the circular functions.

A vector holds one number for each of `LANES` lanes in 32 bytes: complex numbers of single precision, or real ones of
double precision. Vectors are found by the number of their first element in a contiguous array of any shape.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

LANES = 4
_BYTES = 32
_FUSED = ("contract", "nsz")


def _vector(context: Any, builder: Any, kind: Any, array: Any, index: Any) -> tuple[Any, Any]:
    """Pointer to the vector that starts at a number of an array, and its type."""
    number = kind.dtype
    vector = ir.VectorType(context.get_value_type(number), _BYTES * 8 // number.bitwidth)
    data = context.make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [index]), vector.as_pointer()), vector


def _shuffled(builder: Any, value: Any, lanes: list[int]) -> Any:
    return builder.shuffle_vector(value, value, ir.Constant(ir.VectorType(ir.IntType(32), len(lanes)), lanes))


def _combination(add: bool) -> Any:
    """Intrinsic out[i] = a x[j] + b x[j + 1] + c x[j + 2], or += if `add`, for vectors that start at the numbers i of
    `out` and j of `x`."""

    def combine(typing_context: Any, out: Any, i: Any, x: Any, j: Any, a: Any, b: Any, c: Any) -> Any:
        number = out.dtype
        signature = types.void(out, types.intp, x, types.intp, number, number, number)

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            target, at, source, first, *factors = arguments
            into, vector = _vector(context, builder, signature.args[0], target, at)
            aligned = number.bitwidth // 8
            total = builder.load(into, align=aligned) if add else ir.Constant(vector, [0.0] * vector.count)
            for step, factor in enumerate(factors):
                index = builder.add(first, context.get_constant(types.intp, step * vector.count))
                value = builder.load(_vector(context, builder, signature.args[2], source, index)[0], align=aligned)
                one = builder.insert_element(ir.Constant(vector, ir.Undefined), factor, ir.Constant(ir.IntType(32), 0))
                splat = _shuffled(builder, one, [0] * vector.count)
                total = builder.fadd(total, builder.fmul(splat, value, flags=_FUSED), flags=_FUSED)
            builder.store(total, into, align=aligned)
            return context.get_dummy_value()

        return signature, generate

    return intrinsic(combine)


def _product(add: bool) -> Any:
    """Intrinsic out[i] = x[j] y[k], or += if `add`, for vectors of complex numbers, all of single precision."""

    def multiply(typing_context: Any, out: Any, i: Any, x: Any, j: Any, y: Any, k: Any) -> Any:
        signature = types.void(out, types.intp, x, types.intp, y, types.intp)

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            places = [_vector(context, builder, signature.args[n], *arguments[n : n + 2])[0] for n in (0, 2, 4)]
            x, y = (builder.load(place, align=4) for place in places[1:])
            total = builder.load(places[0], align=4) if add else ir.Constant(x.type, [0.0] * 2 * LANES)
            even = range(0, 2 * LANES, 2)
            real, imaginary = (_shuffled(builder, y, [n + part for n in even for _ in range(2)]) for part in range(2))
            signs = ir.Constant(x.type, [-1.0, 1.0] * LANES)
            across = builder.fmul(_shuffled(builder, x, [n + part for n in even for part in (1, 0)]), signs)
            for value, factor in ((x, real), (across, imaginary)):
                total = builder.fadd(total, builder.fmul(value, factor, flags=_FUSED), flags=_FUSED)
            builder.store(total, places[0], align=4)
            return context.get_dummy_value()

        return signature, generate

    return intrinsic(multiply)


set3, add3, multiply, multiply_add = _combination(False), _combination(True), _product(False), _product(True)


def _circle() -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Coefficients in r^2 of cos(2 pi r) and of sin(2 pi r) / r, |r| at most 1/2; they err by 3e-9."""
    square = 0.125 * (1 - np.cos(np.pi * (np.arange(400) + 0.5) / 400))
    r = np.sqrt(square)
    fits = [np.polynomial.Polynomial.fit(square, y, 8, domain=[0, 0.25], window=[0, 0.25]).coef
            for y in (np.cos(2 * np.pi * r), np.sin(2 * np.pi * r) / r)]  # fmt: skip
    return tuple(map(float, fits[0])), tuple(map(float, fits[1]))


_COS, _SIN = _circle()


@njit(fastmath=True)
def cos_sin(cycles: float) -> tuple[float, float]:
    """Cosine and sine of a number of cycles."""
    r = cycles - np.floor(cycles + 0.5)
    q = r * r
    cosine, sine = _COS[8], _SIN[8]
    for n in range(7, -1, -1):
        cosine = cosine * q + _COS[n]
        sine = sine * q + _SIN[n]
    return cosine, sine * r
