"""From targets to one chain: springs on the hinges where the recursion serves all ports,
else one tendon per mode.

Theory: docs/theory.md, sections 3 and 4.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal

import numpy as np

from beamchain.chain.chain import Chain, Hinge, Link, sprung
from beamchain.chain.cut import MOST_ADDED, Cut, choose_cut
from beamchain.chain.links import (
    NO_POLAR,
    TINY,
    bodies,
    polar_inertias,
    real_polar,
    settle_links,
    with_polar,
)
from beamchain.chain.recursion import Nodes, planar_links, realise, realise_scalar
from beamchain.chain.residual_margin import SAME_PLACE, HingeDemand, shortest_link
from beamchain.chain.tendons import ModeGroup, given_modes, group_motion, springs_as_modes
from beamchain.errors import InputError, RealisationError
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array
from beamchain.structure.mass_line import NO_MASS, MassLine, Moments, spread_mass
from beamchain.structure.settle_modes import PRINTED

Springs = Literal["auto", "hinges", "modes"]

PLANES = ("xy", "xz")
A_POINT = 1e-13  # of the transverse inertia about the root: a link with less is a point
LOST_DIGITS = 1e-8  # a chain whose own frequencies miss the target by more is not handed out
RANK = 1e-9  # relative singular value of participation that is none
NOTHING = 1e-9  # of the rigid mass: less residual mass takes a hinge at the root
FILLER_RATIO = 0.05  # damping ratio of a filler mode where the others are damped
SAME = 1e-9  # relative: hinges and masses of two planes closer than this are the same

#: Target with the given number of modes of a port.
TargetOf = Callable[[str, int], PortModel]


@dataclass(frozen=True, eq=False)
class Built:
    """A chain, and how it came about.

    Args:
        chain: links, hinges and tendons.
        targets: per port, the model that the chain has.
        how: what holds its modes, such as "springs on the hinges".
        missing: per port with fewer modes than asked for, how many it keeps, and why.
        history: what was tried before, and why it failed.
        cut: where it is cut; None: at the hinges of the recursion.
    """

    chain: Chain
    targets: dict[str, PortModel]
    how: str
    missing: tuple[str, ...] = ()
    history: tuple[str, ...] = ()
    cut: Cut | None = None


@dataclass(frozen=True)
class BuildOptions:
    """What is asked of the realisation beside the modes.

    `springs` "auto": on the hinges where the recursion serves all ports; `lines`: x where hinges
    must stand [m]; `further`: x of further ports [m]; `left_out`: per port the modes that are left
    out, for which fillers stand; `band`: highest frequency at which the response counts, and of the
    modes kept on the hub [rad/s]; `neutral`: the modes are exact on one hub, which fillers must not
    disturb.
    """

    springs: Springs = "auto"
    per_mode: bool = False
    lines: tuple[float, ...] = ()
    further: tuple[float, ...] = ()
    cut: Cut | None = None
    left_out: Mapping[str, ModeGroup] = field(default_factory=dict[str, ModeGroup])
    band: float = 0.0
    neutral: bool = False


def build_exact(
    beam: MassLine, kept: Mapping[str, int], target_of: TargetOf, wishes: BuildOptions | None = None
) -> Built:
    """The exact chain of all kept ports: the recursion's, else that on a chosen cut, else the
    recursion's with fewer modes."""
    if not kept:
        return _rigid(beam)
    wishes = wishes or BuildOptions()
    _check_springs(wishes)

    def whole_target(port: str, count: int) -> PortModel:
        return with_modes(target_of(port, count), count, port)

    history: list[str] = []
    cut_beam = partial(_cut_beam, beam, kept, whole_target, wishes, history)
    recursive = partial(_recursive, beam, kept, whole_target, wishes, history)
    if wishes.lines or wishes.further or wishes.cut is not None:
        return cut_beam()
    if wishes.springs == "hinges":
        return recursive(fewer=True)
    try:
        return recursive(fewer=False)
    except RealisationError as error:
        history.append(f"recursion: {error}")
    try:
        return cut_beam()
    except RealisationError as error:
        refusal = error
    try:
        return recursive(fewer=True)
    except RealisationError:
        raise refusal from None


def _check_springs(wishes: BuildOptions) -> None:
    """Springs are not asked to stand on the hinges where a tendon per mode is needed."""
    reasons = {
        "fit.cuts": wishes.lines,
        "a further port": wishes.further,
        'damping.form = "modal"': wishes.per_mode,
    }
    reason = next((name for name, asked in reasons.items() if asked), None)
    if wishes.springs == "hinges" and reason:
        raise InputError(
            f'fit.springs = "hinges" and {reason} do not go together: that takes a tendon per '
            'mode; use fit.springs = "auto".'
        )


