"""Read an exported appendage back from MuJoCo: nothing from the package.

The file's root body is welded to the world, so the compiled model's velocities are the appendage's
own hinges and slides. Rows of the square root of mass over (root motions, joints) come from the
Jacobians and inertias of the bodies and from the armatures of joints and tendons; rows of the
square root of stiffness from the springs of joints and tendons. Modes are singular values of one
over the other, so that no digits are lost by forming M and K.

`transition` reads the same numbers from `mjd_transitionFD` of the appendage on a free
base, to some 1e-9.
"""

import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np
from scipy.linalg import block_diag

from finite_elements import first_sign, freed, into_space, strained
from mechanics import first, tendon_rows
from solver import moved


# -- files -----------------------------------------------------------------------------------------
def text_of(source):
    """The XML text of a path, or the text itself."""
    return (
        source
        if isinstance(source, str) and source.lstrip().startswith("<")
        else Path(source).read_text()
    )


def with_payload(source, site, mass, inertia=(0.0, 0.0, 0.0)):
    """The file's text with a rigid body welded at a site,
    its centre there and its axes along the site's body."""
    tree = ET.fromstring(text_of(source))
    parent = {child: above for above in tree.iter() for child in above}
    (spot,) = [s for s in tree.iter("site") if s.get("name") == site]
    body = ET.SubElement(
        parent[spot], "body", name="attached_payload", pos=spot.get("pos", "0 0 0")
    )
    least = 1e-9 * mass  # MuJoCo wants an inertia
    turn = " ".join(repr(max(float(v), least)) for v in inertia)
    ET.SubElement(body, "inertial", pos="0 0 0", mass=repr(float(mass)), diaginertia=turn)
    return ET.tostring(tree, encoding="unicode")


def on_free_base(source, ballast, motors=True):
    """The file's text with its root body on six slides and hinges and a rigid body `ballast`
    (mass, inertia) there."""
    tree = ET.fromstring(text_of(source))
    world = tree.find("worldbody")
    (root,) = world.findall("body")
    base = ET.SubElement(world, "body", name="free_base", pos=root.get("pos", "0 0 0"))
    axes = ("1 0 0", "0 1 0", "0 0 1")
    names = []
    for kind in ("slide", "hinge"):
        for axis in axes:
            names.append(f"base_{kind}_{axis[::2]}")
            ET.SubElement(
                base,
                "joint",
                name=names[-1],
                type=kind,
                axis=axis,
                pos="0 0 0",
                damping="0",
                armature="0",
            )
    mass, inertia = ballast
    turn = " ".join(repr(float(v)) for v in inertia)
    ET.SubElement(base, "inertial", pos="0 0 0", mass=repr(float(mass)), diaginertia=turn)
    world.remove(root)
    root.set("pos", "0 0 0")
    base.append(root)
    names += [j.get("name") for j in root.iter("joint")]
    if motors:
        actuator = tree.find("actuator")
        if actuator is not None:
            tree.remove(actuator)
        actuator = ET.SubElement(tree, "actuator")
        for name in names:
            ET.SubElement(actuator, "motor", joint=name, gear="1")
    for old in tree.findall("option"):
        tree.remove(old)
    option = ET.SubElement(
        tree, "option", gravity="0 0 0", integrator="implicitfast", timestep="0.001"
    )
    ET.SubElement(option, "flag", contact="disable", constraint="disable")
    return ET.tostring(tree, encoding="unicode")


