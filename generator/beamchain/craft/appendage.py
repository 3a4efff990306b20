"""One embedded appendage, and what is proved of it:
its numbers and the spacecraft's are as they were."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
from lxml import etree
from lxml.etree import _Element as Element

from beamchain.craft.bent_line import BentLine, bent_line
from beamchain.craft.disturbances import TENDON_DAMPING, disturbances
from beamchain.craft.error import PlacedBody
from beamchain.craft.hanging_liquid import (
    SLACK,
    HangingLiquid,
    hanging_liquid,
    springs_at_stated,
)
from beamchain.craft.loads import Carries, Load
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import compile_model, mass_of_alone
from beamchain.engine.model_diff import NAMED, Difference, differences, ids_of, in_order_of, others
from beamchain.engine.mount import Mount
from beamchain.engine.operating_point import quiet_copy
from beamchain.errors import EngineError, InputError
from beamchain.fitting.body import Body
from beamchain.fitting.exact import ExactAppendage
from beamchain.fitting.hub import Hub
from beamchain.fitting.result import Fit, exact_of
from beamchain.fitting.spec import Spec
from beamchain.mjcf import compatibility, insert, write
from beamchain.ports.motions import UPRIGHT, Array
from beamchain.steps.budget import preload
from beamchain.steps.driven import keyframes, limit_sentences
from beamchain.steps.large_motion import LargeMotion
from beamchain.steps.retime import without_timing
from beamchain.steps.retime_file import put_time
from beamchain.structure.modal_data import ModalData
from beamchain.structure.slosh import Slosh
from beamchain.warning_codes import Caution, at

# names of the empty bodies that stand for appendages while the spacecraft is measured
PROBE = "beamchain probe "
SAME = 1e-12  # relative: the appendage's numbers alone and in the spacecraft


@dataclass(frozen=True, eq=False)
class Appendage:
    """One embedded appendage.

    Args:
        at: site or body.
        prefix: of its elements.
        mount: the place in the bare spacecraft.
        hub: what its root feels, other appendages rigid.
        spec: as it was given.
        fit: made for that hub.
        timed: the spacecraft with its appendages exact in time for its own step;
            None: they are not.
        rigid: without joints and tendons.
        carries: names of bodies of the spacecraft by port.
        loads: what its ports carry, other appendages included.
        elements: names of its elements per kind, where they were read from a file; None: those of
            the fit.
    """

    at: str
    prefix: str
    mount: Mount
    hub: Hub
    spec: Spec
    fit: Fit
    timed: "mujoco.MjModel | None" = None
    rigid: bool = False
    carries: Carries = field(default_factory=dict)
    loads: tuple[Load, ...] = ()
    elements: Mapping[str, frozenset[str]] | None = None

    def element(self) -> Element:
        """Its drop-in MJCF, exact in time where the spacecraft is; that the root is turned on its
        place is left to the mount."""
        tree = self.fit.appendage(timed=False)
        write.turn_root(write.find(tree, "worldbody/body"), UPRIGHT)
        name = self.fit.spec.name
        if self.timed is not None:
            put_time(tree, self.timed, lambda word: self.prefix + word.removeprefix(f"{name}_"))
        if self.rigid:
            etree.strip_elements(
                tree, "joint", "tendon", "tendonpos", "tendonvel", "exclude", with_tail=False
            )
        return tree

    @cached_property
    def large_motion(self) -> dict[str, LargeMotion]:
        """How far its chain may be driven, per bending plane;
        empty where no beam or no chain is there to compare."""
        return {} if self.fit.space is not None else self.fit.large_motion[0]


def driven_too_far(model: "mujoco.MjModel", appendages: Sequence[Appendage]) -> list[str]:
    """Sentences for keyframes that start an appendage beyond what its chain is right for."""
    out: list[str] = []
    for a in appendages:
        for name, run in keyframes(model, f"{a.prefix}link1").items():
            out += [
                at(f"{a.at}, keyframe {name}", sentence)
                for sentence in limit_sentences(a.large_motion, run)
            ]
    return out


def names(appendages: Sequence[Appendage]) -> dict[str, set[str]]:
    """Names of all elements the appendages bring, per kind."""
    kinds = {"body": "body", "joint": "jnt", "geom": "geom", "site": "site", "fixed": "tendon"}
    kinds |= {"material": "mat", "texture": "tex", "skin": "skin"}
    kinds |= dict.fromkeys(
        ("tendonpos", "tendonvel", "framepos", "framequat", "force", "torque"), "sensor"
    )
    out: dict[str, set[str]] = {kind: set() for kind in kinds.values()}
    for a in appendages:
        if a.elements is not None:
            for kind, known in a.elements.items():
                out[kind] |= known
            continue
        for node in insert.with_prefix(
            a.fit.appendage(timed=False), a.fit.spec.name, a.prefix
        ).iter(*kinds):
            if node.get("name"):
                out[kinds[str(node.tag)]].add(str(node.get("name")))
    return out


def check_names(craft: "mujoco.MjModel", appendages: Sequence[Appendage]) -> None:
    """No name is given twice."""
    taken = ids_of(craft, names(appendages))
    for kind, word in NAMED.items():
        if taken[kind]:
            name = getattr(craft, word)(taken[kind][0]).name
            raise InputError(
                f"the spacecraft already has a {word} {name!r}; give the appendage another name "
                f"in its specification{_named_so(appendages, name)}."
            )


def _named_so(appendages: Sequence[Appendage], name: str) -> str:
    """Names that an appendage makes with the prefix of a name, in brackets."""
    for a in appendages:
        if name.startswith(a.prefix):
            return f" (names of {a.spec.name!r} are {a.prefix}root, {a.prefix}link1, ...)"
    return ""


def check_craft_unchanged(
    craft: "mujoco.MjModel", model: "mujoco.MjModel", appendages: Sequence[Appendage]
) -> None:
    """Every number of the bare spacecraft is the same in `model`, with appendages and without
    timing."""
    before = _without_probes(craft)
    after = craft_elements(craft, model, appendages)
    pairs = {kind: (before[kind], ids) for kind, ids in after.items()}
    changed = differences(craft, model, pairs, placed=moved_bodies(appendages))
    if changed:
        raise EngineError(
            f"embedding changed the spacecraft itself: {_difference_sentence(changed[0])}; please "
            "report this."
        )


def moved_bodies(appendages: Sequence[Appendage]) -> list[str]:
    """Names of the spacecraft's bodies that hang on ports."""
    return [name for a in appendages for names in a.carries.values() for name in names]


