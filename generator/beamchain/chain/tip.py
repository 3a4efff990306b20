"""Chains that also carry the right tip motion: links with rotary inertia of their own beside their end masses.

With one or two modes a chain exists that is exact at the root and at the tip; with more, the root stays exact and the
tip comes as near as it can.
"""

import numpy as np
from scipy.optimize import least_squares

from beamchain.chain.realise import Nodes
from beamchain.chain.rods import Numbers, jacobian, nodes_to_rods, rod_modes
from beamchain.errors import RealisationError
from beamchain.motion import Array
from beamchain.port import PortModel

ALL_AT_ONCE = 2  # modes up to which a chain exists that meets every condition
EXACT = 1e-11  # relative residual of the conditions at the root


def tip_exact(nodes: Nodes, target: PortModel, tip: float) -> Nodes:
    """A chain with the port of `target` and, as nearly as possible, its tip displacements.

    Args:
        nodes: the exact chain of `target`, where the search starts.
        target: with `tip` `(n, >= 1)`.
        tip: x of the tip [m].

    Returns:
        nodes with excess rotary inertia.

    Raises:
        RealisationError: the target has no tip motion.
    """
    if target.tip is None:
        raise RealisationError("the target states no tip motion, so that the tip cannot be matched.")
    n, count = target.modes, nodes.lengths.size
    wanted_tip = target.tip[:, 0]
    scale = np.sqrt(np.diag(target.rigid_mass))
    start = np.concatenate([np.log(nodes.masses), np.log(nodes.lengths), np.log(nodes.stiffness), np.zeros(count)])
    unit_inertia = float(target.rigid_mass[0, 0]) * tip**2 * 1e-2

    def unpack(x: Numbers) -> tuple[Numbers, Numbers, Numbers, Numbers]:
        a, b, c = count + 1, 2 * count + 1, 3 * count
        return np.exp(x[:a]), np.exp(x[a:b]), np.exp(x[b:c]), x[c:] * unit_inertia

    def conditions(x: Numbers) -> Numbers:
        """Root first (3 rigid, n frequencies, 2 n participations), then the n tip displacements."""
        masses, lengths, stiffness, excess = unpack(x)
        at = np.concatenate([np.zeros(1), np.cumsum(lengths)])
        modes = rod_modes(nodes_to_rods(masses, lengths, excess, stiffness), tip)
        rigid = np.array([np.sum(masses), np.sum(masses * at), np.sum(masses * at**2) + np.sum(excess)])
        given = np.array([target.rigid_mass[0, 0], target.rigid_mass[0, 1], target.rigid_mass[1, 1]])
        gap = (modes.participation - target.participation) / scale
        weight = np.linalg.norm(target.participation / scale, axis=1)
        root = [rigid / given - 1.0, np.log(modes.frequencies / target.frequencies), (gap / weight[:, None]).ravel()]
        return np.concatenate([*root, modes.tip / wanted_tip - 1.0])

    if n <= ALL_AT_ONCE:
        try:
            with np.errstate(all="ignore"):
                solved = least_squares(
                    lambda x: np.real(conditions(x)), start, jac=lambda x: jacobian(conditions, x),
                    xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=300,
                )  # fmt: skip
            if float(np.max(np.abs(conditions(solved.x)))) < EXACT:
                masses, lengths, stiffness, excess = (np.real(v) for v in unpack(solved.x))
                return Nodes(masses, lengths, stiffness, excess)
        except (ValueError, np.linalg.LinAlgError):
            pass  # it ran off: the careful way below

    fixed = 3 + 3 * n

    def restored(x: Array) -> Array:
        """The nearest parameters with the root's conditions met."""
        for _ in range(8):
            if np.max(np.abs(x - start)) > 20.0:
                return start
            value = conditions(x)[:fixed]
            if np.max(np.abs(value)) < 1e-14:
                break
            if not np.all(np.isfinite(value)) or np.max(np.abs(value)) > 10.0:
                return start  # lost: no better than where the search began
            x = x - np.linalg.pinv(jacobian(lambda y: conditions(y)[:fixed], x), rcond=1e-12) @ value
        return x

    def miss(x: Array) -> float:
        if np.max(np.abs(x)) > 700.0:
            return np.inf
        value = conditions(x)
        root, physical = float(np.max(np.abs(value[:fixed]))), np.all(np.isfinite(value))
        return float(np.linalg.norm(value[fixed:])) if physical and root < EXACT else np.inf

    x, best, damping = start, miss(start), 1e-3
    for _ in range(40):
        slope, value = jacobian(conditions, x), conditions(x)
        left = np.linalg.svd(slope[:fixed])[2][fixed:].T  # what the root's conditions leave free
        reach = slope[fixed:] @ left
        normal = reach.T @ reach + damping * np.eye(left.shape[1])
        with np.errstate(all="ignore"):
            trial = restored(x - left @ np.linalg.solve(normal, reach.T @ value[fixed:]))
            new = miss(trial)
        if new < best:
            x, best, damping = trial, new, damping * 0.1
        else:
            damping *= 10.0
        if best < 1e-13 or damping > 1e8:
            break
    masses, lengths, stiffness, excess = (np.real(v) for v in unpack(x))
    return Nodes(masses, lengths, stiffness, excess)
