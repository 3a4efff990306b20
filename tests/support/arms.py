"""Arms of straight beams on a free bus in three-dimensional finite elements, and the MJCF of the
same arm with its rigid bodies where they are at rest.

Every link is a row of elements of `frames`; a hinge between two of them is an angle of its own. The
structure is reduced to its modes with the bus held up to sixty times the band, and what is left of
its static response. Nothing is imported from the package.
"""

from dataclasses import dataclass, field

import mujoco
import numpy as np
from scipy.linalg import eigh

from craft_truth import Side
from finite_elements import _rectangle_torsion
from frames import Leg, _cross, _element

YOUNG, DENSITY, POISSON = 7e10, 2700.0, 0.33
ELEMENTS = 30  # of every link, unless the arm says another number
REACH = 60.0  # times the band: modes with the bus held that are kept one by one


@dataclass(frozen=True)
class Link:
    """A rectangular beam along its own x, with a rigid body at its root and a hinge in front.

    Attributes:
        name: of its specification; the body at its root is `joint_<name>`.
        length, width_y, width_z: [m].
        mass, inertia: of the body at its root, which turns with the hinge.
        axis: of the hinge in the arm's rest pose; None: no hinge, the body is welded.
        stiffness, damping: of the hinge.
        kp, kv: of a position servo on the hinge, where `servo` names how it is written: "position"
            or "general".
    """

    name: str
    length: float
    width_y: float
    width_z: float
    mass: float = 0.0
    inertia: tuple = (0.0, 0.0, 0.0)
    axis: tuple | None = None
    stiffness: float = 0.0
    damping: float = 0.0
    kp: float = 0.0
    kv: float = 0.0
    servo: str = ""

    def stiffness_and_mass(self):
        """Of its section, as a `Leg` takes them."""
        area = self.width_y * self.width_z
        about_z = self.width_z * self.width_y**3 / 12.0
        about_y = self.width_y * self.width_z**3 / 12.0
        shear = YOUNG / (2.0 * (1.0 + POISSON))
        return {
            "axial": YOUNG * area,
            "torsion": shear * _rectangle_torsion(self.width_y, self.width_z),
            "bending_y": YOUNG * about_y,
            "bending_z": YOUNG * about_z,
            "mass": DENSITY * area,
            "polar": DENSITY * (about_y + about_z),
        }


@dataclass(frozen=True)
class Arm:
    """Links one behind the other on a bus, a body at the end of the last."""

    links: tuple
    bus: float = 400.0
    bus_inertia: tuple = (80.0, 100.0, 120.0)
    at: tuple = (0.5, 0.0, 0.0)
    hand: float = 10.0
    hand_inertia: tuple = (0.4, 0.4, 0.4)
    hand_at: tuple = (0.0, 0.0, 0.0)
    gravity: tuple = (0.0, 0.0, 0.0)
    ratio: float = 0.005
    elements: int = ELEMENTS
    keys: dict = field(default_factory=dict)


def toml(arm, link, band, tolerance, modes=""):
    """The specification of a link, with a port at its end that carries the next body."""
    number = arm.links.index(link)
    following = arm.links[number + 1].name if number + 1 < len(arm.links) else None
    body = "hand" if following is None else f"joint_{following}"
    return f"""name = "{link.name}"
[[segment]]
length = {link.length!r}
section = {{ shape = "rectangle", width_y = {link.width_y!r}, width_z = {link.width_z!r} }}
material = {{ youngs_modulus = {YOUNG!r}, density = {DENSITY!r}, poissons_ratio = {POISSON!r} }}
[[port]]
name = "end"
x = {link.length!r}
carries = ["{body}"]
[damping]
ratio = {arm.ratio!r}
[scene]
bandwidth = {band!r}
tolerance = {tolerance!r}
{modes}"""


