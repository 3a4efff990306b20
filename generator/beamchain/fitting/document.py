"""The written appendage: its MJCF, and its timing."""

from collections.abc import Sequence

import numpy as np
from lxml.etree import _Element as Element

from beamchain.chain.chain import Chain
from beamchain.engine.linearise import compile_model
from beamchain.fitting.options import Scene
from beamchain.fitting.spec import Spec
from beamchain.mjcf import write
from beamchain.mjcf.skin import Skin
from beamchain.mjcf.tank import tank_shapes
from beamchain.steps.integrators import SCHEMES
from beamchain.steps.limits import StepLimits
from beamchain.steps.retime import retime_by
from beamchain.steps.retime_file import put_hinge_armature, put_time


def appendage_tree(spec: Spec, chain: Chain, skins: Sequence[Skin] = ()) -> Element:
    """The drop-in file with the elements that the scene uses; `skins` in place of boxes."""
    scene = spec.scene or Scene()
    sensors = spec.sensors
    tree = write.appendage_document(
        chain,
        spec.name,
        beam=spec.beam if spec.is_beam else None,
        visuals=scene.visuals is not False,
        skins=skins,
        sites=spec.sites(chain.length),
        contacts=scene.contacts,
        readings=write.Readings(sensors.modes, sensors.points, sensors.root_load),
        shapes=None if spec.slosh is None else tank_shapes(spec.slosh, chain),
    )
    write.turn_root(write.find(tree, "worldbody/body"), spec.turn)
    return tree


def put_timing(tree: Element, spec: Spec, *, sprung: bool, form: int) -> None:
    """Make a document with the appendage exact in time for the specification's step;
    unchanged where none is stated.

    `sprung`: the modes stand on tendons; `form`: 2: for any hub, 4:
    tuned for the hub that the document has.
    """
    step = spec.exact_step
    integrator = spec.integrator
    if not step or integrator not in SCHEMES:
        return
    if sprung:
        model = compile_model(write.document_text(tree))
        retime_by(form, model, step, integrator)
        put_time(tree, model)
    elif spec.fit.springs == "hinges":
        put_hinge_armature(tree, step, integrator)


def scene_step(spec: Spec, limits: StepLimits) -> float:
    """Step of scene.xml [s]: the one stated, else one that is well below the limit of its
    integrator; with a scene 0.01 s at most."""
    safe = safe_step(limits.largest_step[spec.integrator])
    return spec.exact_step or (safe if spec.scene is None else min(spec.scene.step, safe))


def safe_step(largest: float) -> float:
    """A round step, a fifth of the largest stable one at most [s]."""
    bound = 0.2 * min(largest, 5.0)
    exponent = np.floor(np.log10(bound))
    return float(
        max(m for m in (1.0, 2.0, 5.0) if m * 10**exponent <= bound * (1 + 1e-12)) * 10**exponent
    )