def craft_elements(
    craft: "mujoco.MjModel", model: "mujoco.MjModel", appendages: Sequence[Appendage]
) -> dict[str, list[int]]:
    """Ids per kind of the bare spacecraft's elements in `model`, in the spacecraft's order."""
    ids = others(model, ids_of(model, names(appendages)))
    bodies = _without_probes(craft)["body"]
    return in_order_of(craft, bodies, model, ids, moved_bodies(appendages))


def compiled_alone(fit: Fit) -> "mujoco.MjModel":
    """An appendage on a body of its own, compiled, not timed."""
    scene = write.scene_document(
        fit.appendage(timed=False),
        fit.spec.name,
        mass=1.0,
        inertia=np.eye(3),
        offset=np.zeros(3),
        timestep=0.01,
        integrator="implicitfast",
    )
    return compile_model(write.document_text(scene))


def check_appendages_unchanged(
    model: "mujoco.MjModel",
    appendages: Sequence[Appendage],
    defaults: Mapping[str, Mapping[str, int]],
) -> None:
    """Every number of the appendages is the same in `model` as in a scene of their own.

    `defaults`: attributes that the file of the spacecraft sets by default, per tag.
    """
    for a in appendages:
        alone = compiled_alone(a.fit)
        before = ids_of(alone, names([replace(a, prefix=f"{a.spec.name}_")]))
        after = ids_of(model, names([a]))
        pairs = {kind: (ids, after[kind]) for kind, ids in before.items()}
        root = f"{a.prefix}link1"
        changed = differences(alone, model, pairs, placed=[root], tolerance=SAME, user=False)
        if changed:
            _refuse(changed[0], a, defaults)


def motion_warnings(
    model: "mujoco.MjModel", appendages: Sequence[Appendage], final: "mujoco.MjModel"
) -> list[str]:
    """Warnings about what disturbs the motion of the appendages; `model`: with them and without
    timing; `final`: as it will run."""
    warnings: list[str] = []
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    load = preload(model, data)
    if load:
        text = (
            f"{load} at rest; the proof takes it as balanced there. If nothing balances it, "
            "move its springref."
        )
        warnings.append(Caution("preloaded-spring", text))
    ratios = [r for a in appendages for m in a.fit.achieved.values() for r in m.damping]
    kept = [w for a in appendages for m in a.fit.target.values() for w in m.frequencies]
    ids = ids_of(model, names(appendages))
    found = disturbances(
        final,
        fastest=max(kept, default=0.0),
        zeta=min(ratios, default=0.0),
        geoms=ids["geom"],
        bodies=ids["body"],
    )
    has_timing = final is not model
    warnings += [text for text in found if not (has_timing and text.startswith(TENDON_DAMPING))]
    return warnings


def _refuse(
    found: Difference, changed: Appendage, defaults: Mapping[str, Mapping[str, int]]
) -> None:
    """Say what the spacecraft would change of an appendage, and the way out that works."""
    if found.field == "number of elements" and found.element in ("geom", "mat", "tex"):
        raise InputError(
            f"the spacecraft's compiler would drop the appendage's shapes ({found.found:g} of "
            f"{found.wanted:g} are left); "
            'write discardvisual="false" in <compiler>, or scene.visuals = false in the '
            "appendage's spec."
        )
    kind, _, field = found.field.partition("_")
    tag = {"jnt": "joint", "dof": "joint", "tendon": "fixed"}.get(kind, kind)
    own = {
        str(name) for node in changed.fit.appendage(timed=False).iter(tag) for name in node.attrib
    }
    left = [
        name
        for name in defaults.get(tag, {})
        if name not in own and name not in compatibility.NEUTRAL.get(tag, {})
    ]
    word = ", ".join(left) or field  # a mesh by default shows in aabb, rbound, ...
    raise InputError(
        "the spacecraft's defaults or compiler would change the appendage: "
        f"{_difference_sentence(found)}; take {word} out of them."
    )


