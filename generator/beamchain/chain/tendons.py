"""Modal tendons: any modes on any bodies, exactly, by one fixed tendon per mode.

With the root held, the mass matrix over (root motions, hinges) is `[[R, P], [P^T, Q]]`; modes with
participation `L_k` can be given to these bodies if and only if `sum_k L_k L_k^T <= P Q^-1 P^T` and
`N >= n + rank P - rank L`.

Theory: docs/theory.md, section 4.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import nnls

from beamchain.chain.chain import Chain, Freedom, Tendon
from beamchain.errors import RealisationError
from beamchain.ports.model import Shapes
from beamchain.ports.motions import PORT_MOTION, Array, offset_matrix

SINGULAR = 1e-9  # relative singular value of P: a motion that the hinges do not reach
TOO_HEAVY = 1e-9  # relative, of what is rounding
PASSES = 100  # of the projection towards the real mode shapes; each costs some microseconds
STILL = 1e-9  # change of a pass at which the projection has settled
RAISED = 0.3  # least singular value on what the root does not see
DROPPED = 1e-13  # relative armature that is rounding
ROOM = 0.9  # of the modes, where surplus hinges shall not move the root
FAINT = 4e-3  # of a motion that the root would feel
LEAST_ROOM = 0.01  # squared length of such a motion
ABOVE = 2.0  # lowest frequency of a filler over that of the last mode kept, or over the band
HIGHEST = 2.6  # the highest: on a hub a plain step is still a third of the last mode's limit
SLIGHT = 0.02  # of a motion that the root would feel, where nothing known is left out there
NONE_FELT = 1e-9  # relative: a filler that moves the root by less does not
LEAST_LEFT = 1e-6  # of the rigid mass, that participation must leave
SAME_MASS = 1e-10  # relative, of two rigid mass matrices
WORST_CONDITION = 1e3  # of the modes in hinge coordinates, beyond which digits are lost


@dataclass(frozen=True, eq=False)
class ModeGroup:
    """The modes of a group of ports.

    Args:
        frequencies: `(n,)` [rad/s].
        rows: `(n, m)` participation in the motions of the root,
            then the motion of any further port.
        momenta: `(n, f)` of the real modes in the hinges' own motions; see `on`.
        numbers: `(n,)` of the modes, from 1, for their names; 1, 2, ... where left out.
        weights: per port, how many of the modes move it most;
            every port of the group where left out.
        rigid: `(m, m)` rigid mass that goes with the participation;
            that of the bodies where left out.
        left_out: the modes that are left out, for which fillers stand; None where none is known.
        normal: how many of the modes are modes, first; the others are static responses of further
            ports. All where left out.
        band: highest frequency at which the response counts, and of these modes on the
            hub [rad/s]; fillers stand above it.
        neutral: whether the modes are exact on one hub, so that fillers must not move the root.
    """

    ports: tuple[str, ...]
    frequencies: Array
    rows: Array
    damping: Array
    shapes: Shapes | None = None
    momenta: Array | None = None
    numbers: tuple[int, ...] = ()
    weights: Mapping[str, float] = field(default_factory=dict)
    rigid: Array | None = None
    left_out: "ModeGroup | None" = None
    normal: int | None = None
    band: float = 0.0
    neutral: bool = False

    @property
    def last(self) -> float:
        """Frequency of the last mode [rad/s]."""
        return float(np.max(self.frequencies[: self.normal]))

    def fitting(self, rigid: Array) -> "ModeGroup":
        """The modes with participation that fits a slightly different `rigid` `(m, m)`."""
        if self.rigid is None or not np.max(np.abs(self.rigid - rigid)) > SAME_MASS * np.max(
            np.abs(rigid)
        ):
            return self
        m = len(rigid)
        left = rigid - self.rows[:, :m].T @ self.rows[:, :m]
        size = np.sqrt(np.diag(rigid))
        if float(np.linalg.eigvalsh(left / np.outer(size, size))[0]) > LEAST_LEFT:
            return self  # the participation as it is leaves these bodies something
        scale = 1.0 / np.sqrt(np.diag(rigid))
        # symmetric roots: a motion without mass in the file has no participation to be turned
        bodies, file = (_root(matrix * np.outer(scale, scale)) for matrix in (rigid, self.rigid))
        inverse = np.linalg.pinv(file, rcond=SINGULAR, hermitian=True)
        turn = (bodies @ inverse) * np.outer(1.0 / scale, scale)
        rows = np.column_stack([self.rows[:, :m] @ turn.T, self.rows[:, m:]])
        return replace(self, rows=rows, rigid=rigid)

    def yielding(self, omega: float) -> Array:
        """`(n, m)` rows of these modes whose sum of squares is their flexibility at a frequency
        below them [rad/s]."""
        squares = self.frequencies**2
        return self.rows / np.sqrt(np.maximum(squares - omega**2, squares / 2.0))[:, None]

    @property
    def moving(self) -> tuple[str, ...]:
        """Ports that get hinges: those that a mode moves."""
        return tuple(
            port for port in self.ports if self.weights.get(port, 0.0) > 0.0 or not self.weights
        )

    def on(self, hinges: Array) -> "ModeGroup":
        """The modes seen from hinges at `(f,)` x of their freedoms [m]."""
        return self if self.shapes is None else replace(self, momenta=self.shapes.momenta(hinges))


def _root(matrix: Array) -> Array:
    """The symmetric square root of a matrix that is nowhere negative."""
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T, dtype=np.float64)


def modal_matrix(
    kinematics: Array, inertia: Array, modes: ModeGroup, fillers: tuple[float, float]
) -> tuple[Array, Array, Array]:
    """Mass-normalised modes T in hinge coordinates `(f, f)`, wanted ones first,
    the armature mu `(f, f)` they need, and the frequencies of all `(f,)`.

    `kinematics` `(m, f)`: P over the rows of further ports; `inertia` `(f, f)`: Q;
    `fillers`: lowest and highest frequency of fillers [rad/s].
    """
    n, size = modes.frequencies.size, len(inertia)
    apart = modes.neutral and size > n
    # Q = C C^T, T = C^-T U
    root = np.asarray(np.linalg.cholesky(inertia), dtype=np.float64)
    seen, unseen, on_seen = _split(kinematics, root)
    # U: the modes, motions that the root does not feel, and what is left, as fillers
    guide = None if modes.momenta is None else unseen.T @ np.linalg.solve(root, modes.momenta.T)
    u = _lift(on_seen(modes.rows), seen, unseen, guide, room=ROOM if apart else 1.0)
    if apart:
        u = np.column_stack([u, _unfelt(u, seen, unseen, size - n)])
    left = np.linalg.svd(u)[0][:, u.shape[1] :]
    _check_condition(np.column_stack([u, left]))
    beyond, least = on_seen(_rows_left_out(modes)), FAINT if apart else SLIGHT
    turn, high = _fillers(seen.T @ left, beyond, modes.last, fillers, least=least)
    frequencies = np.concatenate([modes.frequencies, np.full(u.shape[1] - n, fillers[0]), high])
    u = np.column_stack([u, left @ turn])
    # mu = C ((U U^T)^-1 - 1) C^T
    missing = np.linalg.inv(u @ u.T) - np.eye(size)
    armature = root @ ((missing + missing.T) / 2.0) @ root.T
    shapes = np.asarray(np.linalg.solve(root.T, u), dtype=np.float64)
    return shapes, armature, frequencies


def _split(kinematics: Array, root: Array) -> tuple[Array, Array, Callable[[Array], Array]]:
    """Motions of the hinges that root and ports see, W1 `(f, r)`, and do not see, W2 `(f, f - r)`,
    of `A = P C^-T = V S W1^T`, and the motions `S^-1 V^T L^T` `(r, k)` in W1 that rows L have."""
    a = np.linalg.solve(root, kinematics.T).T
    scale = np.linalg.norm(a, axis=1)
    scale = np.where(scale > 0.0, scale, 1.0)
    left, s, right = np.linalg.svd(a / scale[:, None])
    rank = int(np.sum(s > SINGULAR * s[0]))

    def on_seen(rows: Array) -> Array:
        return (left[:, :rank].T @ (rows / scale).T) / s[:rank, None]

    return right[:rank].T, right[rank:].T, on_seen


def _lift(b: Array, seen: Array, unseen: Array, guide: Array | None, *, room: float) -> Array:
    """`(f, n)` U = W1 B + W2 Z E with `E = (1 - B^T B)^(1/2)` and `|Z|` at most `room`: modes whose
    participation is B `(r, n)` in W1."""
    _, values, vt = np.linalg.svd(b)
    rank = int(np.sum(values > SINGULAR * values[:1]))
    _check_hinges(len(seen), seen=seen.shape[1], modes=len(vt), rank=rank)
    _check_weight(values)
    squares = np.zeros(len(vt))
    squares[: values.size] = np.minimum(values, 1.0) ** 2
    e = (vt.T * np.sqrt(1.0 - squares)) @ vt
    z = room * _nearest_turn(e, vt[rank:].T, unseen.shape[1], guide)
    return seen @ b + unseen @ z @ e


def _check_hinges(hinges: int, *, seen: int, modes: int, rank: int) -> None:
    """`N >= n + rank P - rank L`."""
    needed = modes + seen - rank
    if hinges < needed:
        raise RealisationError(
            f"{hinges} hinges hold {max(hinges - seen + rank, 0)} of the {modes} modes asked for, "
            f"which take {needed}; keep fewer modes."
        )


def _check_weight(values: Array) -> None:
    """`L^T L <= P Q^-1 P^T`, of the singular values of B."""
    if np.any(values > 1.0 + TOO_HEAVY):
        raise RealisationError(
            f"the modes move {float(values[0]) ** 2:.6g} times the mass that the limp chain lets "
            "go, where 1 is the limit; cut the appendage nearer to its root, or keep fewer modes."
        )


def _check_condition(u: Array) -> None:
    """The columns of U are independent enough."""
    stretch = np.linalg.svd(u, compute_uv=False)
    if stretch[-1] * WORST_CONDITION < stretch[0]:
        raise RealisationError(
            "the modes on these hinges are too nearly dependent (condition "
            f"{stretch[0] / max(stretch[-1], 1e-300):.1e}, limit {WORST_CONDITION:g}); keep fewer "
            "modes, or cut the appendage elsewhere."
        )


def _rows_left_out(modes: ModeGroup) -> Array:
    """`(j, m)` rows whose sum of squares is the flexibility that fillers shall have; none on one
    hub, where the modes are exact as they are."""
    if modes.neutral or modes.left_out is None:
        return np.zeros((0, modes.rows.shape[1]))
    return modes.left_out.yielding(modes.last)


def _fillers(
    felt: Array, beyond: Array, omega: float, between: tuple[float, float], *, least: float
) -> tuple[Array, Array]:
    """Combinations `(k, k)` of the motions that the modes leave free, and their frequencies
    `(k,)` [rad/s]: fillers as flexible at `omega` as what is left out.

    `felt` `(rank, k)`: what root and ports feel of these motions; `beyond` `(rank, j)`: rows whose
    sum of squares is the flexibility of what is left out. That of the fillers, `felt S felt^T`
    with `0 <= S <= 1 / (lowest^2 - omega^2)`, is the nearest to it. An eigenvalue of S,
    `s = g^2 / (w^2 - omega^2)`, is a motion `g v` at the frequency w: the whole motion, g = 1,
    where w lies `between` the lowest and the highest frequency, else less of it at the highest;
    at `least` is felt of it.
    """
    _, sizes, right = np.linalg.svd(felt)
    full = np.zeros(right.shape[0])
    full[: sizes.size] = sizes
    moving = int(np.sum(full > NONE_FELT))
    turn = right.T.copy()
    frequencies = np.full(turn.shape[1], between[1])
    if moving == 0:
        return turn, frequencies
    lowest, highest = (w**2 - omega**2 for w in between)
    turn[:, :moving] *= ROOM
    felt = felt @ turn[:, :moving]
    shares, vectors = np.linalg.eigh(_nearest_flexibility(felt, lowest * beyond @ beyond.T))
    stiff = lowest / np.maximum(shares, lowest / highest)  # `highest` at most
    smallest = np.minimum(least / np.linalg.norm(felt @ vectors, axis=0), 1.0)
    part = np.maximum(np.sqrt(np.maximum(shares, 0.0) * stiff / lowest), smallest)
    turn[:, :moving] = turn[:, :moving] @ vectors * part
    frequencies[:moving] = np.sqrt(stiff + omega**2)
    return turn, frequencies


def _nearest_flexibility(felt: Array, wanted: Array) -> Array:
    """`(k, k)` S, eigenvalues between 0 and 1, with `felt S felt^T` nearest to `wanted`;
    `felt` `(rank, k)` of full column rank."""
    inverse = np.linalg.pinv(felt)
    share = ahead = _clip_eigenvalues(inverse @ wanted @ inverse.T)
    pace = 1.0
    steepest = float(np.linalg.norm(felt, 2)) ** 4
    # projected gradient with Nesterov's momentum
    for _ in range(PASSES):
        last = share
        share = _clip_eigenvalues(
            ahead - felt.T @ (felt @ ahead @ felt.T - wanted) @ felt / steepest
        )
        moved = share - last
        if np.max(np.abs(moved)) < STILL:
            break
        pace, again = _next_pace(pace)
        ahead = share + again * moved
    return share


def _clip_eigenvalues(matrix: Array) -> Array:
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2.0)
    return (vectors * np.clip(values, 0.0, 1.0)) @ vectors.T


def _unfelt(u: Array, seen: Array, unseen: Array, count: int) -> Array:
    """`(size, k)` motions that the root does not feel, beside modes `u` `(size, n)`."""
    left = np.eye(u.shape[0]) - u @ u.T
    own = seen.T @ left @ seen
    across = seen.T @ left @ unseen
    room = unseen.T @ left @ unseen - across.T @ np.linalg.pinv(own, hermitian=True) @ across
    values, vectors = np.linalg.eigh((room + room.T) / 2.0)
    pick = [k for k in range(values.size)[::-1] if values[k] > LEAST_ROOM][:count]
    return unseen @ vectors[:, pick] * np.sqrt(values[pick])


def _nearest_turn(lift: Array, free: Array, size: int, guide: Array | None) -> Array:
    """`(size, n)` Z with no singular value above 1: nearest to `guide`, the real modes,
    never flat where the root is blind.

    `lift` `(n, n)`: square root of what the root leaves open; `free` `(n, k)`:
    mode combinations that it does not see.
    """
    if guide is None:  # an isometry: first on what the root does not see, then on the rest
        rest = np.linalg.svd(free)[0][:, free.shape[1] :]
        basis = np.column_stack([free, rest])[:, :size]
        return np.eye(size)[:, : basis.shape[1]] @ basis.T
    z = ahead = np.zeros((size, len(lift)))
    pace = 1.0
    # projected gradient with Nesterov's momentum, begun anew where it turns back
    for _ in range(PASSES):
        last, z = z, _clip_singular_values(ahead - (ahead @ lift - guide) @ lift)
        moved = z - last
        if np.all(np.abs(moved) < STILL):
            break
        if float(np.sum((ahead - z) * moved)) > 0.0:
            pace, ahead = 1.0, z
            continue
        pace, again = _next_pace(pace)
        ahead = z + again * moved
    if free.size:
        left, s, right = np.linalg.svd(z @ free, full_matrices=False)
        z = z + (left * (np.maximum(s, RAISED) - s)) @ right @ free.T
    return _clip_singular_values(z)


def _next_pace(pace: float) -> tuple[float, float]:
    """Nesterov's next pace t' with t'^2 - t' = t^2, and the part (t - 1) / t' of the last move that
    is made again."""
    following = (1.0 + np.sqrt(1.0 + 4.0 * pace**2)) / 2.0
    return following, (pace - 1.0) / following


def _clip_singular_values(z: Array) -> Array:
    left, s, right = np.linalg.svd(z, full_matrices=False)
    return (left * np.minimum(s, 1.0)) @ right


def given_modes(
    chain: Chain, groups: Sequence[ModeGroup], further: Sequence[float] = (), ratio: float = 0.0
) -> Chain:
    """The chain with tendons that give it the modes; `further`: x of ports [m]."""
    tendons: list[Tendon] = []
    armatures: list[Tendon] = []
    fillers = 0
    last = max(group.last for group in groups)
    lowest = ABOVE * max(last, *(group.band for group in groups))
    highest = max(HIGHEST * last, lowest)
    for group in groups:
        # static responses of further ports set the step anyway
        top = max(highest, float(group.frequencies[-1]))
        freedoms = chain.freedoms(group.ports)
        group = group.on(np.array([chain.hinges[i].x for i, _ in freedoms]))
        motion = group_motion(group.ports)
        rigid, elastic = chain.rows(freedoms)
        port = [port_rows(chain, freedoms, motion, x) for x in further]
        kinematics = np.vstack([(rigid @ motion).T @ elastic, *port])
        inertia = elastic.T @ elastic
        shapes, armature, frequencies = modal_matrix(kinematics, inertia, group, (lowest, top))
        n = group.frequencies.size
        surplus = len(freedoms) - n
        if surplus and further:
            shapes, frequencies = _stiffen_attachments(
                shapes, frequencies, np.vstack(port) @ shapes, n
            )
        ratios = np.concatenate(
            [group.damping, np.full(surplus, ratio if np.any(group.damping > 0.0) else 0.0)]
        )
        numbers = group.numbers or tuple(range(1, n + 1))
        word = f"_{group.ports[0]}" if len(group.ports) == 1 else ""
        labels = [f"mode{k}{word}" for k in numbers] + [
            f"filler{fillers + k + 1}{word}" for k in range(surplus)
        ]
        fillers += surplus
        for label, along, w, zeta in zip(
            labels, np.linalg.inv(shapes), frequencies, ratios, strict=True
        ):
            tendons.append(
                Tendon(label, freedoms, along, float(w) ** 2, 2.0 * float(zeta) * float(w))
            )
        armatures += _armatures(freedoms, armature, inertia)
    armatures = [replace(t, label=f"armature{k}") for k, t in enumerate(armatures, 1)]
    return replace(chain, tendons=(*tendons, *armatures))


def _stiffen_attachments(
    shapes: Array, frequencies: Array, moved: Array, n: int
) -> tuple[Array, Array]:
    """Modes whose attachment modes are stiffer by what fillers yield,
    so that a port's flexibility is exact.

    `shapes` `(f, f)`: in hinge coordinates, fillers last; `moved` `(p, f)`:
    motion of the further ports in them.
    """
    last = slice(n - moved.shape[0], n)
    own = moved[:, last]
    yielding = (own / frequencies[last] ** 2) @ own.T - (
        moved[:, n:] / frequencies[n:] ** 2
    ) @ moved[:, n:].T
    back = np.linalg.inv(own)
    values, turn = np.linalg.eigh(np.linalg.inv(back @ yielding @ back.T))
    if values[0] <= 0.0:
        return shapes, frequencies  # fillers softer than what is wanted: nothing to take from
    shapes, frequencies = shapes.copy(), frequencies.copy()
    shapes[:, last], frequencies[last] = shapes[:, last] @ turn, np.sqrt(values)
    return shapes, frequencies


def _armatures(freedoms: tuple[Freedom, ...], armature: Array, inertia: Array) -> list[Tendon]:
    """Inertia between hinges as tendons of a triangular factor, which run over all hinges, all but
    the last, and so on: MuJoCo adds them to its mass matrix joint by joint, at a cost that grows
    with a joint's depth."""
    root = np.linalg.cholesky(inertia)
    half = np.linalg.solve(root, armature)
    values, vectors = np.linalg.eigh(np.linalg.solve(root, half.T))
    some = values > DROPPED
    factor = root @ vectors[:, some] * np.sqrt(values[some])
    rows = np.asarray(np.linalg.qr(factor[::-1].T, mode="r"))[:, ::-1]
    return [
        Tendon("armature", freedoms[:end], np.sign(row[end - 1]) * row[:end], armature=1.0)
        for end, row in zip(range(len(freedoms), 0, -1), rows, strict=False)
    ]


