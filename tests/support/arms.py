"""Arms of straight beams on a free bus in three-dimensional finite elements, and the MJCF of the
same arm with its rigid bodies where they are at rest.

Every link is a beam of `solver`; a hinge between two of them is an angle of its own. The structure
is reduced to its modes with the bus held up to sixty times the band, and what is left of its static
response. Nothing is imported from the package.
"""

from dataclasses import dataclass, field

import mujoco
import numpy as np

from craft_truth import Side
from solver import Craft, normal_modes, section_of

YOUNG, DENSITY, POISSON = 7e10, 2700.0, 0.33
MATERIAL = {"youngs_modulus": YOUNG, "density": DENSITY, "poissons_ratio": POISSON}
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

    @property
    def section(self):
        """Its stiffness and inertia per length."""
        shape = {"shape": "rectangle", "width_y": self.width_y, "width_z": self.width_z}
        return section_of({"section": shape, "material": MATERIAL})


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
    return reduced(assembled(arm, angles)[0], REACH * band)


def assembled(arm, angles=None):
    """The whole arm as a `Craft`, and the frame of its hand."""
    craft = Craft()
    craft.body(craft.base, arm.bus, inertia=arm.bus_inertia)
    frame = craft.base.at(arm.at)
    for link in arm.links:
        if link.axis is not None:
            frame = craft.hinge(
                frame,
                link.axis,
                (angles or {}).get(link.name, 0.0),
                link.stiffness + link.kp,
                link.damping + link.kv,
            )
        craft.body(frame, link.mass, inertia=link.inertia)
        frame = craft.beam(frame, link.length, arm.elements, link.section, arm.ratio)[-1]
    craft.body(frame, arm.hand, inertia=arm.hand_inertia)
    return craft, frame


def reduced(craft, top):
    """Over the bus's motions, all else locked, the modes with the bus held up to `top` [rad/s], and
    what is left of the static response to accelerations of the bus."""
    mass, damping, stiffness = craft.matrices()
    w, shapes = normal_modes(mass[6:, 6:], stiffness[6:, 6:], (top / REACH) ** 2)
    values, low = w**2, w < top
    participation = shapes.T @ (mass @ craft.locked)[6:]
    of_hinges = shapes[np.array(craft.hinges, dtype=int) - 6].T
    forces = np.hstack([participation, of_hinges])
    rest = np.linalg.qr(forces[~low] / values[~low, None])[0]
    kept = np.hstack([shapes[:, low], shapes[:, ~low] @ rest])
    basis = np.hstack([craft.locked, np.vstack([np.zeros((6, kept.shape[1])), kept])])
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
    w, _ = normal_modes(side.mass, side.stiffness, 1.0)
    return w[w > 0.1][:count]


def modes(arm, top, angles=None):
    """Modes of the undamped arm at a pose up to `top` [rad/s]: frequencies `(n,)`, exactly zero
    where nothing is deformed, and shapes `(dofs, n)` of unit modal mass, whose rows begin with the
    bus's six motions."""
    mass, _, stiffness = assembled(arm, angles)[0].matrices()
    w, shapes = normal_modes(mass, stiffness, (top / REACH) ** 2)
    return w[w < top], shapes[:, w < top]