# -- square roots ----------------------------------------------------------------------------------
@dataclass(frozen=True)
class Reading:
    """An appendage as MuJoCo has it, root held; `n` modes by frequency, mass normalised.

    Attributes:
        name: prefix of its bodies.
        rigid: `(6, 6)` mass matrix about the root, motions (x, y, z, rotations).
        frequencies: `(n,)` [rad/s].
        participation: `(n, 6)` `R^T M phi`, first number that is not negligible positive.
        ratios: `(n,)` damping ratios, the diagonal of modal damping.
        damping: `(n, n)` modal damping matrix.
        shapes: `(nv, n)` joint motions.
        moving, carried: rows of the mass's square root over joints and over motions of the root.
        strain, damper: rows of the square roots of stiffness and damping over joints.
        elastic, back: `moving` and the joints themselves over strain coordinates y (strain
            energy |y|^2 / 2).
        joints, tendons: names.
        model, data: MuJoCo's, at rest.
    """

    name: str
    rigid: np.ndarray
    frequencies: np.ndarray
    participation: np.ndarray
    ratios: np.ndarray
    damping: np.ndarray
    shapes: np.ndarray
    moving: np.ndarray = field(repr=False)
    carried: np.ndarray = field(repr=False)
    strain: np.ndarray = field(repr=False)
    damper: np.ndarray = field(repr=False)
    elastic: np.ndarray = field(repr=False)
    back: np.ndarray = field(repr=False)
    joints: tuple = ()
    tendons: tuple = ()
    model: object = field(default=None, repr=False)
    data: object = field(default=None, repr=False)

    # -- ports -------------------------------------------------------------------------------------
    @property
    def scale(self):
        """`(6,)` square roots of the rigid masses, 1 where there is none."""
        diagonal = np.diag(self.rigid)
        return np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))

    def kinds(self):
        """The port of each joint."""
        return np.array([_kind(self.model, self.data, j) for j in range(self.model.njnt)])

    def port(self, port):
        """Frequencies `(k,)`, participation `(k, m)` and damping ratios of one port
        of a straight chain.

        Only the joints of that port move, so that equal frequencies of two planes do not mix;
        `coupling` tells whether that is right. Signs as in a plane: force participation positive.
        """
        pick = self.kinds() == port
        turn = into_space(port)
        if not np.any(pick):
            return np.zeros(0), np.zeros((0, turn.shape[1])), np.zeros(0)
        moving, strain, damper = (rows[:, pick] for rows in (self.moving, self.strain, self.damper))
        found = _modes(moving, self.carried, strain, damper)
        rows = found["participation"] @ turn
        signs = np.array([first_sign(r / (self.scale @ np.abs(turn))) for r in rows])
        return (
            found["frequencies"],
            rows * signs[:, None],
            np.diag(found["damping"]) / 2.0 / found["frequencies"],
        )

    def coupling(self):
        """Largest relative coupling between ports in mass,
        stiffness and with other motions of the root."""
        kinds = self.kinds()
        worst = 0.0
        apart = kinds[:, None] != kinds[None, :]
        for rows in (self.moving, self.strain):
            gram = rows.T @ rows
            size = np.sqrt(np.diag(gram))
            worst = max(
                worst, float(np.max(np.abs(gram / np.outer(size, size)) * apart, initial=0.0))
            )
        push = (
            self.moving.T @ self.carried / np.linalg.norm(self.moving, axis=0)[:, None] / self.scale
        )
        for row, kind in zip(push, kinds, strict=True):
            own = np.abs(into_space(kind)).sum(axis=1) > 0.0
            worst = max(worst, float(np.max(np.abs(row[~own]))))
        return worst

    # -- other places ------------------------------------------------------------------------------
    def site(self, name):
        """`(n, 6)` motion (displacement, rotation) of a site in each mode, root held."""
        return (_site_rows(self.model, self.data, name) @ self.shapes).T

    def flexibility(self, name):
        """`(6, 6)` motion of a site per unit force and moment on it, root held."""
        rows = _site_rows(self.model, self.data, name) @ self.back
        return rows @ rows.T

    def coupled(self, hub=None, modes=None, site=None, payload=None):
        """Elastic frequencies with the root free on a rigid hub and a rigid payload at a site.

        Args:
            hub: `(6, 6)` about the root; None: nothing there; "held": the root is held.
            modes: how many.
            site: where the payload sits.
            payload: (mass, principal inertia) of it.
        """
        elastic = self.elastic
        carried = self.carried
        if payload is not None:
            at = _site_rows(self.model, self.data, site) @ self.back
            where = self.data.site(site).xpos - self.root
            mass, inertia = payload
            root = np.sqrt([mass] * 3 + list(inertia))[:, None]
            elastic = np.vstack([elastic, root * at])
            carried = np.vstack([carried, root * moved(np.eye(6), where)])
        if isinstance(hub, str):
            assert hub == "held"
        else:
            elastic = freed(elastic, carried, hub)
        values = np.linalg.svd(elastic, compute_uv=False)
        return 1.0 / values[: modes or values.size]

    @property
    def root(self):
        """Position of the root in the world."""
        return self.data.xpos[1].copy()

    def accelerance(self, frequency, ratios=True):
        """`(6, 6)` acceleration of the free root per wrench on it at one frequency [rad/s]."""
        return np.linalg.inv(self.dynamic_mass(frequency, ratios))

    def dynamic_mass(self, frequency, ratios=True):
        """`(6, 6)` wrench needed per unit acceleration of the root at one frequency [rad/s],
        modal damping."""
        w, s = self.frequencies, 1j * frequency
        zeta = self.ratios if ratios else np.zeros_like(w)
        gain = s**2 / (s**2 + 2.0 * zeta * w * s + w**2)
        return self.rigid - (self.participation.T * gain) @ self.participation


