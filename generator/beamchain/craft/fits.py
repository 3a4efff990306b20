"""Every appendage of a spacecraft fitted to the hub that it meets,
with the modes that the promise needs."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import msgspec
import numpy as np

from beamchain.craft.appendage import Appendage, rigid_mass
from beamchain.craft.documents import AppendageRequest
from beamchain.craft.loads import Item, Load, hanging_notes, loads_of
from beamchain.craft.promise import Placed, fits_that_keep, joint_request
from beamchain.engine import mount as mounting
from beamchain.engine.bench import composite
from beamchain.engine.library import mujoco, one_thread, rest
from beamchain.errors import InputError
from beamchain.fitting.body import Body
from beamchain.fitting.candidate import Candidate
from beamchain.fitting.fit import body_and_kept, fit_kept
from beamchain.fitting.hub import Hub
from beamchain.fitting.kept import Kept
from beamchain.fitting.options import Root
from beamchain.fitting.result import Fit
from beamchain.fitting.slosh import heavy
from beamchain.fitting.spec import Spec
from beamchain.fitting.warnings import doubtful, rigid_plane
from beamchain.ports.motions import Array
from beamchain.structure.modal_data import ModalData
from beamchain.warning_codes import Caution
from beamchain.warning_codes import at as said_of

MASSLESS = 1e-12  # relative: what subtracting all mass leaves of it
SAME_HUB = 1e-12  # relative: hubs that are one
HEAVY = 100.0  # times the spacecraft without appendages
FAR = 20.0  # [m] from the centre of mass, and of radii of gyration: a place in other units
MANY = 100.0
CLOSE = 1e-3  # of its length: where an appendage starts at the centre of mass
#: how the fit takes a joint behind an appendage, by what holds it
TAKEN = {
    "servo": ("locked, since its servo holds it", "locked, since their servos hold them"),
    "spring": ("locked, since its spring holds it", "locked, since their springs hold them"),
    "": ("free, since nothing holds it", "free, since nothing holds them"),
}
RIGID = 1e-6  # relative: a hub that differs from a rigid body by more has loose joints


def fit_all(
    model: "mujoco.MjModel",
    mounts: dict[str, mounting.Mount],
    wanted: "Mapping[str, AppendageRequest]",
    most: int,
    fits: "Fits",
    rigid: bool = False,
) -> tuple[tuple[Appendage, ...], list[str], tuple[str, ...]]:
    """Every appendage fitted to the hub it meets, with the modes that the craft's promise needs;
    notes; steps taken.

    Rigid ones are fitted as they are asked for: what they lack is no fault.
    """
    loads = loads_of(
        model, {at: Item(mounts[at].body, wish.spec, wish.carries) for at, wish in wanted.items()}
    )
    hubs = _hubs(model, mounts, wanted, loads, fits.held)
    placed: list[Placed] = []
    warnings: list[str] = []
    for name, wish in wanted.items():
        fit, chosen = fits.candidate(name, wish.spec, hubs[name])
        item = Placed(name, mounts[name], loads[name], chosen)
        placed.append(item if fit is None else item.with_fit(chosen, fit))
        warnings += _notes(name, wish.spec, mounts[name], hubs[name])
        warnings += _place_notes(model, item, wish, loads)
    want = joint_request([] if rigid else [wish.spec for wish in wanted.values()])
    with one_thread():
        made, steps = fits_that_keep(model, placed, want, most, fits)
    appendages = tuple(
        Appendage(
            item.at,
            wanted[item.at].prefix,
            item.mount,
            hubs[item.at],
            wanted[item.at].spec,
            fit,
            rigid=rigid,
            carries=wanted[item.at].carries,
            loads=item.loads,
        )
        for item, fit in zip(placed, made, strict=True)
    )
    if not rigid:
        warnings += [note for a in appendages for note in _fit_notes(a)]
    return appendages, warnings, steps


def _hubs(
    model: "mujoco.MjModel",
    mounts: dict[str, mounting.Mount],
    wanted: "Mapping[str, AppendageRequest]",
    loads: "Mapping[str, tuple[Load, ...]]",
    held: Mapping[str, ModalData],
) -> dict[str, Hub]:
    """What every appendage meets at its root: what is rigidly behind it, or where joints are loose
    and it carries nothing, what it feels."""
    frozen = {name: rigid_mass(wish.spec, held.get(name)) for name, wish in wanted.items()}
    places = list(mounts.values())
    riding = {
        at: (
            sorted({body for load in own for body in load.bodies}),
            {place for load in own for place in load.places},
        )
        for at, own in loads.items()
    }
    behind = mounting.rigid_hubs(model, places, frozen, riding)
    felt = mounting.apparent_hubs(model, places, frozen)
    hubs: dict[str, Hub] = {}
    for name in wanted:
        body = mounts[name].body
        if behind[name][0, 0] <= MASSLESS * mounts[name].hub[0, 0]:
            raise InputError(
                f"{name}: body {model.body(body).name!r} has no mass beside what the "
                "appendage carries, so that there is no hub; give the body an <inertial>, or take "
                "what belongs to the hub out of carries."
            )
        hub = Hub.from_mass_matrix(behind[name])
        size = np.sqrt(np.diag(behind[name]))
        is_loose = np.max(np.abs(felt[name] - behind[name]) / np.outer(size, size)) > RIGID
        if is_loose and not loads[name]:
            apparent = tuple(tuple(float(v) for v in row) for row in felt[name])
            hub = msgspec.structs.replace(hub, apparent=apparent)
        hubs[name] = hub
    return hubs


def _place_notes(
    model: "mujoco.MjModel",
    item: Placed,
    wish: AppendageRequest,
    loads: "Mapping[str, tuple[Load, ...]]",
) -> Iterator[str]:
    """What is odd about where an appendage stands and what hangs at it."""
    name, place = item.at, item.mount
    hanging = list(hanging_notes(model, place, Item(place.body, wish.spec, wish.carries)))
    yield from hanging
    mass, rest = float(item.candidate.body.rigid_mass[0, 0]), float(model.body_subtreemass[0])
    if mass > HEAVY * rest:
        yield Caution(
            "heavy-appendage",
            f"the appendage at {name} weighs {mass:.3g} kg, the spacecraft {rest:.3g} kg: are "
            "lengths in m?",
        )
    if ":" in name:
        return
    # what stands at its end and was forgotten is no mass to point away from
    forgotten = any(isinstance(w, Caution) and w.code == "not-carried" for w in hanging)
    if not (wish.carries or forgotten) and _points_inward(model, place, item.candidate.body, loads):
        yield Caution(
            "points-inward",
            f"the appendage at {name} runs to the other side of the spacecraft's centre of "
            f"mass: does the x axis of {name} point outwards?",
        )
    yield from _far(model, name, place)


def _fit_notes(a: Appendage) -> Iterator[str]:
    """What a fit says that holds on the spacecraft as well, whose integrator judges tendons."""
    if not a.fit.status.ok:
        yield Caution("fit-missed", f"{a.at}: {a.fit.status.message}")
    hinged = a.spec.damping is not None and a.spec.damping.form == "hinge"
    if a.spec.slosh is not None:
        found = heavy(a.spec.slosh, a.hub.mass)
    elif hinged or a.fit.space is not None:
        found = a.fit.cautions
    else:
        found = doubtful(a.spec.segment, a.spec.damping, a.fit.target)
    yield from (said_of(a.at, warning) for warning in found)


def _points_inward(
    model: "mujoco.MjModel",
    place: mounting.Mount,
    appendage: Body,
    loads: "Mapping[str, tuple[Load, ...]]",
) -> bool:
    """Whether an appendage starts towards the centre of mass of what it stands on, what ports
    carry left out, passes it closely, and ends behind it."""
    is_long = appendage.spec.is_beam or appendage.spec.imported is not None
    top = int(model.body_rootid[place.body])
    if not is_long or not top:
        return False
    carried = {body for those in loads.values() for load in those for body in load.bodies}
    if place.body in carried:
        return False
    length = appendage.length
    own = [i for i in np.flatnonzero(np.asarray(model.body_rootid) == top) if i not in carried]
    mass = np.asarray(model.body_mass)[own]
    centre = mass @ np.asarray(rest(model).xipos)[own] / max(float(np.sum(mass)), 1e-300)
    way = np.asarray(centre - place.origin, dtype=np.float64)
    ahead = float(way @ place.axes[:, 0])
    aside = float(np.linalg.norm(way - ahead * place.axes[:, 0]))
    return CLOSE * length < ahead < length and aside < ahead / 2.0


def _far(model: "mujoco.MjModel", name: str, place: mounting.Mount) -> Iterator[str]:
    """That a place is so far outside of the spacecraft that its unit is probably wrong."""
    root = int(model.body_rootid[place.body])
    if not root or model.body_subtreemass[root] <= 0.0:
        return
    whole = composite(model, root)
    size = float(np.sqrt(np.linalg.eigvalsh(whole.inertia)[-1] / whole.mass))
    away = float(np.linalg.norm(place.origin - rest(model).subtree_com[root]))
    if away > max(FAR, MANY * size):
        yield Caution(
            "far-mount",
            f"{name} stands {away:.4g} m from the spacecraft's centre of mass, whose radius of "
            f"gyration is {size:.3g} m; if mm were meant, divide its pos by 1000.",
        )


def _notes(name: str, spec: Spec, place: mounting.Mount, hub: Hub) -> Iterator[str]:
    """What the spacecraft makes of an appendage that its spec does not say."""
    behind = [joint for joint in place.joints if not joint.own]
    if behind:
        taken = {
            words: [joint.name for joint in behind if joint.holder == holder]
            for holder, words in TAKEN.items()
        }
        fitted = "; ".join(
            f"{', '.join(joints)} as {words[len(joints) > 1]}"
            for words, joints in taken.items()
            if joints
        )
        yield Caution(
            "joints-behind",
            f"{name}: stands behind the {', the '.join(joint.words for joint in behind)}; "
            f"{hub.mass:.6g} kg are rigidly behind its root. The fit takes {fitted}.",
        )
    if held := place.held(spec.kept):
        yield Caution(
            "held-ports",
            f"{name}: the spacecraft's joints hold port {', '.join(held)}, wholly or in part; what "
            "they hold counts as infinitely heavy.",
        )
    for port in spec.unsaid:
        if not place.held([port]):
            yield Caution("rigid-plane", f"{name}: {rigid_plane(port)}.")
    given = spec.root.hub
    rounding = 1e-9 * hub.mass
    if given is not None and not np.allclose(
        given.mass_matrix(), hub.mass_matrix(), rtol=1e-6, atol=rounding
    ):
        yield Caution(
            "other-hub",
            f"{name}: the spacecraft ({hub.mass:.6g} kg behind the root) was taken in place of the "
            f"specification's hub ({given.mass:g} kg).",
        )


class Fits:
    """Fits that were made already: of equal appendages on equal hubs, modes are chosen and chains
    made once.

    `ready`: fits, `held`: imported modes that were handed over, by place.
    """

    def __init__(
        self, ready: Mapping[str, Fit] | None = None, held: Mapping[str, ModalData] | None = None
    ) -> None:
        self.ready: Mapping[str, Fit] = ready or {}
        self.held: Mapping[str, ModalData] = held or {}
        self._chosen: list[tuple[Spec, ModalData | None, Body, Kept]] = []
        self._made: list[tuple[Spec, ModalData | None, Fit]] = []

    def candidate(self, at: str, spec: Spec, hub: Hub) -> tuple[Fit | None, Candidate]:
        """An appendage on its hub, with the modes that it needs by itself, and its chain where it
        is ready."""
        ready = self.ready.get(at)
        if ready is not None and _same_hub(ready.hub_mass, hub):
            body = replace(ready.body, spec=ready.spec)
            return ready, Candidate(body, ready.kept)
        data = self.held.get(at)
        for known, held, body, kept in self._chosen:
            if held is data and known == spec and _same_hub(body.hub, hub):
                return None, Candidate(body, kept)
        root = Root(target=spec.root.target, hub=hub)
        body, kept = body_and_kept(msgspec.structs.replace(spec, root=root), data)
        self._chosen.append((spec, data, body, kept))
        return None, Candidate(body, kept)

    def __call__(self, wanted: Candidate) -> Fit:
        """The chain of a candidate."""
        body, spec = wanted.body, wanted.stated if wanted.added else wanted.body.spec
        for known, data, made in self._made:
            if known == spec and data is body.data:
                return made
        made = fit_kept(replace(body, spec=spec), wanted.kept)
        self._made.append((spec, body.data, made))
        return made


def _same_hub(known: Array | None, hub: Hub) -> bool:
    """Whether a mass matrix `(6, 6)` is that of a hub."""
    here = hub.mass_matrix()
    if known is None:
        return False
    size = np.sqrt(np.diag(here))
    return float(np.max(np.abs(known - here) / np.outer(size, size))) <= SAME_HUB
