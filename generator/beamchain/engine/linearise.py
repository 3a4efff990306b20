"""MuJoCo's own linearisation, undone exactly: A,
B of `mjd_transitionFD` -> the continuous system -> a port model.

The semi-implicit step is `v+ = v + h a(q, v+)`, `q+ = q + h v+`, so that the blocks of A and B
give `M^-1 K`, `M^-1 D` and `M^-1 B` without a limit h -> 0, even at a step at which the simulation
would be unstable.

Theory: docs/theory.md, section 6.
"""

from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from beamchain.checks import is_mjcf_text, of_type, path_of, positive
from beamchain.engine.library import mujoco, one_thread
from beamchain.engine.model_checks import check_model
from beamchain.errors import EngineError, InputError
from beamchain.files import check_utf8, no_file, note_input
from beamchain.import_lock import importing
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array, locked, system_matrix

if TYPE_CHECKING:
    import control

MOST_FREEDOMS = 2000  # matrices of its square, differences of its cube: 0.7 s at 200
LITTLE = 1e-9  # of the mass of bodies that are left out
EPSILON = 1e-6  # perturbation of the centred differences
DEPENDENT = 1e-11  # singular value of unit columns from which they depend on each other
# the same for velocities: the integrator "discrete" does not see damping forces of 1e-9
VELOCITY = 1e-3

#: Of the installed MuJoCo; "discrete" is not in all versions.
INTEGRATORS = {
    name: int(getattr(mujoco.mjtIntegrator, f"mjINT_{name.upper()}"))
    for name in ("Euler", "implicit", "implicitfast", "discrete", "RK4")
    if hasattr(mujoco.mjtIntegrator, f"mjINT_{name.upper()}")
}
NUMBERS = {number: name for name, number in INTEGRATORS.items()}


def euler_damps_implicitly(model: "mujoco.MjModel") -> bool:
    """Whether Euler takes the dampers of joints at the end of the step, as it does unless the flag
    `eulerdamp` switches that off."""
    return not int(model.opt.disableflags) & int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)


def compile_model(source: "mujoco.MjModel | str | Path") -> "mujoco.MjModel":
    """A compiled model from a model, MJCF text or a path; its numbers are checked afterwards."""
    if isinstance(source, mujoco.MjModel):
        return source
    text = is_mjcf_text(source)
    wanted = "a compiled mujoco.MjModel, or the path or the text of an MJCF (.xml) file"
    path = Path() if text else path_of("model", source, wanted)
    what = "model" if text else f"model {str(path)!r}"
    if not text:
        note_input(path)
        kind = no_file(path)
        if kind:
            raise InputError(f"model {str(path)!r} {kind}; give the path of an MJCF (.xml) file.")
    is_xml = text or path.suffix.lower() != ".mjb"
    read = mujoco.MjModel.from_xml_path if is_xml else mujoco.MjModel.from_binary_path
    content = b""
    if is_xml:
        content = str(source).encode("utf-8") if text else path.read_bytes()
    try:
        model = mujoco.MjModel.from_xml_string(str(source)) if text else read(str(path))
    except ValueError as error:
        check_utf8(content, what)  # a likelier reason
        raise EngineError(
            f"MuJoCo refuses {'the model' if text else repr(str(path))}: {error}"
        ) from None
    if is_xml and not _is_utf8(model.names):
        check_utf8(content, what)
    check_model(model, what)
    return model


def _is_utf8(names: bytes) -> bool:
    try:
        names.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True


def check_freedoms(model: "mujoco.MjModel") -> None:
    """Refuse a model with nothing to linearise, or with too much."""
    if model.nv == 0:
        raise EngineError(
            "the model has no degree of freedom to linearise; put it on a joint (the bench does)."
        )
    if model.nv > MOST_FREEDOMS:
        raise EngineError(
            f"the model has {model.nv} degrees of freedom; at most {MOST_FREEDOMS} are linearised: "
            "freeze what does not matter (joints, soft bodies)."
        )


