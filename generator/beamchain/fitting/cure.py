"""What mends a fit that misses its tolerance, or whose stated step ruins it."""

from collections.abc import Callable
from dataclasses import replace

from msgspec import structs

from beamchain.errors import BeamchainError
from beamchain.fitting.options import Modes, Scene
from beamchain.fitting.result import Fit
from beamchain.fitting.spec import Spec
from beamchain.ports.motions import PORTS
from beamchain.steps.cures import SHORTEST, Cure, Names, Setting, find_cure


def modes_entry(spec: Spec) -> str:
    """The modes that a specification names, as it is written there."""
    if spec.slosh is not None:
        return f"slosh.modes = {spec.slosh.modes}"
    if spec.imported is not None and spec.imported.modes is not None:
        return f"imported.modes = {list(spec.imported.modes)}"
    given = {} if spec.modes is None else spec.modes.given()
    return f"modes = {{ {', '.join(f'{port} = {count}' for port, count in given.items())} }}"


def with_modal_damping(spec: Spec) -> Spec | None:
    """The same with dampers on its modes; None where they are there."""
    if spec.damping is None or spec.damping.form != "hinge":
        return None
    return structs.replace(spec, damping=structs.replace(spec.damping, form="modal"))


FREE = "leave out the numbers of modes (the scene chooses them then)"


def with_free_modes(spec: Spec) -> Spec:
    """The same without numbers of modes that were typed."""
    spec = structs.replace(spec, modes=None)
    if spec.imported is not None:
        spec = structs.replace(spec, imported=structs.replace(spec.imported, modes=None))
    if spec.slosh is not None:
        spec = structs.replace(spec, slosh=structs.replace(spec.slosh, modes=None))
    return spec


def cure_of(made: Fit, again: Callable[[Spec], Fit]) -> Cure | None:
    """The cheapest change of its integrator, step or modes that keeps the scene's tolerance, or
    without one an error at the step below 0.1; `again` fits a specification."""
    scene = made.spec.scene
    now = Setting(made.spec.integrator, made.spec.exact_step)
    judged = scene is not None and scene.bandwidth is not None
    wished: dict[str, Spec] = {}
    modal = with_modal_damping(made.spec)
    if modal is not None:
        wished['write damping.form = "modal"'] = modal
    for spec in _one_mode_more(made):
        wished[f"keep one mode more ({modes_entry(spec)})"] = spec
    if judged and with_free_modes(made.spec) != made.spec:
        wished[FREE] = with_free_modes(made.spec)
    tried: dict[str, Fit | None] = {"": made}

    def fit_with(change: str) -> Fit | None:
        if change not in tried:
            try:
                tried[change] = again(wished[change])
            except BeamchainError:  # there is no such chain
                tried[change] = None
        return tried[change]

    def error(setting: Setting) -> float:
        one = fit_with(setting.change)
        if one is None:
            return float("inf")
        if setting.timestep == 0.0:
            if judged or not now.timestep:
                return one.in_band_error or 0.0
            # without a band no error in continuous time is judged: that of the shortest step is
            setting = setting._replace(timestep=SHORTEST * now.timestep)
        at_step = replace(one, spec=_at_step(one.spec, setting))
        return float("inf") if at_step.decisive is None else at_step.decisive

    names = Names('write scene.integrator = "{}"', "write scene.timestep = {}")
    return find_cure(now, error, wished, names, scene.tolerance if scene and judged else None)


def _one_mode_more(made: Fit) -> list[Spec]:
    """The specification with one mode more, port by port; none of imported modes that couple ports,
    of a liquid, or where no more are known."""
    if made.spec.slosh is not None or (made.space is not None and made.space.couples):
        return []
    counts = made.kept.counts
    spec = with_free_modes(made.spec)
    return [
        structs.replace(spec, modes=Modes(**{p: counts.get(p, 0) + (p == port) for p in PORTS}))
        for port, full in made.full.items()
        if counts.get(port, 0) < full.modes
    ]


def _at_step(spec: Spec, setting: Setting) -> Spec:
    """A specification with another integrator and step."""
    step = setting.timestep
    scene = structs.replace(spec.scene or Scene(), integrator=setting.integrator, timestep=step)
    return structs.replace(spec, scene=scene)
