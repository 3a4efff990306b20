"""The craft's promise: the coupled spacecraft with exact appendages against what MuJoCo
has, pose by pose.

The in-band error of `ports.compare.Reference` with the craft's base body for a hub: its motions in
its own axes, all appendages exact (every mode) against all appendages as the model has them, at the
rest pose and at every keyframe.

Theory: docs/theory.md, section 6.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from beamchain.craft.bent_line import BentLine
from beamchain.craft.exchange import Exchange
from beamchain.craft.hanging_liquid import HangingLiquid
from beamchain.craft.loads import Load, Root, carrying_of
from beamchain.craft.under_load import LoadedTree
from beamchain.engine.library import mujoco
from beamchain.engine.linear import Linear, PortLoads, linear_at
from beamchain.engine.loaded import Loading, check_pushes, loaded_linear, loading_at
from beamchain.engine.mount import Mount, motion, root_frame
from beamchain.engine.operating_point import (
    OperatingPoint,
    Positions,
    base_body,
    poses,
    quiet_copy,
    rest_point,
    still_copy,
)
from beamchain.engine.partial_fractions import MOST, partial_fractions
from beamchain.errors import EngineError, InputError
from beamchain.fitting.needs import AXES, TOPS
from beamchain.ports.compare import (
    DEFAULT_RATIO,
    LEAST_RATIO,
    Response,
    compared_ratios,
    crests,
    grid_of,
    maximum_of,
    norm_ratios,
    peak_clusters,
    peaks_at,
    relative_error,
    spectral_norm,
    spectral_norms,
    unresolved_peaks,
    with_damping,
)
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array, system_matrix
from beamchain.steps.sampled import Exact

RANK = 1e-9  # relative singular value below which a motion of the base is held
FAR = 1000.0  # times the band: modes beyond are gathered in searches
NEARLY = 1e-4  # in-band error that this may make
# of the band: the rate about which poles are looked for that grow; no round number, which a pole
# of a worked example may hit
STARTED = 0.0973
GROWS = 1e-4  # of the band: slower growth is rounding
STILLEST = 1e-12  # of the largest squared frequency, below which a motion is rigid


@dataclass(frozen=True, eq=False)
class PlacedBody:
    """One appendage on the spacecraft: `whole`: the beam in space, all its modes, damped.

    `kept` `(n,)`: which of them the chain was asked to keep; `dofs`: its degrees of freedom in the
    MuJoCo model; `band`: last kept cantilever frequency of each kept port [rad/s]; `loads`: what
    its ports carry; `alone`: the mass of its degrees of freedom without that, where it carries;
    `line`: how it bends up to a band, where it is a beam, or a liquid. Of a liquid: `springs`
    `(dofs,)` of its pendulums at the stated acceleration, `slack`: how far the frequencies of
    `line` lie below those of `whole`. `undamped`: as of `ports.compare.compared_ratios`.
    """

    mount: Mount
    whole: PortModel
    kept: NDArray[np.bool_]
    dofs: list[int]
    band: dict[str, float]
    loads: tuple[Load, ...] = ()
    alone: Array | None = None
    line: Callable[[float], BentLine | HangingLiquid] | None = None
    springs: Array | None = None
    slack: float = 1.0
    undamped: float = DEFAULT_RATIO


@dataclass(frozen=True)
class CraftError:
    """What the craft's promise came to.

    Args:
        error: the worst of all poses.
        band: upper end [rad/s].
        poses: error per pose: "rest", then keyframes by name or number.
        motions: which motions of that body count (0 to 5: x, y, z, rotations).
        body: name of the base body that is worst, where a file holds several craft.
        growth: by pose, where its load lets something grow, the rates of the exact craft and of
            MuJoCo's [1/s]; 0 for one that is stable.
    """

    error: float
    band: float
    poses: dict[str, float]
    motions: tuple[int, ...]
    body: str
    growth: dict[str, tuple[float, float]]


def lacking_damping(stiffness: Array, mass: Array, damping: Array, undamped: float) -> Array:
    """`(nv, nv)` what all that is sprung lacks of the damping at which it is compared;
    `undamped`: as of `ports.compare.compared_ratios`."""
    values, shapes = eigh(stiffness, mass)
    moving = values > STILLEST * values[-1:]  # they ascend, and may be none
    w, shapes = np.sqrt(values[moving]), shapes[:, moving]
    ratios = np.einsum("ik,ij,jk->k", shapes, damping, shapes) / (2.0 * w)
    push = mass @ shapes
    return push @ np.diag(2.0 * (compared_ratios(ratios, undamped) - ratios) * w) @ push.T


def extra_damping(bare: Linear) -> Array:
    """`(nv, nv)` what the bare craft gets so that no peak is infinite: 0.5 % where it has no
    damping at all."""
    undamped = LEAST_RATIO if np.any(bare.damping) else DEFAULT_RATIO
    return lacking_damping(bare.stiffness, bare.mass, bare.damping, undamped)


def on_base(linear: Linear, point: OperatingPoint, body: int) -> Linear:
    """The same with a wrench on a body, in its axes, for inputs, and the body's acceleration for
    outputs: its response is the accelerance."""
    data = point.data()
    rows = motion(point.model, data, body, data.xpos[body], data.xmat[body].reshape(3, 3))
    return linear.on_body(rows)


def peaks_of_craft(craft: Linear, poles: NDArray[np.complex128] | None = None) -> Array:
    """Peaks `(k, 2)`, frequency [rad/s] and damping ratio, with the base free,
    and with its own joints held.

    Those of the damped poles, and of the undamped modes where they lie elsewhere; `poles`: those
    with the base free, where they are known.
    """
    free = np.ones(len(craft.mass), dtype=np.bool_)
    held = ~np.any(craft.outputs.acceleration, axis=0)
    picks = [np.ix_(pick, pick) for pick in (free, held) if np.any(pick)]
    parts = [(craft.mass[pick], craft.damping[pick], craft.stiffness[pick]) for pick in picks]
    known = [] if poles is None else [poles]
    known += [_poles(*part) for part in parts[len(known) :]]
    moving = np.vstack([peaks_at(each) for each in known])
    return np.vstack(
        [moving, unresolved_peaks(np.vstack([_modes(*part) for part in parts]), moving)]
    )


def growth(craft: Linear, reach: float) -> float:
    """The fastest rate at which a motion of a craft grows by itself [1/s]; 0 for none.

    `reach`: a frequency of interest [rad/s].
    """
    n = len(craft.mass)
    # poles from the inverse about a rate s0, so that those of rigid motion keep their digits:
    # u = -(s0^2 M + s0 C + K)^-1 ((C + s0 M) f + M g)
    start = STARTED * reach
    dragged = craft.damping + start * craft.mass
    dynamic = craft.stiffness + start * dragged
    moved = -np.linalg.solve(dynamic, np.hstack([dragged, craft.mass]))
    rates = start * moved + np.eye(n, 2 * n)
    poles = start + 1.0 / np.linalg.eigvals(np.vstack([moved, rates]))
    growing = poles.real[np.abs(poles) < FAR * reach]
    return float(np.max(growing[growing > GROWS * reach], initial=0.0))


def _poles(mass: Array, damping: Array, stiffness: Array) -> NDArray[np.complex128]:
    n = mass.shape[0]
    rates = np.asarray(np.linalg.solve(mass, np.hstack([stiffness, damping])), dtype=np.float64)
    return np.linalg.eigvals(system_matrix(rates[:, :n], rates[:, n:])).astype(np.complex128)


def _modes(mass: Array, damping: Array, stiffness: Array) -> Array:
    # a thrust makes it unsymmetric, a little
    values, shapes = eigh((stiffness + stiffness.T) / 2.0, mass)
    moving = values > STILLEST * values[-1:]
    w = np.sqrt(values[moving])
    shapes = shapes[:, moving]
    ratios = np.einsum("ik,ij,jk->k", shapes, damping, shapes) / (2.0 * w)
    return np.column_stack([w, np.clip(ratios, 0.0, 1.0)])


def craft_at(model: "mujoco.MjModel", qpos: Array, body: int) -> Linear:
    """A quiet model at rest at `qpos`; a wrench on `body` is its input, and the body's
    acceleration its output."""
    point = rest_point(model, qpos)
    return on_base(linear_at(point), point, body)


def counterpart(craft: "mujoco.MjModel", model: "mujoco.MjModel", body: int) -> int:
    """The body of the bare craft in the model with appendages: by its name, where it has one."""
    name = craft.body(body).name
    return int(model.body(name).id) if name else body


class Pose:
    """The bare, quiet craft at a pose, and the exact answer on it.

    `wanted`: motions of the base body that count; all six stand for those that it can make. `band`:
    upper end [rad/s]; `own`: the craft's own degrees of freedom in the compiled model, where left
    out those that are not of `carried`.
    """

    def __init__(
        self,
        craft: "mujoco.MjModel",
        qpos: Array,
        carried: Sequence[PlacedBody],
        band: float,
        wanted: Sequence[int],
        own: Sequence[int] | None = None,
    ) -> None:
        self._qpos: Array = qpos
        self._model: mujoco.MjModel = craft
        self._own: Sequence[int] | None = own
        self.body: int = base_body(craft, carried[0].mount.body)
        #: as it is, and with damping where it has none
        self.bare: Linear = craft_at(craft, qpos, self.body)
        self.extra: Array = extra_damping(self.bare)
        self.craft: Linear = replace(self.bare, damping=self.bare.damping + self.extra)
        data = rest_point(craft, qpos).data()
        self.roots: list[Root] = [root_of(craft, data, item) for item in carried]
        self.jacobians: list[Array] = [root.motion for root in self.roots]
        self.carrying: PortLoads | None = carrying_of(craft, data, self.roots)
        self.carried: Sequence[PlacedBody] = carried
        self.band: float = band
        base = self.bare.outputs.acceleration
        rows = np.linalg.norm(base, axis=1)
        able = [i for i in range(6) if rows[i] > RANK * rows.max(initial=1e-300)]
        self.motions: tuple[int, ...] = tuple(i for i in wanted if i in able)
        if len(self.motions) < len(wanted) < 6:
            self._refuse_axes(wanted, able)
        # the base body's own joints: all others locked
        joints = np.any(base, axis=0)
        locked = self._rigid_mass[np.ix_(joints, joints)]
        rigid = base[:, joints] @ np.linalg.solve(locked, base[:, joints].T)
        inverse = np.linalg.pinv(rigid, rcond=RANK, hermitian=True)
        scale = np.sqrt(np.diag(inverse))[list(self.motions)]
        self.scale: Array = np.outer(scale, scale)
        self.frozen: float = spectral_norm(rigid[np.ix_(self.motions, self.motions)] * self.scale)

    @property
    def loading(self) -> Loading | None:
        """What acts on the craft there; None for nothing."""
        return None

    def _refuse_axes(self, wanted: Sequence[int], able: Sequence[int]) -> NoReturn:
        names = {number: name for name, number in AXES.items()}
        axes, can = (", ".join(names[i] for i in each) for each in (wanted, able))
        raise InputError(
            f"scene.axes = {axes}: body {self._model.body(self.body).name or self.body!r} of the "
            f"spacecraft can only make the motions {can}; name some of these, or leave axes out."
        )

    @cached_property
    def _rigid_mass(self) -> Array:
        """`(nv, nv)` with every appendage frozen."""
        mass = self.bare.mass.copy()
        for jacobian, item in zip(self.jacobians, self.carried, strict=True):
            mass += jacobian.T @ item.whole.rigid_mass @ jacobian
        return mass

    @cached_property
    def rigid_accelerance(self) -> Array:
        """`(6, 6)` of the base body, every appendage frozen and all joints free."""
        base = self.bare.outputs.acceleration
        return base @ np.linalg.solve(self._rigid_mass, base.T)

    @property
    def modal_coordinates(self) -> list[NDArray[np.intp]]:
        """Places of the modes of each exact appendage, behind the craft's own coordinates."""
        nv = len(self.bare.mass)
        ends = nv + np.cumsum([0, *(model.modes for model in self.models)])
        return [np.arange(a, b) for a, b in pairwise(ends.tolist())]

    def own_dofs(self, count: int) -> NDArray[np.intp]:
        """The craft's own degrees of freedom among the `count` of the compiled model."""
        if self._own is not None:
            return np.array(self._own, dtype=np.intp)
        appended = [dof for item in self.carried for dof in item.dofs]
        return np.setdiff1d(np.arange(count), np.array(appended, dtype=np.intp))

    def comparable(self, linear: Linear) -> Linear:
        """The compiled craft with the damping at which it is compared, as the exact answer."""
        damping = linear.damping.copy()
        stiffness = linear.stiffness.copy()
        own = self.own_dofs(damping.shape[0])
        damping[np.ix_(own, own)] += self.extra
        for item in self.carried:
            if item.dofs:  # its cantilever modes
                dofs = np.ix_(item.dofs, item.dofs)
                mass = linear.mass[dofs] if item.alone is None else item.alone
                damping[dofs] += lacking_damping(
                    linear.stiffness[dofs], mass, linear.damping[dofs], item.undamped
                )
            if item.springs is not None and item.dofs and self.loading is None:
                stiffness[item.dofs, item.dofs] += item.springs
        return replace(linear, damping=damping, stiffness=stiffness)

    def accelerance(
        self,
        craft: Linear,
        omega: Array,
        models: Sequence[PortModel] = (),
        roots: Sequence[Array] = (),
    ) -> NDArray[np.complex128]:
        """`(k, n, n)` dimensionless accelerance of a craft's base body in the motions that
        matter, with appendages `models` on its `roots`."""
        hub = craft.picked(inputs=self.motions, outputs=self.motions)
        carrying = self.carrying if models else None
        return np.moveaxis(hub.response(omega, models, roots, carrying), -1, 0) * self.scale

    def response(self, models: Sequence[PortModel], omega: Array) -> NDArray[np.complex128]:
        """`(k, n, n)` dimensionless accelerance of the base body with these appendages,
        damped."""
        return self.accelerance(self.craft, omega, models, self.jacobians)

    def with_appendages(self, models: Sequence[PortModel], craft: Linear | None = None) -> Linear:
        """The craft, or another linear model of it, with these appendages and what their ports
        carry; their modes for coordinates."""
        return (craft or self.craft).with_appendages(models, self.jacobians, self.carrying)

    @cached_property
    def at_samples(self) -> Exact:
        """The craft with every mode of its appendages, to be held against steps."""
        stated = self.with_appendages([item.whole for item in self.carried], self.bare)
        compared = self.with_appendages(self.whole)
        motions = self.motions
        own = self.bare.mass.shape[0]
        pair = (craft.picked(motions, motions) for craft in (stated, compared))
        return Exact(*pair, band=self.band, own=own)

    def _damped(self, models: Sequence[PortModel]) -> list[PortModel]:
        """Appendages with the damping at which they are compared."""
        return [
            with_damping(model, item.undamped)
            for model, item in zip(models, self.carried, strict=True)
        ]

    @cached_property
    def near(self) -> list[PortModel]:
        """The exact appendages with what lies far above the band gathered:
        their peaks are the same."""
        return self._gathered(25.0)

    @cached_property
    def whole(self) -> list[PortModel]:
        """The exact appendages, all their modes, damped."""
        return self._damped([item.whole for item in self.carried])

    @cached_property
    def with_exact(self) -> Linear:
        """The craft with the exact appendages, their modes for coordinates."""
        return self.with_appendages(self.models)

    @property
    def bare_model(self) -> "mujoco.MjModel":
        """The bare craft, compiled."""
        return self._model

    @cached_property
    def models(self) -> list[PortModel]:
        """The exact appendages: all their modes."""
        return self.whole

    @cached_property
    def kept(self) -> list[NDArray[np.bool_]]:
        """Which modes of `models` the chains were asked to keep."""
        return [item.kept for item in self.carried]

    @cached_property
    def peaks(self) -> Array:
        """`(k, 2)` peaks of the exact craft: frequency [rad/s] and damping ratio."""
        return peaks_of_craft(self.with_appendages(self.near))

    @cached_property
    def known(self) -> tuple[Array, Array, NDArray[np.complex128]]:
        """Peaks of the exact craft, a grid that resolves them, and the exact response there."""
        omega = grid_of([self.peaks], self.band)
        return self.peaks, omega, self._exactly(omega)

    def _exactly(self, omega: Array) -> NDArray[np.complex128]:
        """`exact`, solved at each frequency."""
        return self.response(self.whole, omega)

    @cached_property
    def exact(self) -> Response:
        """`response` with the exact appendages, all their modes."""
        if self.carrying is None:
            return self._exactly
        return self._by_poles(self.with_exact, self.whole)[0]

    def _gathered(self, bands: float) -> list[PortModel]:
        """The exact appendages, damped, with the modes beyond so many bands gathered."""
        above = bands * self.band
        return self._damped([item.whole.condensed(above) for item in self.carried])

    @cached_property
    def _exchange(self) -> Exchange:
        return Exchange(self.craft, self.whole, self.jacobians, self.known[1], self.carrying)

    def of_exchange(self, number: int, model: PortModel) -> float:
        """In-band error with `model` for an appendage and all others exact, where the exact craft
        has its peaks."""
        _, omega, exact = self.known
        undamped = self.carried[number].undamped
        pick = np.ix_(range(omega.size), self.motions, self.motions)
        response = self._exchange.response(number, with_damping(model, undamped))[pick]
        return float(np.max(norm_ratios(response * self.scale - exact, self._size)))

    @cached_property
    def _size(self) -> Array:
        """`(k,)` what errors are relative to, at the frequencies of `known`."""
        return np.maximum(spectral_norms(self.known[2]), self.frozen)

    @cached_property
    def _of_nearly_exact(self) -> Response:
        """`exact` to `NEARLY`, for searches: what lies far above the band is gathered, where the
        exact craft has too many modes for its poles."""
        if self.carrying is None or len(self.with_exact.mass) <= MOST:
            return self.exact
        models = self._gathered(FAR)
        response, _ = self._by_poles(self.with_appendages(models), models)
        _, omega, there = self.known
        apart = np.max(relative_error(response(omega), there, self.frozen))
        return response if apart <= NEARLY else self.exact

    def of_models(self, models: Sequence[PortModel], tolerance: float | None = None) -> float:
        """In-band error with `models` for appendages; with a `tolerance` as a search needs it (see
        `maximum_of`)."""
        appendages = self._damped(models)
        together = self.with_appendages(appendages)
        response, poles = self._by_poles(together, appendages)
        return self._error(response, peaks_of_craft(together, poles), tolerance)

    def _by_poles(
        self, craft: Linear, models: Sequence[PortModel] = ()
    ) -> tuple[Response, NDArray[np.complex128] | None]:
        """The response of a craft, by its poles where they can be summed up, and these.

        `models`: the appendages whose modes are coordinates of `craft`; without them its response
        at each frequency is found otherwise.
        """
        whole = self.craft if models else craft
        hub, whole = (
            each.picked(inputs=self.motions, outputs=self.motions) for each in (craft, whole)
        )
        carrying = self.carrying if models else None
        roots = self.jacobians if models else ()
        plain = partial(whole.response, models=models, roots=roots, carrying=carrying)
        fractions = None if self.loading else partial_fractions(hub, self.band, plain)
        response = partial(_scaled, fractions or plain, self.scale)
        return response, None if fractions is None else fractions.poles

    def of_compiled(self, compiled: Linear) -> float:
        """In-band error of what `compiled` gave."""
        response, poles = self._by_poles(compiled)
        return self._error(response, peaks_of_craft(compiled, poles))

    def compiled(self, model: "mujoco.MjModel", qpos: Array, body: int) -> Linear:
        """The quiet compiled `model` at `qpos`, as it is compared with the exact craft."""
        return self.comparable(craft_at(model, qpos, body))

    def changed_by(
        self, loading: Loading, model: "mujoco.MjModel", qpos: Array, body: int
    ) -> float:
        """In-band change of the compiled `model` by a load; infinity where it finds no rest."""
        loaded = PoseUnderLoad(
            loading, self._model, self._qpos, self.carried, self.band, self.motions, self._own
        )
        before = self.compiled(model, qpos, body)
        try:
            after = loaded.compiled(model, qpos, body)
        except EngineError:
            return float("inf")
        omega = grid_of([peaks_of_craft(before), peaks_of_craft(after)], self.band)
        moved, still = (self.accelerance(each, omega) for each in (after, before))
        return float(np.max(relative_error(moved, still, self.frozen)))

    def _error(self, response: Response, peaks: Array, tolerance: float | None = None) -> float:
        """In-band error of any `response` that has these `peaks`."""
        known, omega, exact = self.known
        more = peak_clusters(unresolved_peaks(peaks, known), self.band)
        of_exact = self.exact if tolerance is None else self._of_nearly_exact

        def curve(at: Array) -> Array:
            return relative_error(response(at), of_exact(at), self.frozen)

        values = np.concatenate([norm_ratios(response(omega) - exact, self._size), curve(more)])
        return maximum_of(curve, np.concatenate([omega, more]), values, tolerance)

    def floor(self, models: Sequence[PortModel]) -> Callable[[Sequence[PortModel]], float]:
        """The error of other models where that of these is highest; their in-band error is no
        smaller."""
        damped = self._damped(models)
        _, omega, exact = self.known
        response, _ = self._by_poles(self.with_appendages(damped), damped)
        highest = crests(norm_ratios(response(omega) - exact, self._size))[:TOPS]
        omega, exact = omega[highest], exact[highest]

        def error(others: Sequence[PortModel]) -> float:
            moved = self.response(self._damped(others), omega)
            return float(np.max(relative_error(moved, exact, self.frozen), initial=0.0))

        return error