class Held(NamedTuple):
    """A linearised model with its root held, `n` modes and `m` motions;
    `reaction x drive` is the sum of `W^2 L L^T`."""

    apparent: Array  # (m, m) mass of the port with the joints loose
    squares: Array  # (n,) frequencies squared, ascending [1/s^2]
    reaction: Array  # (m, n) wrench of each mode on the root
    drive: Array  # (n, m) of the root's acceleration on each mode
    ratios: Array  # (n,) of damping

    def rows(self, groups: Iterable[Sequence[int]]) -> Array:
        """`(n, m)` participation, the modes of each group of equal frequency taken together."""
        out = np.zeros(self.drive.shape)
        for group in map(list, groups):
            # the sum over a group of W^2 L L^T is its own, whatever its eigenvectors:
            # the leading eigenpairs are the rows
            both = (
                self.reaction[:, group, None] * self.drive[group] / self.squares[group, None]
            ).sum(axis=1)
            values, vectors = np.linalg.eigh((both + both.T) / 2.0)
            # more modes than motions: those left over move nothing
            top = max(values.size - len(group), 0)
            out[group[: values.size]] = (
                vectors[:, top:] * np.sqrt(np.clip(values[top:], 0.0, None))
            ).T[::-1]
        return out


@dataclass(frozen=True, eq=False, repr=False)
class Linearisation:
    """A MuJoCo model linearised about a state.

    Args:
        stiffness: `(nv, nv)` `M^-1 K` [1/s^2].
        damping: `(nv, nv)` `M^-1 D` [1/s].
        inputs: `(nv, nu)` `M^-1 B`.
        a, b, c, d: discrete matrices of the model's own integrator and step; states (q, v).
        timestep: [s].
        integrator: MuJoCo's name.
        joints: `(nv,)` joint name of each degree of freedom.
        driven: `(nu,)` degree of freedom each motor drives; -1: no plain joint motor of unit gear.

    Example:
        >>> import beamchain as bc
        >>> oscillator = '''<mujoco><worldbody><body><joint type="slide" stiffness="16"/>
        ... <inertial pos="0 0 0" mass="4" diaginertia="1 1 1"/></body></worldbody></mujoco>'''
        >>> bc.linearise(oscillator).continuous.poles().round(6)
        array([0.+2.j, 0.-2.j])
    """

    stiffness: Array
    damping: Array
    inputs: Array
    a: Array
    b: Array
    c: Array
    d: Array
    timestep: float
    integrator: str
    joints: tuple[str, ...]
    driven: tuple[int, ...]

    def __repr__(self) -> str:
        return (
            f"<Linearisation, {len(self.joints)} degrees of freedom, {len(self.driven)} motors, "
            f"{self.integrator} at {self.timestep:g} s>"
        )

    @property
    def discrete(self) -> "control.StateSpace":
        """The step as MuJoCo takes it, `control.StateSpace` with dt."""
        self._check_states(self.a.shape[0])
        with importing:
            import control

        return cast("control.StateSpace", control.ss(self.a, self.b, self.c, self.d, self.timestep))

    @property
    def continuous(self) -> "control.StateSpace":
        """The system `q'' = -M^-1 K q - M^-1 D q' + M^-1 B u`, states (q, q')."""
        self._check_states(2 * len(self.joints))
        with importing:
            import control

        a = system_matrix(self.stiffness, self.damping)
        b = np.vstack([0.0 * self.inputs, self.inputs])
        return cast("control.StateSpace", control.ss(a, b, self.c, self.d))

    def _check_states(self, states: int) -> None:
        """Refuse a system that leaves out what outputs are read from: states of actuators."""
        if self.c.shape[1] != states:
            raise EngineError(
                f"the model has actuators with {self.c.shape[1] - 2 * len(self.joints)} states, "
                "which this system does not hold; take bc.Linear.of(...).first_order()."
            )

    def frequencies(self) -> Array:
        """Undamped natural frequencies above zero, ascending [rad/s]."""
        # a rigid motion is a column of zeros, or a combination of columns that is nothing
        sizes = np.linalg.norm(self.stiffness, axis=0)
        moving = int(
            np.linalg.matrix_rank(
                self.stiffness[:, sizes > 0.0] / sizes[sizes > 0.0], tol=DEPENDENT
            )
        )
        # the stiffest first: a matrix that is graded downwards keeps the digits of slow modes
        order = np.argsort(-np.abs(np.diag(self.stiffness)), kind="stable")
        live = [int(i) for i in order if sizes[i] > 0.0]
        squares = np.linalg.eigvals(self.stiffness[np.ix_(live, live)])
        squares = squares[np.argsort(-np.abs(squares))[:moving]].real
        return np.sqrt(np.sort(squares[squares > 0.0]))

    def discrete_frequencies(self) -> tuple[Array, Array]:
        """`|log z| / h` [rad/s] and damping ratios of oscillating discrete poles."""
        poles = np.linalg.eigvals(self.a)
        s = np.log(poles[np.imag(poles) > 1e-9].astype(np.complex128)) / self.timestep
        s = s[np.argsort(np.abs(s))]
        return np.abs(s), -s.real / np.abs(s)

    def port(
        self, dofs: "tuple[int, ...] | None" = None, ballast: Array | None = None
    ) -> PortModel:
        """The port model seen at the driven joints.

        Args:
            dofs: degrees of freedom that take part (driven ones and hinges of one port);
                all where left out.
            ballast: `(m, m)` mass matrix on the port that is not the appendage's.

        Raises:
            EngineError: no joint is driven, or the port's inertia is singular.
        """
        use = set(range(self.stiffness.shape[0]) if dofs is None else dofs)
        motors = [(i, dof) for i, dof in enumerate(self.driven) if dof in use]
        if not motors:
            raise EngineError(
                "no joint of the port is driven; give every motion of the root a <motor> with unit "
                "gear."
            )
        root = [dof for _, dof in motors]
        inner = sorted(use - set(root))
        columns = [i for i, _ in motors]
        held = self.held(root, inner, columns, np.eye(len(root)))
        rigid = (held.apparent + held.apparent.T) / 2.0 - (0.0 if ballast is None else ballast)
        participation = held.rows([k] for k in range(held.squares.size))
        return PortModel(
            rigid + participation.T @ participation,
            np.sqrt(held.squares),
            participation,
            held.ratios,
        )

    def held(self, root: list[int], inner: list[int], columns: list[int], turn: Array) -> Held:
        """The model with its root held.

        Args:
            root, inner: numbers of the degrees of freedom that are held, and of the others.
            columns: numbers of the inputs that drive the root.
            turn: `(m, m)` signs of its motions.
        """
        apparent: Array = np.asarray(
            np.linalg.inv(turn @ self.inputs[np.ix_(root, columns)] @ turn), dtype=np.float64
        )
        follow = self.inputs[np.ix_(inner, columns)] @ turn @ apparent
        pull = turn @ self.stiffness[np.ix_(root, inner)]
        squares, right = np.linalg.eig(self.stiffness[np.ix_(inner, inner)] - follow @ pull)
        order = np.argsort(np.real(squares))
        squares, right = np.real(squares)[order], np.real(right)[:, order]
        if np.any(squares <= 0.0):
            raise EngineError(
                "a joint of the held appendage has no positive stiffness; the port model needs "
                "every joint sprung."
            )
        left = np.linalg.inv(right)
        damping = (
            self.damping[np.ix_(inner, inner)] - follow @ turn @ self.damping[np.ix_(root, inner)]
        )
        ratios = np.diag(left @ damping @ right) / (2.0 * np.sqrt(squares))
        return Held(
            apparent,
            squares,
            apparent @ pull @ right,
            left @ follow,
            np.where(np.abs(ratios) < 1e-14, 0.0, ratios),
        )

    def coupling(self, groups: "list[tuple[int, ...]]") -> float:
        """Largest coupling between groups of degrees of freedom, relative:
        how far ports are from independent.

        Two measures, the larger counts: M^-1 K and M^-1 D between the groups, and what a motor of
        one group does to the driven joints of another, over the whole range of frequencies (it also
        sees a group that is rigid).
        """
        worst = self._crosstalk(groups)
        for i, first in enumerate(groups):
            for second in groups[i + 1 :]:
                for matrix in (self.stiffness, self.damping):
                    across = (
                        np.abs(matrix[np.ix_(first, second)])
                        * np.abs(matrix[np.ix_(second, first)]).T
                    )
                    inside = np.outer(
                        np.abs(np.diag(matrix)[list(first)]), np.abs(np.diag(matrix)[list(second)])
                    )
                    with np.errstate(divide="ignore", invalid="ignore"):
                        ratio = np.sqrt(np.where(inside > 0.0, across / inside, 0.0))
                    worst = max(worst, float(np.max(ratio, initial=0.0)))
        return worst

    def _crosstalk(self, groups: "list[tuple[int, ...]]") -> float:
        """Largest `|X_ij| / sqrt(|X_ii X_jj|)` of the receptance between groups."""
        member = {dof: k for k, group in enumerate(groups) for dof in group}
        motors = [(i, dof) for i, dof in enumerate(self.driven) if dof in member]
        of = np.array([member[dof] for _, dof in motors])
        if np.unique(of).size < 2:
            return 0.0
        columns = [i for i, _ in motors]
        rows = [dof for _, dof in motors]
        frequencies = self.frequencies()
        eye = np.eye(self.stiffness.shape[0])
        worst = 0.0
        grid = np.array([1.0])
        if frequencies.size:
            grid = np.geomspace(0.3 * frequencies[0], 3.0 * frequencies[-1], 9)
        for omega in grid:
            s = omega * (0.05 + 1j)  # beside the axis: no pole is met
            x = np.linalg.solve(
                s**2 * eye + s * self.damping + self.stiffness, self.inputs[:, columns]
            )[rows]
            scale = np.sqrt(np.abs(np.diag(x)))
            share = np.abs(x) / np.outer(scale, scale)
            worst = max(worst, float(np.max(share[of[:, None] != of[None, :]])))
        return worst


