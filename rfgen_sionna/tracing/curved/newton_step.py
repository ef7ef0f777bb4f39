"""One damped Newton step towards a specular double bounce, as a kernel in float64."""

from __future__ import annotations

from typing import Any

from rfgen_sionna.scene.kernels import FrozenKernel, drjit_types

_DAMPING = 1e-12
"""Damping relative to the matrix's trace: a hollow ball has a ring of specular points."""


def _step_kernel(given: dict[str, Any]) -> None:
    """Kernel of :func:`_newton_step`."""
    dr, types = drjit_types()
    Float, Array3, lane = types.Float64, types.Array3f64, given["lanes"]
    at = [dr.gather(Float, given["at"], 4 * lane + k) for k in range(4)]
    surfaces = []
    for side in range(2):
        face = given["faces"][side]

        def vector(k: int, face: Any = face) -> Any:
            return Array3(*(dr.gather(Float, given["figures"], 27 * face + 3 * k + axis) for axis in range(3)))

        # Corners of the patch, by the face's second and third coordinates.
        ends = [dr.gather(Float, given["ends"], 12 * lane + 6 * side + k) for k in range(6)]
        u, v = at[2 * side], at[2 * side + 1]
        steps = [(ends[2 + 2 * k] - ends[0], ends[3 + 2 * k] - ends[1]) for k in range(2)]
        w1, w2 = (ends[k] + u * steps[0][k] + v * steps[1][k] for k in range(2))
        w0 = 1.0 - w1 - w2
        p, rise, n = ([vector(3 * block + k) for k in range(3)] for block in range(3))
        place = w0 * p[0] + w1 * p[1] + w2 * p[2]
        place += 4.0 * (w1 * w2 * rise[0] + w2 * w0 * rise[1] + w0 * w1 * rise[2])
        one = p[1] - p[0] + 4.0 * (w2 * (rise[0] - rise[1]) + (w0 - w1) * rise[2])
        two = p[2] - p[0] + 4.0 * (w1 * (rise[0] - rise[2]) + (w0 - w2) * rise[1])
        across = w0 * n[0] + w1 * n[1] + w2 * n[2]
        scale = 1.0 / dr.maximum(dr.norm(across), 1e-300)
        normal = across * scale
        moves, turns = [], []
        for s, t in steps:
            moves.append(s * one + t * two)
            turn = (s * (n[1] - n[0]) + t * (n[2] - n[0])) * scale
            turns.append(turn - normal * dr.dot(normal, turn))
        near = 1.0 / dr.maximum(dr.norm(place), 1e-12)
        towards_source = -place * near
        fall = dr.dot(normal, towards_source)
        out = 2.0 * fall * normal - towards_source
        changes = []
        for move, turn in zip(moves, turns, strict=True):
            back = -(move - towards_source * dr.dot(towards_source, move)) * near
            changes.append(
                2.0 * (dr.dot(turn, towards_source) + dr.dot(normal, back)) * normal + 2.0 * fall * turn - back
            )
        surfaces.append((place, moves, out, changes))
    (here, here_moves, out, changes), (there, there_moves, back, back_changes) = surfaces
    span = there - here
    nearness = 1.0 / dr.maximum(dr.norm(span), 1e-9)
    ray = span * nearness
    axis = dr.select(dr.abs(ray.x) < 0.6, Array3(1.0, 0.0, 0.0), Array3(0.0, 1.0, 0.0))
    side = dr.normalize(dr.cross(ray, axis))
    axes = (side, dr.cross(ray, side))

    def swings(move: Any) -> Any:
        return (move - ray * dr.dot(ray, move)) * nearness

    away, towards_source = out - ray, back + ray
    # Each column is the change of both misses with one coordinate.
    columns = [(change + swings(move), -swings(move)) for change, move in zip(changes, here_moves, strict=True)]
    columns += [(-swings(move), change + swings(move)) for change, move in zip(back_changes, there_moves, strict=True)]
    rows = [[dr.dot(column[side], axis) for column in columns] for side in range(2) for axis in axes]
    missed = [dr.dot(each, axis) for each in (away, towards_source) for axis in axes]
    squares = [[sum(row[a] * row[b] for row in rows) for b in range(4)] for a in range(4)]
    right = [-sum(row[a] * each for row, each in zip(rows, missed, strict=True)) for a in range(4)]
    step = _solve_cholesky(squares, right, dr)
    longest = dr.maximum(dr.maximum(dr.abs(step[0]), dr.abs(step[1])), dr.maximum(dr.abs(step[2]), dr.abs(step[3])))
    shorter = dr.minimum(1.0, 2.0 / dr.maximum(longest, 1e-30))
    for k in range(4):
        dr.scatter(given["moved"], at[k] + shorter * step[k], 4 * lane + k, mode=dr.ReduceMode.Permute)
    miss = dr.sqrt(dr.squared_norm(away) + dr.squared_norm(towards_source))
    dr.scatter(given["miss"], miss, lane, mode=dr.ReduceMode.Permute)
    dr.eval(given["moved"], given["miss"])


def _solve_cholesky(matrix: list[list[Any]], right: list[Any], dr: Any) -> list[Any]:
    """Solution of damped symmetric equations, by Cholesky's method without roots."""
    count = len(right)
    damping = _DAMPING * sum(matrix[k][k] for k in range(count)) + 1e-30
    lower: list[list[Any]] = [[None] * count for _ in range(count)]
    pivots: list[Any] = []
    for j in range(count):
        pivot = matrix[j][j] + damping - sum(lower[j][k] * lower[j][k] * pivots[k] for k in range(j))
        pivots.append(dr.maximum(pivot, damping))
        for i in range(j + 1, count):
            rest = matrix[i][j] - sum(lower[i][k] * lower[j][k] * pivots[k] for k in range(j))
            lower[i][j] = rest / pivots[j]
    found: list[Any] = list(right)
    for i in range(count):
        found[i] = found[i] - sum(lower[i][k] * found[k] for k in range(i))
    found = [each / pivot for each, pivot in zip(found, pivots, strict=True)]
    for i in reversed(range(count)):
        found[i] = found[i] - sum(lower[k][i] * found[k] for k in range(i + 1, count))
    return found


NEWTON_STEP = FrozenKernel(_step_kernel)
