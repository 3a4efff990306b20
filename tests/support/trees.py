"""Trees of flexible bodies on a free bus: beams and frames, hinges, welds, branches; as finite
elements of the whole craft, and as MJCF with specifications.

Every flexible body has all modes of its mesh, the root held: of p-elements (`finite_elements`) for
beams, of `frames` for leaves. Between root and tip it is one element of 12 freedoms per frequency.
With h the modes' response to a force, L their participation, T the motion of the tip, R the rigid
mass and X the rigid motion of the tip,

    Z = [[s^2 (R - s^2 L^T h L) + F^T G^-1 F, -F^T G^-1], [-G^-1 F, G^-1]],
    F = X - s^2 T^T h L,   G = T^T h T,

so nothing of the structure is left out at any frequency. Nothing is imported from the package.
"""

from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np

import finite_elements as fe
from craft_truth import damped_poles
from frames import Body, FrameModes, Leg, frame_modes, write_modes
from solver import Craft, Frame, Modes, cross, moved, normal_modes, section_of

YOUNG, DENSITY, POISSON = 7e10, 2700.0, 0.33
LEAF_ELEMENTS = 6  # of every leg of a leaf
CONVERGED = 12  # modes of every port of a beam that its mesh has right to rounding; it has more
DELIVERED = 250.0  # times the band: the modes of a leaf that its file has; with 60 it lacks 2e-4
AT_LEAST = 12
STILL = 1e-4  # of the band: slower poles are rounding of rigid motions
NEAREST = 30.0  # times the band: undamped modes up to here make the damped poles


# -- what a tree consists of -----------------------------------------------------------------------
@dataclass(frozen=True)
class Part:
    """A flexible body, its x axis outwards.

    Attributes:
        name: of its specification; it stands at the site `place_<name>`.
        legs: `(start, end, width_y, width_z)` of rectangular members; one along x is a beam, whose
            tip is a port, others are a leaf of imported modes.
        on: the body that holds its site; or, with `direct`, the part on whose port it stands.
        at, turn: of the site on that body: place, and quaternion.
        lumps: `(place, mass)` at ends of legs.
        modes: text of `[modes]`; chosen for the scene where left out.
    """

    name: str
    legs: tuple
    on: str
    at: tuple = (0.0, 0.0, 0.0)
    turn: tuple = (1.0, 0.0, 0.0, 0.0)
    direct: bool = False
    lumps: tuple = ()
    modes: str = ""

    @property
    def is_beam(self):
        return len(self.legs) == 1

    @property
    def length(self):
        return self.legs[0][1][0]

    @property
    def weight(self):
        beams = sum(DENSITY * np.linalg.norm(np.subtract(b, a)) * y * z for a, b, y, z in self.legs)
        return float(beams + sum(mass for _, mass in self.lumps))


@dataclass(frozen=True)
class Carried:
    """A rigid body on the port of a beam, its centre there.

    Attributes:
        on: name of the beam.
        axis: of its hinge, in its own axes; None: welded.
        turn: quaternion of its axes at rest against the beam's.
    """

    name: str
    on: str
    mass: float
    inertia: tuple
    axis: tuple | None = None
    stiffness: float = 0.0
    damping: float = 0.0
    turn: tuple = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Tree:
    """Parts and carried bodies on the body `bus`, carriers before what they carry."""

    parts: tuple
    bodies: tuple
    bus: float
    bus_inertia: tuple
    ratio: float = 0.005  # of every mode of every part, its root held
    keys: dict = field(default_factory=dict)  # angles by body, by name of the keyframe

    @property
    def hinges(self):
        """Names of the bodies with a hinge, as the document has them."""
        return [body.name for body in self._in_order("bus") if body.axis is not None]

    def _in_order(self, holder):
        for body in self.bodies:
            if body.on in self._parts_of(holder):
                yield body
                yield from self._in_order(body.name)

    def _parts_of(self, holder):
        """Names of the parts whose loads are written into a body: on it, and on their ports."""
        names = [part.name for part in self.parts if not part.direct and part.on == holder]
        for part in self.parts:  # carriers come first
            if part.direct and part.on in names:
                names.append(part.name)
        return names

    def part(self, name):
        return next(part for part in self.parts if part.name == name)