@one_thread()
def linearise(
    source: "mujoco.MjModel | str | Path",
    data: "mujoco.MjData | None" = None,
    epsilon: float = EPSILON,
) -> Linearisation:
    """Linearise a MuJoCo model through `mjd_transitionFD`, centred.

    Args:
        source: a compiled model, MJCF text, or a path.
        data: the state to linearise about; the initial one where left out.
        epsilon: perturbation.

    Returns:
        The continuous system recovered exactly (the model is linearised with implicitfast) and
        the discrete one of the model's own integrator and step (RK4's from the continuous system,
        by its polynomial).

    Raises:
        EngineError: the model does not compile, or has no degree of freedom.

    Example:
        >>> import beamchain as bc
        >>> oscillator = '''<mujoco><worldbody><body><joint type="slide" stiffness="16"/>
        ... <inertial pos="0 0 0" mass="4" diaginertia="1 1 1"/></body></worldbody></mujoco>'''
        >>> bc.linearise(oscillator).stiffness.round(6)
        array([[4.]])
    """
    model = compile_model(source)
    check_freedoms(model)
    if data is None:
        data = mujoco.MjData(model)
    of_type("data", data, mujoco.MjData, "a mujoco.MjData of the model")
    epsilon = positive("epsilon", epsilon, "")
    name = NUMBERS[int(model.opt.integrator)]
    a, b, c, d = transition(model, data, epsilon, "implicitfast")
    nv = model.nv
    h = float(model.opt.timestep)
    kept = a[nv : 2 * nv, nv : 2 * nv]
    if not np.all(np.isfinite(kept)) or np.linalg.matrix_rank(kept) < nv:
        raise EngineError(
            f"a step of {h:g} s leaves no motion in a joint of the model ({nv} degrees of "
            "freedom): its numbers lie too far apart for double precision; check the units of "
            "masses, lengths and stiffnesses."
        )
    x = np.linalg.inv(kept)
    stiffness = -x @ a[nv : 2 * nv, :nv] / h
    is_rounding = np.abs(stiffness) <= _rounding(model, data, epsilon)[:, None]
    stiffness[:, np.all(is_rounding, axis=0)] = 0.0  # rigid motions
    damping = (x - np.eye(nv)) / h
    inputs = x @ b[nv : 2 * nv] / h
    if name == "RK4":  # states and held inputs in one matrix
        both = np.zeros((2 * nv + model.nu, 2 * nv + model.nu))
        both[: 2 * nv, : 2 * nv] = h * system_matrix(stiffness, damping)
        both[nv : 2 * nv, 2 * nv :] = h * inputs
        both = runge_kutta_change(both)
        a = np.eye(2 * nv) + both[: 2 * nv, : 2 * nv]
        b = both[: 2 * nv, 2 * nv :]
    elif name != "implicitfast":
        a, b, c, d = transition(model, data, epsilon, name)
    matrices = (locked(v) for v in (stiffness, damping, inputs, a, b, c, d))
    joints = tuple(model.joint(int(j)).name for j in model.dof_jntid)
    return Linearisation(
        *matrices, timestep=h, integrator=name, joints=joints, driven=_motor_freedoms(model)
    )