class PoseUnderLoad(Pose):
    """A pose under what acts on the craft there, its `loading`: the exact appendages bend."""

    def __init__(
        self,
        loading: Loading,
        craft: "mujoco.MjModel",
        qpos: Array,
        carried: Sequence[PlacedBody],
        band: float,
        wanted: Sequence[int],
        own: Sequence[int] | None = None,
    ) -> None:
        super().__init__(craft, qpos, carried, band, wanted, own)
        self._acting = loading

    @property
    def loading(self) -> Loading:
        """What acts on the craft there."""
        return self._acting

    @cached_property
    def _lines(self) -> list[BentLine | HangingLiquid]:
        return [item.line(self.band) for item in self.carried if item.line is not None]

    @cached_property
    def models(self) -> list[PortModel]:
        """The exact appendages: the modes that feel the load."""
        return self._damped([line.model for line in self._lines])

    @cached_property
    def kept(self) -> list[NDArray[np.bool_]]:
        """Which modes of `models` the chains were asked to keep."""
        wanted = [item.slack * item.whole.frequencies[item.kept] for item in self.carried]
        return [
            np.asarray(np.any(np.isclose(each[:, None], model.frequencies), axis=0), dtype=np.bool_)
            for each, model in zip(wanted, self.models, strict=True)
        ]

    @cached_property
    def with_exact(self) -> Linear:
        """The craft with the exact appendages under its load, their modes for coordinates."""
        mounts = [item.mount for item in self.carried]
        tree = LoadedTree(self._model, self._qpos, self.roots, mounts, self._lines, self.loading)
        counts = [model.modes for model in self.models]
        bases = len(self.bare.mass) + np.cumsum([0, *counts])[:-1]
        return tree.loaded(self.with_appendages(self.models), bases.tolist(), self.band)

    @cached_property
    def peaks(self) -> Array:
        """`(k, 2)` peaks of the exact craft: frequency [rad/s] and damping ratio."""
        return peaks_of_craft(self.with_exact)

    def _exactly(self, omega: Array) -> NDArray[np.complex128]:
        return self.accelerance(self.with_exact, omega)

    @cached_property
    def exact(self) -> Response:
        """The accelerance of the exact craft under its load."""
        return self._exactly

    def compiled(self, model: "mujoco.MjModel", qpos: Array, body: int) -> Linear:
        """The quiet compiled `model` at `qpos` under its load, as it is compared with the exact
        craft."""
        free = self.loading.free
        if free is not None:
            free = int(self.own_dofs(model.nv)[free])
        dofs = [dof for item in self.carried for dof in item.dofs]
        linear = super().compiled(model, qpos, body)
        return loaded_linear(linear, model, qpos, dofs, replace(self.loading, free=free))