# -- the files -------------------------------------------------------------------------------------
def mjcf(tree, timestep=0.001, integrator="Euler"):
    """The craft with its flexible bodies left out: every body where it is at rest."""
    keys = ""
    for name, angles in tree.keys.items():
        turned = _words([angles.get(hinge, 0.0) for hinge in tree.hinges])
        keys += f'<key name="{name}" qpos="0 0 0 1 0 0 0 {turned}"/>'
    return f"""<mujoco model="tree">
<option timestep="{timestep!r}" gravity="0 0 0" integrator="{integrator}"/>
<worldbody><body name="bus"><freejoint name="bus"/>
<inertial pos="0 0 0" mass="{tree.bus!r}" diaginertia="{_words(tree.bus_inertia)}"/>
{_inside(tree, "bus")}</body></worldbody>
<keyframe>{keys}</keyframe>
</mujoco>"""


def _inside(tree, holder):
    """Sites and bodies inside a body."""
    out = ""
    ends = {}
    for name in tree._parts_of(holder):
        part = tree.part(name)
        if part.direct:
            place, turn = ends[part.on]
        else:
            place, turn = np.array(part.at), np.array(part.turn)
            out += f'<site name="place_{name}" pos="{_words(place)}" quat="{_words(turn)}"/>\n'
        ends[name] = place + _matrix(turn) @ [part.length, 0.0, 0.0], turn
    for body in tree.bodies:
        if body.on not in ends:
            continue
        place, turn = ends[body.on]
        turn = _product(turn, body.turn)
        joint = ""
        if body.axis is not None:
            joint = (
                f'<joint name="hinge_{body.name}" type="hinge" axis="{_words(body.axis)}" '
                f'stiffness="{body.stiffness!r}" damping="{body.damping!r}"/>'
            )
        out += f"""<body name="{body.name}" pos="{_words(place)}" quat="{_words(turn)}">{joint}
<inertial pos="0 0 0" mass="{body.mass!r}" diaginertia="{_words(body.inertia)}"/>
{_inside(tree, body.name)}</body>\n"""
    return out


def written(folder, tree, band, tolerance, **craft):
    """The files of a tree: its craft, and the specification at each place."""
    (folder / "tree.xml").write_text(mjcf(tree, **craft))
    at = {}
    for part in tree.parts:
        path = folder / f"{part.name}.toml"
        path.write_text(_specification(folder, tree, part, band, tolerance))
        at[place_of(tree, part)] = path
    return folder / "tree.xml", at


def place_of(tree, part):
    return f"{place_of(tree, tree.part(part.on))}:end" if part.direct else f"place_{part.name}"


def _specification(folder, tree, part, band, tolerance):
    scene = f"[scene]\nbandwidth = {band!r}\ntolerance = {tolerance!r}\n"
    if not part.is_beam:
        found = modes_of(part)
        count = max(int(np.sum(found.frequencies < DELIVERED * band)), AT_LEAST)
        few = _modes_of_leaf(part, count)
        write_modes(folder / f"{part.name}_modes.toml", few, damping=tree.ratio)
        return f'name = "{part.name}"\n[imported]\nfile = "{part.name}_modes.toml"\n{scene}'
    _, end, width_y, width_z = part.legs[0]
    names = [body.name for body in tree.bodies if body.on == part.name]
    is_port = names or any(other.direct and other.on == part.name for other in tree.parts)
    carries = ", ".join(f'"{name}"' for name in names)
    port = f'[[port]]\nname = "end"\nx = {end[0]!r}\ncarries = [{carries}]\n' if is_port else ""
    return f"""name = "{part.name}"
[[segment]]
length = {end[0]!r}
section = {{ shape = "rectangle", width_y = {width_y!r}, width_z = {width_z!r} }}
material = {{ youngs_modulus = {YOUNG!r}, density = {DENSITY!r}, poissons_ratio = {POISSON!r} }}
{port}[damping]
ratio = {tree.ratio!r}
{scene}{part.modes}"""


def _words(values):
    return " ".join(repr(float(v)) for v in values)


