"""What a fit of imported modes starts from: all modes of the file, and those that are kept and why."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from msgspec import structs

from beamchain.errors import InputError
from beamchain.fitting.choose import make_plan
from beamchain.fitting.fewest import SpacePromise, fewest
from beamchain.fitting.needs import Choice
from beamchain.fitting.options import Scene, Target
from beamchain.fitting.spec import Spec
from beamchain.ports.compare import DEFAULT_RATIO
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS, Array
from beamchain.structure.imported import with_length
from beamchain.structure.modal_data import ModalData

UNDAMPED = 1e-8  # ratio up to which a mode counts as undamped


@dataclass(frozen=True, eq=False)
class Case:
    """What a fit starts from: all modes of the file (`data`), damped, and those that are `kept`.

    `numbers`: of the kept modes in the file; `target`: "clamped", "free" or "hub"; `choice`: how the scene decided.
    """

    spec: Spec
    data: ModalData
    kept: ModalData
    numbers: tuple[int, ...]
    target: str = "clamped"
    choice: Choice | None = None

    @property
    def scene(self) -> Scene:
        """The spec's, or what is taken without one."""
        return self.spec.scene or Scene()

    @property
    def hub(self) -> Array | None:
        """`(6, 6)` about the root."""
        return None if self.spec.root.hub is None else self.spec.root.hub.mass_matrix()

    @property
    def carrier(self) -> Array:
        """`(6, 6)` the hub on which a free or hub target is exact, about the root: a free one's has no mass."""
        return np.zeros((6, 6)) if self.hub is None or self.target == "free" else self.hub

    @property
    def chooses(self) -> bool:
        """Whether the scene decides which modes are kept."""
        return self.spec.chooses and (self.spec.imported is None or self.spec.imported.modes is None)

    @cached_property
    def promise(self) -> SpacePromise | None:
        """The in-band error in space, where the scene states a bandwidth."""
        if self.scene.bandwidth is None:
            return None
        full = resolvable(self.data.space())
        return SpacePromise(full, self.hub, self.data.live, self.scene.axes, self.scene.bandwidth)

    def band(self, model: PortModel) -> float:
        """Upper end of the band [rad/s]."""
        return self.scene.bandwidth or float(model.frequencies[-1])

    def chosen(self, target: Target | None = None) -> "Case":
        """The case with the fewest modes that the scene needs; `target`: instead of the spec's."""
        if not self.chooses or self.promise is None:
            return self
        if any(len(ports) > 1 for ports in self.data.groups):
            fixed = {} if self.spec.modes is None else self.spec.modes.given()
            numbers, choice = fewest(self.promise, self.data.belongs, self.scene.tolerance, fixed, self.scene.tip)
            return self._choose(numbers, "clamped", choice)
        full = {port: self.data.port(port, own=True) for port in PORTS if port in self.data.belongs}
        root = self.spec.root if target is None else structs.replace(self.spec.root, target=target)
        plan = make_plan(structs.replace(self.spec, root=root), full, self.data.rigid_mass, self.hub)
        return self._choose(_first(self.data, plan.kept), plan.target, plan.choice)

    def _choose(self, numbers: tuple[int, ...], target: str, choice: Choice | None) -> "Case":
        kept = self.data.selected(numbers) if numbers else self.data.frozen()
        return replace(self, kept=kept, numbers=numbers, target=target, choice=choice)


def case_of(spec: Spec, data: ModalData) -> Case:
    """The case of a spec: damped as it says, and with the modes that it states, or all."""
    data = with_length(data.untangled(), None)
    if spec.damping is not None:
        ratios = np.zeros(data.modes)
        for port in PORTS:
            own = [k for k, b in enumerate(data.belongs) if b == port]
            ratios[own] = spec.damping.ratios(port, len(own))
        data = replace(data, damping=ratios)
    wanted = None if spec.imported is None else spec.imported.modes
    target = "clamped" if spec.root.target in (None, "auto") else str(spec.root.target)
    if spec.modes is not None:
        if wanted is not None:
            raise InputError(
                "[modes] and imported.modes are both given; name the modes by number (imported.modes) or count them "
                "per port ([modes])."
            )
        numbers = _first(data, spec.modes.counts())
        wanted = None if spec.chooses else numbers
    if wanted is None:
        return Case(spec, data, data, tuple(range(1, data.modes + 1)), target)
    return Case(spec, data, data.selected(wanted), tuple(sorted(wanted)), target)


def _first(data: ModalData, counts: dict[str, int]) -> tuple[int, ...]:
    """Numbers of the first modes of each port."""
    numbers: list[int] = []
    for port, count in counts.items():
        own = [k + 1 for k, b in enumerate(data.belongs) if b == port]
        if len(own) < count:
            raise InputError(
                f"modes.{port} = {count}, but only {len(own)} of the imported modes move mainly in {port}; ask for "
                "fewer, or import more modes."
            )
        numbers += own[:count]
    return tuple(sorted(numbers))


def resolvable(model: PortModel) -> PortModel:
    """The model with 0.5 % in every mode that has no damping, of which MuJoCo's differences leave rounding."""
    return model.replaced(damping=np.where(model.damping > UNDAMPED, model.damping, DEFAULT_RATIO))