def _cut_beam(
    beam: MassLine,
    kept: Mapping[str, int],
    target_of: TargetOf,
    wishes: BuildOptions,
    history: list[str],
) -> Built:
    """The chain on a chosen cut for all ports."""
    missing: list[str] = []
    targets = {port: _available(target_of, port, count, missing) for port, count in kept.items()}
    groups = [_modes_of(port, target, wishes, kept[port]) for port, target in targets.items()]
    built = cut_chain(beam, groups, wishes.lines, wishes.further, wishes.cut)
    for port, target in () if wishes.further else targets.items():
        found = built.chain.port(port).frequencies[: target.modes]
        miss = float(np.max(np.abs(found / target.frequencies - 1.0)))
        if miss > LOST_DIGITS:
            raise RealisationError(
                f"digits are lost with {target.modes} modes in {port}: a frequency is off by "
                f"{miss:.1e}; keep fewer modes."
            )
    return replace(built, targets=targets, missing=tuple(missing), history=tuple(history))


def _modes_of(port: str, target: PortModel, wishes: BuildOptions, count: int) -> ModeGroup:
    """A port's target, whose first `count` modes are modes, to be given to bodies."""
    rows = [target.participation]
    if wishes.further:
        rows.append(target.point_motion(wishes.further).reshape(target.modes, -1))
    damping = target.damping if wishes.per_mode else np.zeros(target.modes)
    return ModeGroup(
        (port,),
        target.frequencies,
        np.hstack(rows),
        damping,
        target.shapes,
        rigid=target.rigid_mass,
        left_out=wishes.left_out.get(port),
        normal=min(count, target.modes),
        band=wishes.band,
        neutral=wishes.neutral,
    )


def with_modes(target: PortModel, count: int, where: str) -> PortModel:
    """A target that has the `count` modes asked for, which a free root may not leave."""
    if target.modes < count:
        raise RealisationError(
            f"a free root leaves {target.modes} of {count} modes in {where}, since modes carry all "
            'mass there; keep fewer modes, or choose target "clamped" or "hub".'
        )
    return target


def _available(target_of: TargetOf, port: str, count: int, missing: list[str]) -> PortModel:
    """The target with as many of `count` modes as double precision holds."""
    reason: RealisationError | None = None
    for modes in range(count, 0, -1):
        try:
            target = target_of(port, modes)
        except RealisationError as error:
            reason = reason or error
            continue
        if reason is not None:
            missing.append(f"{port} keeps {modes} of the {count} modes asked for. {reason}")
        return target
    assert reason is not None
    raise reason


def _rigid(beam: MassLine) -> Built:
    """The appendage as one body."""
    links = settle_links(beam, bodies(beam, np.zeros(0)), np.zeros(0))
    return Built(Chain(tuple(links), (), beam.length), {}, "one rigid body")


# -- springs on the hinges: the recursion ----------------------------------------------------------
def _recursive(
    beam: MassLine,
    kept: Mapping[str, int],
    target_of: TargetOf,
    wishes: BuildOptions,
    history: list[str],
    *,
    fewer: bool,
) -> Built:
    """The recursion's chain for all ports, perhaps with fewer modes in a plane."""
    targets: dict[str, PortModel] = {}
    nodes: dict[str, Nodes] = {}
    strings: dict[str, tuple[Array, Array]] = {}
    for port, count in kept.items():
        if port in PLANES:
            least = 1 if fewer else count
            targets[port], nodes[port] = _plane(beam, port, count, least, target_of, history)
        else:
            targets[port] = target_of(port, count)
            strings[port] = realise_scalar(targets[port])
    chain = assemble(beam, nodes, strings)
    across = float(max(np.diag(chain.rigid_mass())[4:]))
    if any(min(link.inertia[1:]) < A_POINT * across for link in chain.links[1:]):
        raise RealisationError(
            "a link of the recursion would be a point; its hinges nearly coincide."
        )
    missing = [
        f"{port} keeps {targets[port].modes} of the {count} modes asked for."
        for port, count in kept.items()
        if targets[port].modes < count
    ]
    how = "springs on the hinges"
    if wishes.springs == "modes" or wishes.per_mode:
        undamped = {port: np.zeros(target.modes) for port, target in targets.items()}
        ratios = (
            {port: target.damping for port, target in targets.items()}
            if wishes.per_mode
            else undamped
        )
        chain = springs_as_modes(chain, ratios)
        why = 'fit.springs = "modes"' if wishes.springs == "modes" else "each has its own damping"
        how = f"one tendon per mode, as {why}, on the bodies of the recursion"
    if missing:
        missing.append(history[0])
    return Built(chain, targets, how, tuple(missing), tuple(history))