def _site_rows(model, data, name):
    at = np.zeros((3, model.nv))
    turn = np.zeros((3, model.nv))
    site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, name)
    if site < 0:
        raise KeyError(f"no site {name!r}")
    mujoco.mj_jacSite(model, data, at, turn, site)
    return np.vstack([at, turn])


def _kind(model, data, joint):
    """The port of a joint by its axis in the world."""
    axis = np.argmax(np.abs(data.xaxis[joint]))
    if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE:
        return ("axial", "xy", "xz")[axis]
    return ("torsion", "xz", "xy")[axis]


def compiled(source):
    """MuJoCo's model and data at rest, without gravity's, contacts' or constraints' part."""
    model = mujoco.MjModel.from_xml_string(text_of(source))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def _rows(model, data, root):
    """Square-root rows of mass over joints and over motions of `root`,
    and of stiffness over joints."""
    moving, carried = [], []
    for body in range(1, model.nbody):
        mass = model.body_mass[body]
        inertia = model.body_inertia[body]
        if mass == 0.0:
            continue
        at = np.zeros((3, model.nv))
        turn = np.zeros((3, model.nv))
        mujoco.mj_jacBodyCom(model, data, at, turn, body)
        frame = data.ximat[body].reshape(3, 3).T  # rows: principal axes
        where = data.xipos[body] - root
        own = block_diag(np.sqrt(mass) * np.eye(3), np.sqrt(inertia)[:, None] * frame)
        moving.append(own @ np.vstack([at, turn]))
        carried.append(own @ moved(np.eye(6), where))
    tendons = tendon_rows(model)
    own = np.vstack(
        [np.diag(np.sqrt(model.dof_armature)), np.sqrt(model.tendon_armature)[:, None] * tendons]
    )
    moving.append(own)
    carried.append(np.zeros((own.shape[0], 6)))
    springs = np.zeros(model.nv)
    springs[model.jnt_dofadr] = first(model.jnt_stiffness)
    strain = np.vstack(
        [np.diag(np.sqrt(springs)), np.sqrt(first(model.tendon_stiffness))[:, None] * tendons]
    )
    damper = np.vstack(
        [
            np.diag(np.sqrt(first(model.dof_damping))),
            np.sqrt(first(model.tendon_damping))[:, None] * tendons,
        ]
    )
    return np.vstack(moving), np.vstack(carried), strain, damper


def _modes(moving, carried, strain, damper):
    """Modes of what moves in the given joints, root held."""
    scale = np.linalg.norm(strain, axis=0)
    if np.any(scale == 0.0) or strain.shape[1] == 0:
        raise ValueError("a joint has no stiffness")
    elastic, back = strained(strain, moving)
    left, values, right = np.linalg.svd(elastic, full_matrices=False)
    if values[-1] < 1e-14 * values[0]:
        raise ValueError("a joint moves no mass")
    shapes = back @ right.T / values
    participation = left.T @ carried
    size = np.linalg.norm(carried, axis=0)
    signs = np.array([first_sign(row / np.where(size > 0.0, size, 1.0)) for row in participation])
    shapes = shapes * signs
    modal = damper @ shapes
    return {
        "frequencies": 1.0 / values,
        "participation": participation * signs[:, None],
        "shapes": shapes,
        "damping": modal.T @ modal,
        "elastic": elastic,
        "back": back,
    }


def read(source, root=None):
    """Read an appendage's file (path or text) with its root welded to the world.

    Args:
        source: path or XML text.
        root: `(3,)` position of the port; that of the first body where left out.

    Raises:
        ValueError: a joint has no stiffness.
    """
    model, data = compiled(source)
    assert model.nv == model.njnt, "hinges and slides only"
    root = data.xpos[1].copy() if root is None else np.asarray(root, dtype=float)
    moving, carried, strain, damper = _rows(model, data, root)
    found = _modes(moving, carried, strain, damper)
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, 1) or ""
    return Reading(
        name=name.rsplit("_link", 1)[0],
        rigid=carried.T @ carried,
        ratios=np.diag(found["damping"]) / (2.0 * found["frequencies"]),
        moving=moving,
        carried=carried,
        strain=strain,
        damper=damper,
        joints=tuple(model.joint(j).name for j in range(model.njnt)),
        tendons=tuple(model.tendon(t).name for t in range(model.ntendon)),
        model=model,
        data=data,
        **found,
    )