def moved_by_load(craft: "mujoco.MjModel", loaded: "mujoco.MjModel") -> list[str]:
    """What MuJoCo itself does otherwise with the spacecraft as soon as its bodies carry
    something (alignfree)."""
    own = _without_probes(loaded)
    moved = differences(
        craft, loaded, {kind: (ids, own[kind]) for kind, ids in others(craft, {}).items()}
    )
    if not moved:
        return []
    text = (
        f"as soon as it carries something, MuJoCo lays {moved[0].element}'s frame otherwise "
        f"({_difference_sentence(moved[0])}; alignfree or align); positions and "
        'keyframes now mean the frame as written: write align="false" to keep it.'
    )
    return [Caution("alignfree", text)]


def _without_probes(model: "mujoco.MjModel") -> dict[str, list[int]]:
    probes = [i for i in range(model.nbody) if model.body(i).name.startswith(PROBE)]
    return others(model, {"body": probes})


def _difference_sentence(difference: Difference) -> str:
    return (
        f"{difference.field} of {difference.element} is {difference.found!r} instead of "
        f"{difference.wanted!r}"
    )


def carried(model: "mujoco.MjModel | None", appendages: Sequence[Appendage]) -> list[PlacedBody]:
    """The exact appendages; without a model their degrees of freedom are left out."""
    out: list[PlacedBody] = []
    for a in appendages:
        item = placed_body(a.mount, a.fit.body, exact_of(a.fit), a.loads)
        if model is not None:
            own = ids_of(model, names([a]))
            dofs = own["dof"]
            alone = _mass_alone(model, own["body"], dofs) if a.loads else None
            item = replace(item, dofs=dofs, alone=alone)
        out.append(item)
    return out


def placed_body(
    mount: Mount, body: Body, exact: ExactAppendage, loads: Sequence[Load] = ()
) -> PlacedBody:
    """An exact appendage on the spacecraft, before there is a chain of it."""
    band, liquid, scene = exact.band, body.spec.slosh, body.spec.scene
    if not band:  # a rigid body: as far as the scene looks
        asked = None if scene is None else scene.bandwidth
        band = {"rigid": asked or float(exact.model.frequencies[0])}
    item = PlacedBody(
        mount,
        exact.model,
        exact.kept,
        dofs=[],
        band=band,
        loads=tuple(loads),
        undamped=body.spec.undamped_ratio,
    )
    if liquid is not None:
        springs = springs_at_stated(liquid)
        return replace(item, line=partial(_liquid, liquid), springs=springs, slack=SLACK)
    return item if body.data is not None else replace(item, line=partial(_line, body, exact, loads))


def _liquid(liquid: Slosh, band: float) -> HangingLiquid:
    """The liquid, whatever the band [rad/s]."""
    del band
    return hanging_liquid(liquid)


def _line(body: Body, exact: ExactAppendage, loads: Sequence[Load], band: float) -> BentLine:
    """How an appendage bends up to a band [rad/s]."""
    return bent_line(
        body.spec.beam,
        exact.ports,
        exact.model.rigid_mass,
        stations=[load.x for load in loads],
        band=band,
    )


def _mass_alone(model: "mujoco.MjModel", bodies: Sequence[int], dofs: Sequence[int]) -> Array:
    """`(n, n)` mass of an appendage's degrees of freedom without what hangs on its ports, and
    without timing."""
    return mass_of_alone(quiet_copy(without_timing(model)), bodies)[np.ix_(dofs, dofs)]


def rigid_mass(spec: Spec, data: ModalData | None = None) -> Array:
    """`(6, 6)` of an appendage before it is fitted, about its root; `data`: its imported modes,
    where they are known."""
    if spec.slosh is not None:
        return spec.slosh.rigid_mass()
    if spec.imported is None:
        return spec.beam.rigid_mass()
    return (data or spec.imported.read()).rigid_mass


def lightest(appendages: Sequence[Appendage]) -> tuple[float, float]:
    """Smallest mass [kg] and principal inertia [kg m^2] of the bodies that move."""
    masses, inertias = [np.inf], [np.inf]
    for a in appendages:
        for inertial in list(a.fit.appendage(timed=False).iter("inertial"))[1:]:
            masses.append(float(inertial.get("mass", "inf")))
            inertias += [float(word) for word in inertial.get("diaginertia", "inf").split()]
    return min(masses), min(inertias)