# -- the finite elements ---------------------------------------------------------------------------
@lru_cache(maxsize=16)
def modes_of(part):
    """All modes of the mesh of a part, the root held."""
    if not part.is_beam:
        return _modes_of_leaf(part, 10**6)
    found = fe.every_mode({"segment": [_segment(part.legs[0])]}, CONVERGED)
    return FrameModes(
        found.frequencies,
        found.participation,
        found.tip,
        found.rigid,
        part.length,
        np.zeros((6, 6)),
    )


def _segment(leg):
    _, end, width_y, width_z = leg
    return {
        "length": end[0],
        "section": {"shape": "rectangle", "width_y": width_y, "width_z": width_z},
        "material": {"youngs_modulus": YOUNG, "density": DENSITY, "poissons_ratio": POISSON},
    }


def _modes_of_leaf(part, count):
    legs = [Leg(*leg[:2], LEAF_ELEMENTS, section_of(_segment(leg))) for leg in part.legs]
    return frame_modes(legs, [Body(place, mass) for place, mass in part.lumps], modes=count)


def _assembled(tree, angles, put):
    """A tree at a pose as a `Craft`; `put(craft, part, root)` puts a part on the frame of its root
    and has the frame of its tip."""
    craft = Craft()
    craft.body(craft.base, tree.bus, inertia=tree.bus_inertia)
    bodies, tips = {"bus": craft.base}, {}
    left = [*tree.parts, *tree.bodies]
    while left:
        one = left.pop(0)
        is_part = isinstance(one, Part)
        holders = bodies if is_part and not one.direct else tips
        if one.on not in holders:
            left.append(one)
            continue
        frame = holders[one.on]
        if is_part:
            root = frame if one.direct else frame.at(one.at, _matrix(one.turn))
            tips[one.name] = put(craft, one, root)
            continue
        frame = frame.at((0.0, 0.0, 0.0), _matrix(one.turn))
        if one.axis is not None:
            angle = (angles or {}).get(one.name, 0.0)
            frame = craft.hinge(frame, one.axis, angle, one.stiffness, one.damping)
        craft.body(frame, one.mass, inertia=one.inertia)
        bodies[one.name] = frame
    return craft


@dataclass(frozen=True, eq=False)
class Whole:
    """A tree at a pose in finite elements, up to a band [rad/s]; the bus's six motions are looked
    at."""

    tree: Tree
    angles: dict
    band: float

    @cached_property
    def mass(self):
        """`(6, 6)` with all else locked."""

        def put(craft, part, root):
            craft.add("mass", root.own, modes_of(part).rigid)
            return root.at((part.length, 0.0, 0.0))

        return _assembled(self.tree, self.angles, put).matrices()[0][:6, :6]

    def accelerance(self, omega):
        """`(k, 6, 6)` acceleration of the bus per wrench on it."""
        ends = []  # rows of both ends of carriers, of the root alone of others

        def put(craft, part, root):
            tip = root.at((part.length, 0.0, 0.0))
            if _carries(self.tree, part):
                tip = Frame(np.eye(craft.size + 6)[craft.coordinates(6)], tip.place, tip.turn)
            ends.append((part, root, tip))
            return tip

        craft = _assembled(self.tree, self.angles, put)
        mass, damping, stiffness = craft.matrices()
        s = 1j * omega[:, None, None]
        dynamic = s**2 * mass + s * damping + stiffness
        for part, root, tip in ends:
            carries = _carries(self.tree, part)
            rows = np.vstack([craft.wide(end.own) for end in ((root, tip) if carries else (root,))])
            dynamic = dynamic + rows.T @ _element_at(part, omega, self.tree.ratio, carries) @ rows
        right = np.broadcast_to(np.eye(dynamic.shape[1], 6), (omega.size, dynamic.shape[1], 6))
        return s**2 * np.linalg.solve(dynamic, right)[:, :6]

    def poles(self, first):
        """Damped poles: of the free craft, and with 6 those with the bus held; none of rigid
        motions."""
        poles = damped_poles(*(matrix[first:, first:] for matrix in self._slow))
        return poles[np.abs(poles) > STILL * self.band]

    def frequencies(self, count):
        """The lowest undamped frequencies above zero [rad/s]."""
        mass, _, stiffness = self._slow
        w, _ = normal_modes(mass, stiffness, self.band**2)
        return w[w > 1e-3 * self.band][:count]

    @cached_property
    def _modal(self):
        """Mass, damping and stiffness over the bus's motions, the hinges and all modes of all
        parts."""

        def put(craft, part, root):
            own = modes_of(part)
            modes = own.frequencies, self.tree.ratio, own.participation, own.rigid, own.tip
            return craft.modes(root, Modes(*modes, part.length))[0]

        return _assembled(self.tree, self.angles, put).matrices()

    @cached_property
    def _slow(self):
        """The same in the undamped modes up to `NEAREST` times the band, the bus's motions
        first."""
        mass, damping, stiffness = self._modal
        w, shapes = normal_modes(mass[6:, 6:], stiffness[6:, 6:], self.band**2)
        shapes = shapes[:, w < NEAREST * self.band]
        basis = np.zeros((len(mass), 6 + shapes.shape[1]))
        basis[:6, :6] = np.eye(6)
        basis[6:, 6:] = shapes / np.linalg.norm(shapes, axis=0)
        return tuple(basis.T @ matrix @ basis for matrix in (mass, damping, stiffness))