def assemble(
    beam: MassLine, nodes: Mapping[str, Nodes], strings: Mapping[str, tuple[Array, Array]]
) -> Chain:
    """The chain whose bodies serve all planes, torsion springs on its hinges."""
    total = Moments(*beam.moments([0.0, beam.length])[0].tolist())
    rotary = abs(total.rotary_xy - total.rotary_xz) / total.second
    if len(nodes) == 1 and not beam.exact:
        rotary -= PRINTED  # of imported mass it is known to the print
    shared = _shared_nodes(nodes, rotary)
    if shared is None:
        raise RealisationError("the planes do not share their hinges.")
    if "axial" in strings:
        raise RealisationError("axial modes do not share the hinges of bending.")
    own = total.polar if total.polar > NO_POLAR * total.second else 0.0
    links = planar_links(shared, beam)
    cuts = shared.positions[1:-1]
    inertias = np.array([own]) if "torsion" not in strings else strings["torsion"][0]
    turning, polars = polar_inertias(beam, links, cuts, inertias, real_polar(beam, cuts))
    torsion = (
        dict(zip(turning, strings["torsion"][1].tolist(), strict=True))
        if "torsion" in strings
        else {}
    )
    hinges = tuple(
        Hinge(
            x=float(x),
            stiffness={port: float(own.stiffness[i]) for port, own in nodes.items()}
            | ({"torsion": torsion[i]} if i in torsion else {}),
        )
        for i, x in enumerate(cuts)
    )
    return Chain(tuple(with_polar(links, polars)), hinges, beam.length)


def _shared_nodes(nodes: Mapping[str, Nodes], rotary: float) -> Nodes | None:
    """The nodes that serve every bending plane at once, if there are such."""
    if not nodes or rotary > SAME:
        return None
    first, *others = nodes.values()
    for other in others:
        if other.masses.size != first.masses.size:
            return None
        if np.any(np.abs(other.masses - first.masses) > SAME * first.masses) or np.any(
            np.abs(other.lengths - first.lengths) > SAME * first.lengths
        ):
            return None
    return first


def _plane(
    beam: MassLine, port: str, count: int, least: int, target_of: TargetOf, history: list[str]
) -> tuple[PortModel, Nodes]:
    """Target and canonical chain of a plane with as many modes as are physical."""
    for modes in range(count, least - 1, -1):
        try:
            target = target_of(port, modes)
            nodes = realise(target)
            springs = sprung(port, nodes.positions[1:-1], nodes.stiffness)
            probe = Chain(tuple(planar_links(nodes, beam)), springs, beam.length).port(port)
            miss = float(np.max(np.abs(probe.frequencies / target.frequencies - 1.0)))
            if miss > LOST_DIGITS:
                raise RealisationError(
                    f"digits are lost with {modes} modes: a frequency is off by {miss:.1e}."
                )
        except RealisationError as error:
            history.append(f"{port}, {modes} modes: {error}")
            continue
        return target, nodes
    raise RealisationError(
        f"no chain with springs on its hinges exists for this appendage in {port}: {history[-1]}"
    )


# -- one tendon per mode: a cut --------------------------------------------------------------------
def cut_chain(
    line: MassLine,
    groups: Sequence[ModeGroup],
    lines: Sequence[float],
    further: Sequence[float] = (),
    cut: Cut | None = None,
    most_added: int = MOST_ADDED,
) -> Built:
    """A chain with one tendon per mode, whose targets the caller knows;
    `most_added`: see `choose_cut`."""
    groups = [
        group.fitting(group_motion(group.ports).T @ line.whole @ group_motion(group.ports))
        for group in groups
    ]
    demands = [_hinge_demand(line, group, lines) for group in groups]
    cut = cut or choose_cut(line, demands, lines, further, most_added)
    try:
        links = settle_links(line, bodies(line, cut.x), cut.x)
    except RealisationError:
        if not line.exact:
            raise
        return _cut_wide_chain(line, groups, lines, further)
    _check_masses(links, cut.x)
    hinges = tuple(
        Hinge(x=float(x), stiffness=dict.fromkeys(ports, 0.0))
        for x, ports in zip(cut.x, cut.ports, strict=True)
    )
    limp = Chain(tuple(links), hinges, line.length)
    damped = any(np.any(group.damping > 0.0) for group in groups)
    chain = given_modes(limp, groups, further, ratio=FILLER_RATIO if damped else 0.0)
    how = (
        f"one tendon per mode on {len(hinges)} chosen cuts, shortest link "
        f"{shortest_link(cut.x, line.length):.3g} of the length"
    )
    return Built(chain, {}, how + _added_hinges(cut, lines, line.length), cut=cut)