def _scaled(accelerance: Response, scale: Array, omega: Array) -> NDArray[np.complex128]:
    """`(k, m, m)` accelerance, dimensionless."""
    return np.moveaxis(accelerance(omega), -1, 0) * scale


def root_of(craft: "mujoco.MjModel", data: "mujoco.MjData", item: PlacedBody) -> Root:
    """An appendage's root at a pose."""
    origin, axes = root_frame(item.mount, data)
    jacobian = motion(craft, data, item.mount.body, origin, axes)
    return Root(item.mount.at, origin, axes, jacobian, item.loads)


def craft_poses(
    craft: "mujoco.MjModel",
    carried: Sequence[PlacedBody],
    band: float,
    wanted: Sequence[int],
    own: Sequence[int] | None = None,
    positions: Positions = poses,
    *,
    loaded: bool = False,
) -> dict[str, list[Pose]]:
    """Every pose of the craft with its exact answer, one per base body that carries appendages.

    `own`: the craft's degrees of freedom in the compiled model, where that is compared;
    `positions`: which poses; `loaded`: under its own gravity and the ctrl of its keyframes.
    """
    quiet = quiet_copy(craft)
    groups = by_base(quiet, [item.mount for item in carried])
    loadings = loadings_of(craft, carried) if loaded else {}

    def at(name: str, qpos: Array, base: int) -> Pose:
        members = [carried[i] for i in groups[base]]
        loading = loadings.get((name, base))
        if loading is None:
            return Pose(quiet, qpos, members, band, wanted, own)
        return PoseUnderLoad(loading, quiet, qpos, members, band, wanted, own)

    return {
        name: [at(name, qpos, base) for base in groups] for name, qpos in positions(quiet).items()
    }