def _carries(tree, part):
    return any(body.on == part.name for body in tree.bodies) or any(
        other.direct and other.on == part.name for other in tree.parts
    )


def _element_at(part, omega, ratio, with_tip):
    """Dynamic stiffness `(k, 12, 12)` between root and tip, or `(k, 6, 6)` at the root."""
    modes = modes_of(part)
    w, to_root, to_tip = modes.frequencies, modes.participation, modes.tip
    s = 1j * omega[:, None]
    given = 1.0 / (s**2 + 2.0 * ratio * w * s + w**2)
    s = s[:, :, None]

    def summed(a, b):
        products = a[:, :, None] * b[:, None, :]
        return (given @ products.reshape(w.size, -1)).reshape(-1, a.shape[1], b.shape[1])

    root = s**2 * (modes.rigid - s**2 * summed(to_root, to_root))
    if not with_tip:
        return root
    flexibility = summed(to_tip, to_tip)
    follow = moved(np.eye(6), (part.length, 0.0, 0.0)) - s**2 * summed(to_tip, to_root)
    stiff = np.linalg.inv(flexibility)
    across = -stiff @ follow
    return np.block(
        [
            [root - np.swapaxes(follow, 1, 2) @ across, np.swapaxes(across, 1, 2)],
            [across, stiff],
        ]
    )


def _matrix(quaternion):
    w, vector = quaternion[0], np.asarray(quaternion[1:], dtype=float)
    k = cross(vector)
    return np.eye(3) + 2.0 * w * k + 2.0 * k @ k


def _product(first, second):
    a, u = first[0], np.asarray(first[1:], dtype=float)
    b, v = second[0], np.asarray(second[1:], dtype=float)
    return np.array([a * b - u @ v, *(a * v + b * u + np.cross(u, v))])