def _rounding(model: "mujoco.MjModel", data: "mujoco.MjData", epsilon: float) -> Array:
    """`(nv,)` what rounding of velocities and forces leaves of their differences in the rows of
    `M^-1 K` [1/s^2]."""
    here = copy(data)
    mujoco.mj_forward(model, here)
    forces = np.abs([here.qfrc_bias, here.qfrc_passive, here.qfrc_actuator, here.qfrc_applied])
    most = np.max(np.abs(np.linalg.inv(dense_mass(model, here))) @ forces.sum(axis=0))
    change = most + np.abs(here.qvel) / float(model.opt.timestep)
    return 4.0 * np.finfo(np.float64).eps * change / epsilon


def runge_kutta_change(f: Array) -> Array:
    """RK4's `exp(f) - 1`, to fourth order, for system matrices times the step `(..., n, n)`."""
    mean = np.eye(f.shape[-1])
    for k in (4, 3, 2):
        mean = np.eye(f.shape[-1]) + f @ mean / k
    return f @ mean


def transition(
    model: "mujoco.MjModel", data: "mujoco.MjData", epsilon: float, integrator: str
) -> tuple[Array, Array, Array, Array]:
    """A, B, C, D of `mjd_transitionFD`, states (q, v, activations)."""
    n = 2 * model.nv + model.na
    nu = model.nu
    ns = model.nsensordata
    a = np.zeros((n, n))
    b = np.zeros((n, nu))
    c = np.zeros((ns, n))
    d = np.zeros((ns, nu))
    same = copy(model)  # the given one may be in use elsewhere
    same.opt.integrator = INTEGRATORS[integrator]
    try:
        mujoco.mjd_transitionFD(
            same,
            data,
            epsilon,
            True,
            a,
            b if nu else None,
            c if ns else None,
            d if ns and nu else None,
        )
    except (mujoco.FatalError, ValueError) as error:
        raise EngineError(f"MuJoCo could not linearise the model: {error}") from None
    if not (np.all(np.isfinite(a)) and np.all(np.isfinite(b))):
        raise EngineError(
            "MuJoCo's linearisation is not finite; the model's masses or stiffnesses are out of "
            "range."
        )
    return a, b, c, d