def mjcf(
    arm,
    timestep=0.0005,
    integrator="implicitfast",
    base='<freejoint name="bus"/>',
    quaternion="1 0 0 0",
    ctrl="",
    actuators="",
):
    """The craft with rigid links left out: every body where it is at rest.

    `base`: joints of the bus; `quaternion`: how the arm is turned on it; `ctrl`: of a keyframe
    `burn`, which `actuators` push at.
    """
    hand = f'mass="{arm.hand!r}" diaginertia="{_words(arm.hand_inertia)}"'
    body = f"""<body name="hand" pos="{arm.links[-1].length!r} 0 0">
  <inertial pos="{_words(arm.hand_at)}" {hand}/>
</body>"""
    for number, link in reversed(list(enumerate(arm.links))):
        site = f'<site name="place_{link.name}"/>'
        if number == 0:
            turned = f'quat="{quaternion}"'
            site = f'<site name="place_{link.name}" pos="{_words(arm.at)}" {turned}/>'
            out = np.zeros(3)
            mujoco.mju_rotVecQuat(out, [link.length, 0.0, 0.0], np.fromstring(quaternion, sep=" "))
            place = f'pos="{_words(arm.at + out)}" {turned}'
            body = site + body.replace(f'pos="{link.length!r} 0 0"', place, 1)
            continue
        joint = ""
        if link.axis is not None:
            joint = (
                f'<joint name="hinge_{link.name}" type="hinge" axis="{_words(link.axis)}" '
                f'stiffness="{link.stiffness!r}" damping="{link.damping!r}"/>'
            )
        before = arm.links[number - 1].length
        inertial = f'mass="{link.mass!r}" diaginertia="{_words(link.inertia)}"'
        body = f"""<body name="joint_{link.name}" pos="{before!r} 0 0">{joint}
<inertial pos="0 0 0" {inertial}/>{site}{body}</body>"""
    hinges = [link for link in arm.links if link.axis is not None]
    keys = ""
    still = "0 0 0 1 0 0 0" if "freejoint" in base else "0 " * base.count("<joint")
    for name, angles in arm.keys.items():
        turned = _words([angles.get(hinge.name, 0.0) for hinge in hinges])
        push = f'ctrl="{ctrl}"' if ctrl else ""
        keys += f'<key name="{name}" qpos="{still} {turned}" {push}/>'
    return f"""<mujoco model="arm">
<option timestep="{timestep!r}" gravity="{_words(arm.gravity)}" integrator="{integrator}"/>
<worldbody><body name="bus">{base}
<inertial pos="0 0 0" mass="{arm.bus!r}" diaginertia="{_words(arm.bus_inertia)}"/>
<site name="thruster" pos="{_words(arm.at)}"/>
{body}
</body></worldbody>
<actuator>{actuators}{"".join(_servo(link) for link in arm.links if link.servo)}</actuator>
<keyframe>{keys}</keyframe>
</mujoco>"""


def _servo(link):
    """A position servo on a hinge, `force = kp (ctrl - angle) - kv rate`."""
    hinge = f'joint="hinge_{link.name}"'
    if link.servo == "position":
        return f'<position {hinge} kp="{link.kp!r}" kv="{link.kv!r}"/>'
    return (
        f'<general {hinge} gainprm="{link.kp!r}" biastype="affine" '
        f'biasprm="0 {-link.kp!r} {-link.kv!r}"/>'
    )


def _words(values):
    return " ".join(repr(float(v)) for v in values)


def side(arm, band, angles=None):
    """The arm at a pose as a `Side`, the bus's six motions first."""
    return _reduced(*_matrices(arm, angles), REACH * band)


def _matrices(arm, angles):
    """Mass, damping and stiffness of the whole arm, what moves with the bus where all is locked,
    and the number of hinges."""
    angles = angles or {}
    hinges = [link.name for link in arm.links if link.axis is not None]
    size = 6 + len(hinges) + 6 * arm.elements * len(arm.links)
    mass, stiffness, damping = (np.zeros((size, size)) for _ in range(3))
    rigid = np.vstack([np.eye(6), np.zeros((size - 6, 6))])  # all locked: the bus moves every node
    _add_body(mass, np.eye(6, size), arm.bus, np.diag(arm.bus_inertia))
    place = np.array(arm.at, dtype=float)
    turn = np.eye(3)
    root = _moved(np.eye(6, size), place)
    start = 6 + len(hinges)
    for link in arm.links:
        if link.axis is not None:
            own = 6 + hinges.index(link.name)
            root = root.copy()
            axis = turn @ np.array(link.axis, dtype=float)
            root[3:, own] += axis
            stiffness[own, own] += link.stiffness + link.kp
            damping[own, own] += link.damping + link.kv
            turn = _rotation(axis, angles.get(link.name, 0.0)) @ turn
        _add_body(mass, root, link.mass, turn @ np.diag(link.inertia) @ turn.T)
        ends = [root]
        for k in range(arm.elements):
            rows = np.zeros((6, size))
            here = slice(start + 6 * k, start + 6 * k + 6)
            rows[:, here] = np.eye(6)
            ends.append(rows)
            node = place + link.length * (k + 1) / arm.elements * turn[:, 0]
            rigid[here] = _moved(np.eye(6), node)
        start += 6 * arm.elements
        m, k, d = _beam(arm, link, place, turn)
        to_nodes = np.vstack(ends)
        mass += to_nodes.T @ m @ to_nodes
        stiffness += to_nodes.T @ k @ to_nodes
        damping += to_nodes.T @ d @ to_nodes
        place = place + link.length * turn[:, 0]
        root = ends[-1]
    _add_body(mass, root, arm.hand, turn @ np.diag(arm.hand_inertia) @ turn.T)
    return mass, damping, stiffness, rigid, len(hinges)