def by_base(craft: "mujoco.MjModel", mounts: Sequence[Mount]) -> dict[int, list[int]]:
    """Numbers of the mounts by the base body that carries them."""
    groups: dict[int, list[int]] = {}
    for i, mount in enumerate(mounts):
        groups.setdefault(base_body(craft, mount.body), []).append(i)
    return groups


def acting(
    craft: "mujoco.MjModel", carried: Sequence[PlacedBody]
) -> dict[tuple[str, int], Loading]:
    """What acts on the bare craft at each pose, by its name and the base body."""
    still = still_copy(craft)
    out: dict[tuple[str, int], Loading] = {}
    for k, name in enumerate(poses(craft)):
        for base, members in by_base(craft, [item.mount for item in carried]).items():
            mass = float(craft.body_subtreemass[base])
            mass += sum(float(carried[i].whole.rigid_mass[0, 0]) for i in members)
            loading = loading_at(craft, still, k - 1 if k else None, base, mass)
            if loading is not None:
                out[name, base] = loading
    return out


def loadings_of(
    craft: "mujoco.MjModel", carried: Sequence[PlacedBody]
) -> dict[tuple[str, int], Loading]:
    """`acting`, where the exact spacecraft under it is known.

    Raises:
        InputError: nothing acts, or it is not.
    """
    groups = by_base(craft, [item.mount for item in carried])
    out = acting(craft, carried)
    for name, base in out:
        for item in (carried[i] for i in groups[base]):
            if item.line is None:
                raise InputError(
                    f"the appendage at {item.mount.at} is imported modes, which do not say how "
                    "it stiffens under a load; leave the load out, or describe it as a beam."
                )
        if name != "rest":
            bodies = {b for i in groups[base] for load in carried[i].loads for b in load.bodies}
            check_pushes(craft, list(poses(craft)).index(name) - 1, sorted(bodies), name)
    if not out:
        raise InputError(
            "no load acts on the spacecraft: its gravity is zero or its base is free and falls "
            "with it, and no keyframe has a ctrl that pushes it; hold its base (no free joint), or "
            'give a keyframe the thrust (<key name="burn" ctrl="22"/>).'
        )
    return out


