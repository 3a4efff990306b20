"""What MuJoCo compiled, read without MuJoCo's algebra: bodies,
anchors and springs of a straight chain, with 60 digits.

A chain's frequencies lie up to twelve decades apart, and a light root before a heavy tip takes
the digits of double precision on the way to them. The numbers MuJoCo holds are exact binary
fractions, and the mass matrix of a straight chain is made of their sums and products, so that
nothing is lost that MuJoCo has.
"""

from collections.abc import Callable
from decimal import Decimal, localcontext
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

DIGITS = 60
# degrees of freedom up to which the digits are worth their time; above it, double precision
SMALL = 24
SWEEPS = 40  # of Jacobi's rotations; ten are seen
INERTIA = {"xy": 2, "xz": 1, "torsion": 0}  # axis of the motion

Array = NDArray[np.float64]
Numbers = NDArray[Any]  # of floats or of Decimals


def frequencies(model: "mujoco.MjModel", port: str, root: str = "") -> Array:
    """Natural frequencies of one port of a straight chain along x [rad/s], ascending.

    Args:
        model: compiled; its bodies lie on one line along x, unturned.
        port: "xy", "xz" or "torsion".
        root: body that moves freely with everything on it; empty: the chain is held.
    """
    joints = [j for j in range(model.njnt) if model.joint(j).name.endswith(f"_{port}")]
    dofs = [int(model.jnt_dofadr[j]) for j in joints]
    rows = springs(model)[:, dofs]
    scaled = np.linalg.inv(np.linalg.qr(rows[np.any(rows != 0.0, axis=1)], mode="r"))
    n = len(joints)
    if n > SMALL:
        mass = _condensed(_mass(model, port, joints, root, float), n)
        return 1.0 / np.sqrt(np.linalg.eigvalsh(scaled.T @ mass @ scaled)[::-1])
    with localcontext() as context:
        context.prec = DIGITS
        mass = _condensed(_mass(model, port, joints, root, Decimal), n)
        scale = np.array([[Decimal(float(v)) for v in row] for row in scaled], dtype=object)
        squares = np.array(sorted(_jacobi(scale.T @ mass @ scale)), dtype=np.float64)
    return 1.0 / np.sqrt(squares[::-1])


def tendon_rows(model: "mujoco.MjModel") -> Array:
    """`(ntendon, nv)` coefficients of fixed tendons."""
    rows = np.zeros((model.ntendon, model.nv))
    for tendon in range(model.ntendon):
        first = int(model.tendon_adr[tendon])
        for k in range(first, first + int(model.tendon_num[tendon])):
            rows[tendon, int(model.jnt_dofadr[int(model.wrap_objid[k])])] += float(
                model.wrap_prm[k]
            )
    return rows


def springs(model: "mujoco.MjModel") -> Array:
    """`(s, nv)` rows of the square root of the stiffness, of joints and of tendons."""
    own = np.zeros((model.njnt, model.nv))
    own[np.arange(model.njnt), model.jnt_dofadr] = np.sqrt(_linear(model.jnt_stiffness))
    return np.vstack([own, np.sqrt(_linear(model.tendon_stiffness))[:, None] * tendon_rows(model)])


def _linear(values: Any) -> Array:
    """The linear term, also where a version keeps polynomials beside it."""
    values = np.asarray(values, dtype=float)
    return values if values.ndim == 1 else values[:, 0]


def _mass(
    model: "mujoco.MjModel", port: str, joints: list[int], root: str, kind: Callable[[float], Any]
) -> Numbers:
    """Mass matrix of the joints, then of the root's displacement and rotation where it is free."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    first = model.body(root).id if root else 0
    count = len(joints) + (2 if root else 0)
    zero = kind(0.0)
    one = kind(1.0)
    dtype: Any = np.float64 if kind is float else np.object_
    out = np.full((count, count), zero, dtype=dtype)
    axis = INERTIA[port]
    for body in range(1, model.nbody):
        line = _line(model, body)
        if root and first not in line:
            continue
        centre = kind(float(data.xipos[body, 0]))
        frame = data.ximat[body].reshape(3, 3)
        inertia = kind(float(frame[axis] ** 2 @ model.body_inertia[body]))
        moves = np.full(count, zero, dtype=dtype)
        turns = np.full(count, zero, dtype=dtype)
        for i, j in enumerate(joints):
            if int(model.jnt_bodyid[j]) in line:
                moves[i] = zero if port == "torsion" else centre - kind(float(data.xanchor[j, 0]))
                turns[i] = one
        if root:
            moves[-2:] = one, centre - kind(float(data.xpos[first, 0]))
            turns[-1] = one
        out = (
            out
            + kind(float(model.body_mass[body])) * np.outer(moves, moves)
            + inertia * np.outer(turns, turns)
        )
    dofs = [int(model.jnt_dofadr[j]) for j in joints]
    coefficients = tendon_rows(model)
    for i in range(model.ntendon):
        row = np.full(count, zero, dtype=dtype)
        row[: len(joints)] = [kind(float(v)) for v in coefficients[i][dofs]]
        out = out + kind(float(model.tendon_armature[i])) * np.outer(row, row)
    return out


def _line(model: "mujoco.MjModel", body: int) -> set[int]:
    """A body and all that carry it."""
    out = {0}
    while body:
        out.add(body)
        body = int(model.body_parentid[body])
    return out


def _condensed(mass: Numbers, n: int) -> Numbers:
    """The joints' mass matrix with the root, the last two rows, free to follow."""
    if mass.shape[0] == n:
        return mass
    (a, b), (_, d) = mass[n:, n:]
    inverse = np.array([[d, -b], [-b, a]], dtype=object) / (a * d - b * b)
    return mass[:n, :n] - mass[:n, n:].dot(inverse).dot(mass[n:, :n])


def _jacobi(matrix: Numbers) -> list[Decimal]:
    """Eigenvalues of a symmetric matrix by Jacobi's rotations."""
    a = matrix.copy()
    n = a.shape[0]
    for _ in range(SWEEPS):
        turned = False
        for p in range(n):
            for q in range(p + 1, n):
                if a[p, q] ** 2 <= abs(a[p, p] * a[q, q]) * Decimal("1e-50"):
                    continue
                turned = True
                theta = (a[q, q] - a[p, p]) / (2 * a[p, q])
                tangent = (1 if theta >= 0 else -1) / (abs(theta) + (theta * theta + 1).sqrt())
                cosine = 1 / (tangent * tangent + 1).sqrt()
                sine = tangent * cosine
                rows = a[[p, q]].copy()
                a[p], a[q] = cosine * rows[0] - sine * rows[1], sine * rows[0] + cosine * rows[1]
                columns = a[:, [p, q]].copy()
                a[:, p] = cosine * columns[:, 0] - sine * columns[:, 1]
                a[:, q] = sine * columns[:, 0] + cosine * columns[:, 1]
        if not turned:
            break
    return [a[i, i] for i in range(n)]
