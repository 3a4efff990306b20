"""How a fitted appendage is drawn: surfaces that follow its kept modes."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from beamchain.chain.chain import Chain
from beamchain.fitting.body import Body
from beamchain.fitting.exact import SHAPED, reduced_to_kept
from beamchain.fitting.kept import Kept
from beamchain.fitting.options import Scene
from beamchain.fitting.spec import Spec
from beamchain.mjcf.skin import ModeMotion, Skin, mode_motion, skins
from beamchain.mjcf.surfaces import beam_surfaces, stations
from beamchain.ports.motions import Array
from beamchain.structure.discretise import Parts, sampled_model
from beamchain.structure.section_loads import snapped


class Chained(Protocol):
    """What of a fit is drawn: its appendage, the modes that are kept, and its chain."""

    @property
    def spec(self) -> Spec:
        """The specification."""
        ...

    @property
    def body(self) -> Body:
        """Every mode that is known of it."""
        ...

    @property
    def kept(self) -> Kept:
        """The modes that are kept."""
        ...

    @property
    def chain(self) -> Chain:
        """The fitted chain."""
        ...


@dataclass(frozen=True, eq=False)
class Look:
    """The drawn surfaces of an appendage.

    Args:
        drawn: "skin", "boxes", "contacts" (shapes that touch) or "nothing".
        skins: one per look: panels, tubes, lattices; none but for "skin".
        residual: per port `(n,)`: how far they miss each kept mode, relative to its largest
            displacement.
    """

    drawn: str
    skins: tuple[Skin, ...] = ()
    residual: dict[str, Array] = field(default_factory=dict)

    @property
    def vertices(self) -> int:
        """How many vertices the surfaces have."""
        return sum(len(skin.surface.points) for skin in self.skins)


def look_of(fit: Chained) -> Look:
    """How an appendage is drawn: as its scene wants it, but in boxes where it has too many
    segments, and imported modes and liquids, which have no sections."""
    scene = fit.spec.scene or Scene()
    if scene.contacts:
        return Look("contacts")
    if scene.look != "skin":
        return Look(scene.look)
    if not fit.spec.is_beam:
        return Look("boxes")
    beam = fit.spec.beam
    surfaces = beam_surfaces(beam)
    if not surfaces:
        return Look("boxes")
    x = stations(surfaces)
    at = snapped(beam, x)
    further = list(fit.spec.further.values())
    places = np.unique(np.concatenate([at, further]))
    counts = {port: count for port, count in fit.kept.counts.items() if count}
    parts = Parts(beam.segments, beam.joints, beam.lumps)
    modes: list[ModeMotion] = []
    for port, count in counts.items():
        full = sampled_model(parts, port, 2 * count + SHAPED, tuple(places.tolist()))
        kept = reduced_to_kept(fit.body, fit.kept, port, count, full, further).truncated(count)
        modes.append(mode_motion(fit.chain, port, kept, x, at))
    made, missed = skins(fit.chain, surfaces, modes)
    return Look("skin", tuple(made), dict(zip(counts, missed, strict=True)))