def group_motion(ports: Sequence[str]) -> Array:
    """`(6, m)` motions of the root that belong to some ports."""
    return np.column_stack([PORT_MOTION[port] for port in ports])


def port_rows(chain: Chain, freedoms: Sequence[Freedom], motion: Array, x: float) -> Array:
    """`(m, f)` motion of the point at `x` [m] per hinge freedom, root held."""
    place = offset_matrix(np.array([x, 0.0, 0.0]))
    columns = [
        motion.T @ place @ chain.freedom_motion(f) * (chain.hinges[f[0]].x < x) for f in freedoms
    ]
    return np.column_stack([np.zeros((motion.shape[1], 0)), *columns])


def springs_as_modes(chain: Chain, damping: Mapping[str, Array]) -> Chain:
    """The same chain with one tendon per mode, damped, in place of hinge springs."""
    tendons = [
        t for port in chain.ports for t in _modes_of(chain, port, damping[port], springs=True)
    ]
    loose = tuple(
        replace(hinge, stiffness=dict.fromkeys(hinge.stiffness, 0.0)) for hinge in chain.hinges
    )
    return replace(chain, hinges=loose, tendons=tuple(tendons))


def damped_modes(chain: Chain, damping: Mapping[str, Array]) -> Chain:
    """The chain with a damping tendon for each of the first modes."""
    tendons = [
        t
        for port in damping
        for t in _modes_of(chain, port, damping[port], springs=False)
        if t.damping > 0.0
    ]
    return replace(chain, tendons=(*chain.tendons, *tendons))