def mass_matrix(model: "mujoco.MjModel", qpos: Array | None = None) -> Array:
    """`(nv, nv)` mass matrix, armature included."""
    data = mujoco.MjData(model)
    if qpos is not None:
        data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    return dense_mass(model, data)


def mass_of_alone(model: "mujoco.MjModel", bodies: Sequence[int]) -> Array:
    """`(nv, nv)` mass matrix of some bodies alone, all others without mass, at the initial pose;
    armature included."""
    others = np.setdiff1d(np.arange(model.nbody), np.asarray(bodies, dtype=np.intp))
    alone = copy(model)
    alone.body_mass[others] *= LITTLE
    alone.body_inertia[others] *= LITTLE
    # MuJoCo needs a little everywhere; the matrix is linear in the masses
    return (mass_matrix(alone) - LITTLE * mass_matrix(model)) / (1.0 - LITTLE)


def dense_mass(model: "mujoco.MjModel", data: "mujoco.MjData") -> Array:
    """`(nv, nv)` mass matrix of a state that `mj_forward` has seen."""
    out = np.zeros((model.nv, model.nv))
    column = np.zeros(model.nv)
    for i, unit in enumerate(np.eye(model.nv)):
        mujoco.mj_mulM(model, data, column, unit)
        out[:, i] = column
    return (out + out.T) / 2.0


def integrators_of(model: "mujoco.MjModel") -> tuple[str, ...]:
    """The integrators of the installed MuJoCo that take a model; "discrete" does not take every
    flex."""
    out: list[str] = []
    for name, number in INTEGRATORS.items():
        trial = copy(model)
        trial.opt.integrator = number
        try:
            mujoco.mj_forward(trial, mujoco.MjData(trial))
        except mujoco.FatalError:
            continue
        out.append(name)
    return tuple(out)


def implicit_stiffness(model: "mujoco.MjModel", data: "mujoco.MjData", damping: Array) -> Array:
    """`(nv, nv)` the share of `M^-1 K` [1/s^2] implicit in "discrete": joints' springs."""
    nv = model.nv
    h = float(model.opt.timestep)
    a, *_ = transition(model, data, VELOCITY, "discrete")
    return (np.linalg.inv(a[nv : 2 * nv, nv : 2 * nv]) - np.eye(nv) - h * damping) / h**2


def _motor_freedoms(model: "mujoco.MjModel") -> tuple[int, ...]:
    """The degree of freedom that each actuator drives; -1: no plain joint motor."""
    plain = (model.actuator_trntype == int(mujoco.mjtTrn.mjTRN_JOINT)) & (
        model.actuator_gear[:, 0] == 1.0
    )
    joints = zip(plain, model.actuator_trnid[:, 0], strict=True)
    return tuple(int(model.jnt_dofadr[joint]) if direct else -1 for direct, joint in joints)