def _rotation(axis, angle):
    cross = _cross(axis)
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def _moved(rows, arm):
    """Motion of a point at `arm` of the body that moves by `rows`."""
    out = rows.copy()
    out[:3] -= _cross(arm) @ rows[3:]
    return out


def _add_body(mass, rows, weight, inertia):
    mass += weight * rows[:3].T @ rows[:3] + rows[3:].T @ inertia @ rows[3:]


def _beam(arm, link, place, turn):
    """Mass, stiffness and damping of a link over the motions of its nodes, root first.

    The ratio is that of every mode with the root held, nothing at the end.
    """
    end = place + link.length * turn[:, 0]
    leg = Leg(tuple(place), tuple(end), arm.elements, **link.stiffness_and_mass())
    size = 6 * (arm.elements + 1)
    mass, stiffness = np.zeros((size, size)), np.zeros((size, size))
    nodes = [place + link.length * k / arm.elements * turn[:, 0] for k in range(arm.elements + 1)]
    # an element along x, in the link's own axes: those of `frames` would not turn about it
    along = np.array([link.length / arm.elements, 0.0, 0.0])
    rows, _, strain = _element(np.zeros(3), along, leg)
    to_own = np.kron(np.eye(4), turn.T)
    for k in range(arm.elements):
        both = slice(6 * k, 6 * k + 12)
        mass[both, both] += to_own.T @ (rows.T @ rows) @ to_own
        stiffness[both, both] += to_own.T @ (strain.T @ strain) @ to_own
    values, shapes = eigh(stiffness[6:, 6:], mass[6:, 6:])
    rigid = np.vstack([_moved(np.eye(6), node - place) for node in nodes])
    relative = np.eye(size)
    relative[:, :6] -= rigid
    to_modes = shapes.T @ mass[6:, 6:] @ relative[6:]
    spread = 2.0 * arm.ratio * np.sqrt(values)
    return mass, stiffness, to_modes.T @ (spread[:, None] * to_modes)


def _reduced(mass, damping, stiffness, rigid, hinges, top):
    """Over the bus's motions, all else locked, the modes with the bus held up to `top` [rad/s], and
    what is left of the static response to accelerations of the bus."""
    # of the inverse, so that slow modes keep their digits; free hinges need the shift
    shift = (top / REACH) ** 2
    inverse, shapes = eigh(mass[6:, 6:], stiffness[6:, 6:] + shift * mass[6:, 6:])
    positive = inverse > 1e-12 * inverse[-1]
    inverse, shapes = inverse[positive], shapes[:, positive]
    shapes = shapes / np.sqrt(inverse)
    values = 1.0 / inverse - shift
    values = np.where(values < 1e-6 * shift, 0.0, values)  # free hinges
    low = values < top**2
    participation = shapes.T @ (mass @ rigid)[6:]
    forces = np.hstack([participation, shapes[:hinges].T])  # of the bus, and in hinges
    rest = np.linalg.qr(forces[~low] / values[~low, None])[0]
    kept = np.hstack([shapes[:, low], shapes[:, ~low] @ rest])
    basis = np.hstack([rigid, np.vstack([np.zeros((6, kept.shape[1])), kept])])
    m = basis.T @ mass @ basis
    c = basis.T @ damping @ basis
    k = np.zeros_like(m)
    n = 6 + int(np.sum(low))
    k[6:n, 6:n] = np.diag(values[low])
    k[n:, n:] = rest.T @ (values[~low, None] * rest)
    still = np.concatenate([np.arange(6), 6 + np.flatnonzero(values[low] == 0.0)])
    c[still] = c[:, still] = 0.0  # exactly: rounding would count near zero frequency
    return Side(m, c, k, len(m))


def frequencies(side, count):
    """The lowest frequencies above zero [rad/s]."""
    values = eigh(side.stiffness, side.mass, eigvals_only=True)
    return np.sqrt(values[values > 0.01])[:count]


def modes(arm, top, angles=None):
    """Modes of the undamped arm at a pose up to `top` [rad/s]: frequencies `(n,)`, exactly zero
    where nothing is deformed, and shapes `(dofs, n)` of unit modal mass. Rows of the shapes: the
    bus's six motions, the hinges, then the nodes of each link behind its root, six motions each."""
    mass, _, stiffness, _, _ = _matrices(arm, angles)
    # of the inverse, so that slow modes keep their digits; motions without strain need the shift
    shift = (top / REACH) ** 2
    inverse, shapes = eigh(mass, stiffness + shift * mass)
    values = 1.0 / inverse - shift
    low = (inverse > 0.0) & (values < top**2)
    inverse, values, shapes = inverse[low], values[low], shapes[:, low]
    values = np.where(values < 1e-6 * shift, 0.0, values)
    order = np.argsort(values)
    return np.sqrt(values[order]), (shapes / np.sqrt(inverse))[:, order]