def _modes_of(chain: Chain, port: str, ratios: Array, *, springs: bool) -> list[Tendon]:
    """The first modes of a port, as many as `ratios` `(k,)`, as tendons over its hinges."""
    modes = chain.port(port)
    freedoms = chain.freedoms([port])
    _, elastic = chain.rows(freedoms)
    # rows of the inverse of the modal matrix
    momenta = chain.shapes(port) @ elastic.T @ elastic
    out: list[Tendon] = []
    for k in range(min(modes.modes, ratios.size)):
        w = float(modes.frequencies[k])
        spring = w**2 if springs else 0.0
        damper = 2.0 * float(ratios[k]) * w
        out.append(Tendon(f"mode{k + 1}_{port}", freedoms, momenta[k], spring, damper))
    return out


def joint_damping(chain: Chain, port: str, ratios: Array) -> Chain:
    """The chain with hinge dampers, by least squares on the ratios `(n,)`."""
    modes = chain.port(port)
    moving = [i for i, hinge in enumerate(chain.hinges) if port in hinge.stiffness]
    wanted = 2.0 * ratios[: modes.modes] * modes.frequencies
    damped = wanted > 0.0
    if not np.any(damped):
        return chain
    scale = 1.0 / np.where(damped, wanted, np.max(wanted))
    values, _ = nnls(chain.shapes(port) ** 2 * scale[:, None], damped.astype(np.float64))
    hinges = list(chain.hinges)
    for i, value in zip(moving, values, strict=True):
        hinges[i] = replace(hinges[i], damping={**hinges[i].damping, port: float(value)})
    return replace(chain, hinges=tuple(hinges))