# -- the other way round: what MuJoCo's derivatives say --------------------------------------------
def matrices(source, ballast):
    """`(6 + n, 6 + n)` M, K and D of the appendage on a free base, from `mjd_transitionFD` alone.

    The step is `v+ = v + h a(q, v+)`, `q+ = q + h v+` (implicitfast: stiffness explicit, damping
    implicit), so with `X = A_vv^-1`: `M^-1 = X B_v / h`, `M^-1 K = -X A_vq / h`, `M^-1 D = (X - 1)
    / h`. The ballast is taken off M.
    """
    model = mujoco.MjModel.from_xml_string(on_free_base(source, ballast))
    data = mujoco.MjData(model)
    n, h = model.nv, model.opt.timestep
    a = np.zeros((2 * n, 2 * n))
    b = np.zeros((2 * n, model.nu))
    mujoco.mjd_transitionFD(model, data, 1e-6, True, a, b, None, None)
    x = np.linalg.inv(a[n:, n:])
    mass = np.linalg.inv(x @ b[n:] / h)
    stiffness = mass @ (-x @ a[n:, :n] / h)
    damping = mass @ (x - np.eye(n)) / h
    mass[:6, :6] -= np.diag([ballast[0]] * 3 + list(ballast[1]))
    return tuple((m + m.T) / 2.0 for m in (mass, stiffness, damping))


@dataclass(frozen=True)
class Transition:
    """What `mjd_transitionFD` says, root held: rigid `(6, 6)`, frequencies,
    participation `(n, 6)`, ratios."""

    rigid: np.ndarray
    frequencies: np.ndarray
    participation: np.ndarray
    ratios: np.ndarray


def transition(source, ballast=None):
    """The reading through `mjd_transitionFD`; `ballast` (mass, inertia) sits on the base,
    the appendage's size."""
    if ballast is None:
        diagonal = np.diag(read(source).rigid)
        ballast = (diagonal[0], [np.max(diagonal[3:])] * 3)
    mass, stiffness, damping = matrices(source, ballast)
    m = mass[6:, 6:]
    k = stiffness[6:, 6:]
    d = damping[6:, 6:]
    root = np.linalg.cholesky(k)
    values, vectors = np.linalg.eigh(np.linalg.solve(root, np.linalg.solve(root, m).T))
    values, vectors = values[::-1], vectors[:, ::-1]
    shapes = np.linalg.solve(root.T, vectors) / np.sqrt(values)
    w = 1.0 / np.sqrt(values)
    participation = (mass[:6, 6:] @ shapes).T
    size = np.sqrt(np.abs(np.diag(mass[:6, :6])))
    participation *= np.array([first_sign(row / size, 1e-6) for row in participation])[:, None]
    return Transition(
        mass[:6, :6], w, participation, np.einsum("ik,ij,jk->k", shapes, d, shapes) / (2.0 * w)
    )


# -- comparing -------------------------------------------------------------------------------------
def mass_error(found, expected):
    """Largest difference of two mass matrices,
    each entry over the square root of its two diagonals."""
    size = np.sqrt(np.where(np.diag(expected) > 0.0, np.diag(expected), 1.0))
    return float(np.max(np.abs((found - expected) / np.outer(size, size))))


def mode_error(found, expected, rigid, near=1e-3):
    """Largest relative error of frequencies,
    and largest error of participation rows over the larger rows of a mode.

    Modes whose frequencies lie within `near` of each other are compared as a group: any orthogonal
    mixture of them is as good, so the best one is taken.

    Args:
        found, expected: (frequencies `(n,)`, participation `(n, m)`), by frequency.
        rigid: `(m, m)` expected rigid mass, which scales the motions.
        near: relative distance of frequencies that belong together.
    """
    (w, rows), (w0, rows0) = found, expected
    assert len(w) == len(w0), f"{len(w)} modes, {len(w0)} expected"
    size = np.sqrt(np.where(np.diag(rigid) > 0.0, np.diag(rigid), 1.0))
    rows, rows0 = rows / size, rows0 / size
    frequency = float(np.max(np.abs(w / w0 - 1.0)))
    worst, start = 0.0, 0
    for end in range(1, len(w0) + 1):
        if end < len(w0) and w0[end] / w0[end - 1] - 1.0 < near:
            continue
        a, b = rows[start:end], rows0[start:end]
        u, _, v = np.linalg.svd(b @ a.T)
        worst = max(worst, float(np.linalg.norm(u @ v @ a - b) / max(np.linalg.norm(b), 1e-300)))
        start = end
    return frequency, worst