def craft_error(
    craft: "mujoco.MjModel",
    model: "mujoco.MjModel",
    exact: Mapping[str, list[Pose]],
    positions: Mapping[str, Array] | None = None,
) -> CraftError:
    """The craft's promise as the compiled model keeps it, against the answers of `craft_poses`
    for the bare `craft`; `positions` of the model by pose, those of the file where left out."""
    model = quiet_copy(model)
    positions = positions or poses(model)
    errors: dict[str, float] = {}
    worst: tuple[float, Pose] | None = None
    grows: dict[str, tuple[float, float]] = {}
    for name, several in exact.items():
        for pose in several:
            body = counterpart(craft, model, pose.body)
            compiled = pose.compiled(model, positions[name], body)
            error = pose.of_compiled(compiled)
            errors[name] = max(errors.get(name, 0.0), error)
            if worst is None or error > worst[0]:
                worst = error, pose
            if pose.loading is not None:
                rates = [growth(each, pose.band) for each in (pose.with_exact, compiled)]
                known = grows.get(name, (0.0, 0.0))
                grows[name] = max(rates[0], known[0]), max(rates[1], known[1])
    assert worst is not None  # an appendage hangs on some body
    error, pose = worst
    body_name = craft.body(pose.body).name or f"body {pose.body}"
    grows = {name: rates for name, rates in grows.items() if max(rates) > 0.0}
    return CraftError(error, pose.band, errors, pose.motions, body_name, grows)