# -- trees at random -------------------------------------------------------------------------------
def random_tree(seed):
    """Two to five flexible bodies: beams and up to two leaves, behind hinges that are free or
    sprung, welded, right on a port, several on one body; at rest and at one or two keyframes."""
    rng = np.random.default_rng(seed)
    parts, bodies = [_random_beam(rng, "part0", "bus")], []
    for k in range(1, int(rng.integers(2, 6))):
        name = f"part{k}"
        beams = [part for part in parts if part.is_beam]
        bare = [part for part in beams if not any(p.direct and p.on == part.name for p in parts)]
        way = rng.choice(["hinge", "branch", "bus", "direct"], p=[0.55, 0.15, 0.1, 0.2])
        if way == "direct" and bare:
            on, direct = bare[int(rng.integers(len(bare)))].name, True
        elif way == "bus":
            on, direct = "bus", False
        elif way == "branch" and bodies:
            on, direct = bodies[int(rng.integers(len(bodies)))].name, False
        else:
            # the last beam twice as often: deep trees
            on, direct = f"body{k}", False
            carrier = [*beams, beams[-1]][int(rng.integers(len(beams) + 1))]
            bodies.append(_random_body(rng, on, carrier.name))
        is_leaf = rng.random() < 0.3 and sum(not part.is_beam for part in parts) < 2
        made = _random_leaf if is_leaf else _random_beam
        parts.append(made(rng, name, on, direct))
    weight = sum(part.weight for part in parts)
    tree = Tree(tuple(parts), tuple(bodies), 1.0, (1.0, 1.0, 1.0))
    last = [part for part in parts if part.is_beam][-1]
    hand = weight * float(10.0 ** rng.uniform(-2.0, 1.0))
    if rng.random() < 0.7:
        inertia = tuple(hand * rng.uniform(0.05, 0.08, 3))
        bodies.append(Carried("hand", last.name, hand, inertia, turn=_random_turn(rng)))
    bus = weight * float(10.0 ** rng.uniform(-0.5, 1.5))
    poses = ["turned", "back"][: int(rng.integers(1, 3))] if tree.hinges else []
    return Tree(
        tuple(parts),
        tuple(bodies),
        bus,
        tuple(bus * rng.uniform(0.3, 0.5, 3)),
        ratio=float(rng.uniform(0.003, 0.02)),
        keys={
            pose: {name: float(rng.uniform(-2.0, 2.0)) for name in tree.hinges} for pose in poses
        },
    )


def random_scene(seed, tree):
    """Band [rad/s] and tolerance for a tree."""
    rng = np.random.default_rng([seed, 1])
    first = Whole(tree, {}, 1.0).frequencies(1)[0]
    return float(first * rng.uniform(1.0, 4.0)), float(10.0 ** rng.uniform(-2.5, -1.0))


def _random_beam(rng, name, on, direct=False):
    length = float(rng.uniform(2.0, 8.0))
    width = (length * rng.uniform(0.006, 0.02, 2)).tolist()
    modes = f"[modes]\nxy = {rng.integers(1, 4)}\nxz = {rng.integers(1, 4)}\ntorsion = 1\n"
    if rng.random() < 0.3:
        modes = ""
    leg = (0.0, 0.0, 0.0), (length, 0.0, 0.0), *width
    return Part(name, (leg,), on, *_random_mount(rng, direct), direct, modes=modes)


def _random_leaf(rng, name, on, direct=False):
    """A T, an L or a skew frame: bending and torsion are coupled."""
    reach, side = rng.uniform(1.0, 3.0), rng.uniform(0.3, 1.5)
    corner = (float(reach), 0.0, 0.0)
    ends = [(float(reach), float(side), 0.0), (float(reach), -float(side), 0.0)]
    ends = {"T": ends, "L": ends[:1], "skew": [tuple(corner + side * rng.standard_normal(3))]}[
        str(rng.choice(["T", "L", "skew"]))
    ]
    width = (reach * rng.uniform(0.006, 0.02, 2)).tolist()
    legs = [((0.0, 0.0, 0.0), corner, *width)]
    legs += [(corner, tuple(map(float, end)), *width) for end in ends]
    lumps = tuple((legs[-1][1], float(rng.uniform(0.1, 2.0))) for _ in range(rng.integers(0, 2)))
    return Part(name, tuple(legs), on, *_random_mount(rng, direct), direct, lumps)


def _random_body(rng, name, on):
    axis = rng.standard_normal(3)
    kind = rng.choice(["free", "sprung", "welded"], p=[0.4, 0.4, 0.2])
    mass = float(rng.uniform(0.5, 10.0))
    return Carried(
        name,
        on,
        mass,
        tuple(mass * rng.uniform(0.02, 0.03, 3)),
        axis=None if kind == "welded" else tuple(axis / np.linalg.norm(axis)),
        stiffness=float(10.0 ** rng.uniform(2.0, 4.0)) if kind == "sprung" else 0.0,
        damping=float(rng.uniform(0.5, 5.0)) if kind == "sprung" else 0.0,
        turn=_random_turn(rng),
    )


def _random_mount(rng, direct):
    if direct:
        return (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    return tuple(rng.uniform(-0.5, 0.5, 3).tolist()), _random_turn(rng)


def _random_turn(rng):
    turn = rng.standard_normal(4)
    return tuple((turn / np.linalg.norm(turn)).tolist())