def _check_masses(links: Sequence[Link], cuts: Array) -> None:
    """Every link that moves against the root has mass."""
    least = NO_MASS * sum(link.mass for link in links)
    for number, (link, start) in enumerate(zip(links[1:], cuts, strict=True), 2):
        if link.mass <= least:
            raise RealisationError(
                f"link {number}, from x = {start:.3g} m, would have no mass: the appendage has "
                "none there that its modes need; keep fewer modes, or state fit.cuts."
            )


def _added_hinges(cut: Cut, lines: Sequence[float], length: float) -> str:
    """How many hinges a cut has beyond those that the modes need, why, and where; "" for none."""
    if not cut.added:
        return ""
    count = f", {cut.added} more than the modes alone would need"
    if not lines:
        return count
    away = np.min(np.abs(cut.x[:, None] - np.array(lines)), axis=1) > SAME_PLACE * length
    places = ", ".join(f"{x:.3g}" for x in cut.x[away])
    return (
        f"{count} (with {len(cut.x) - cut.added}, {len(lines)} of them from fit.cuts, {cut.reason};"
        f" now hinges stand also at {places} m)"
    )


def _cut_wide_chain(
    line: MassLine, groups: Sequence[ModeGroup], lines: Sequence[float], further: Sequence[float]
) -> Built:
    """The chain of an appendage too wide for thin links, on bodies of its rigid mass whose breadth
    stands in all three inertias, with little near the root."""
    refusals: list[str] = []
    for power in (0, 1, 2, 4):
        try:
            spread = spread_mass(line.rigid_mass(), line.length, power=power)
            built = cut_chain(spread, groups, lines, further)
        except (RealisationError, InputError) as error:
            refusals.append(str(error))
            continue
        why = "bodies of the appendage's rigid mass as it is too wide for thin links"
        return replace(built, how=f"{built.how}, {why}")
    raise RealisationError(refusals[0])


def _hinge_demand(line: MassLine, group: ModeGroup, lines: Sequence[float]) -> HingeDemand:
    """The hinges that a group needs: as many as its modes, and all that must stand."""
    required = _required_hinges(line, group, lines)
    counts = {port: max(count, len(required[port])) for port, count in _counts(group).items()}
    return HingeDemand(group, counts, required)


def _counts(group: ModeGroup) -> dict[str, int]:
    """Hinges per port: as many as the modes need together, shared out as they move the ports."""
    n, m = group.rows.shape
    scale = np.linalg.norm(group.rows, axis=0)
    rank = np.linalg.matrix_rank(group.rows / np.where(scale > 0.0, scale, 1.0), tol=RANK)
    total = n + m - int(rank)
    if len(group.ports) == 1:
        return {group.ports[0]: total}
    own = dict.fromkeys(group.moving, 0)
    least = {port: 2 if port in PLANES else 1 for port in own}
    weights = group.weights
    # the port that has least beside what moves in it
    for _ in range(max(total, sum(least.values()))):
        port = min(own, key=lambda p: (own[p] >= least[p], (own[p] + 0.5) / max(weights[p], 1e-3)))
        own[port] += 1
    return own


def _required_hinges(
    line: MassLine, group: ModeGroup, lines: Sequence[float]
) -> dict[str, tuple[float, ...]]:
    """Per port, x of the hinges that must stand: the user's, real ones, a massless root."""
    motion = group_motion(group.ports)
    mass = motion.T @ line.whole @ motion
    size = np.sqrt(np.diag(mass))
    part = group.rows[:, : len(mass)] / size
    bare = float(np.linalg.eigvalsh(mass / np.outer(size, size) - part.T @ part)[0]) < NOTHING
    root = {0.0} if bare else set[float]()
    return {
        port: tuple(sorted({*lines, *line.hinge_lines.get(port, ()), *root}))
        for port in group.moving
    }


def with_real_polar(chain: Chain) -> Chain:
    """A recipe's chain with a little polar inertia where the appendage states none."""
    polars = [
        max(TINY * iz, abs(iz - iy)) if link.mass > 0.0 and ix <= 0.0 else ix
        for link in chain.links
        for ix, iy, iz in [link.inertia]
    ]
    return replace(chain, links=tuple(with_polar(chain.links, polars)))
