"""Flexible spacecraft appendages for MuJoCo: hinge chains with the modes of the elastic structure.

MuJoCo is imported when it is first needed, so that `import beamchain` is quick.
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from beamchain.late import importing

if TYPE_CHECKING:
    from beamchain.craft.embedded import Embedded as Embedded
    from beamchain.craft.embedding import embed as embed
    from beamchain.craft.proof import prove as prove
    from beamchain.craft.recovery import Recorder as Recorder
    from beamchain.craft.recovery import Recovery as Recovery
    from beamchain.craft.stability import StabilityStudy as StabilityStudy
    from beamchain.craft.stability import stability as stability
    from beamchain.engine.allocation import Allocation as Allocation
    from beamchain.engine.allocation import allocate as allocate
    from beamchain.engine.combinations import Alignment as Alignment
    from beamchain.engine.combinations import align as align
    from beamchain.engine.linear import Linear as Linear
    from beamchain.engine.linearise import Linearisation as Linearisation
    from beamchain.engine.linearise import linearise as linearise
    from beamchain.errors import BeamchainError as BeamchainError
    from beamchain.errors import InputError as InputError
    from beamchain.fitting.fit import fit as fit
    from beamchain.fitting.hub import Hub as Hub
    from beamchain.fitting.options import Damping as Damping
    from beamchain.fitting.options import FitOptions as FitOptions
    from beamchain.fitting.options import Modes as Modes
    from beamchain.fitting.options import Root as Root
    from beamchain.fitting.options import Scene as Scene
    from beamchain.fitting.result import Fit as Fit
    from beamchain.fitting.spec import Spec as Spec
    from beamchain.fitting.spec import read_spec as read_spec
    from beamchain.fitting.uncertain import Correlation as Correlation
    from beamchain.fitting.uncertain import UncertainBody as UncertainBody
    from beamchain.fitting.uncertain import UncertainCraft as UncertainCraft
    from beamchain.fitting.uncertain import UncertainJoint as UncertainJoint
    from beamchain.fitting.uncertain import UncertainMode as UncertainMode
    from beamchain.fitting.uncertain import UncertainModes as UncertainModes
    from beamchain.fitting.uncertain import Uncertainty as Uncertainty
    from beamchain.fleet.worlds import Worlds as Worlds
    from beamchain.fleet.worlds import worlds as worlds
    from beamchain.identification.identify import identify as identify
    from beamchain.identification.result import Identification as Identification
    from beamchain.plants.bounds import GainBound as GainBound
    from beamchain.plants.controllers import Controller as Controller
    from beamchain.plants.controllers import Filter as Filter
    from beamchain.plants.controllers import Loop as Loop
    from beamchain.plants.instability import Instability as Instability
    from beamchain.plants.jitter_sources import Disturbances as Disturbances
    from beamchain.plants.jitter_sources import NoiseDisturbance as NoiseDisturbance
    from beamchain.plants.jitter_sources import StepperDisturbance as StepperDisturbance
    from beamchain.plants.jitter_sources import ThermalSnap as ThermalSnap
    from beamchain.plants.jitter_sources import WheelDisturbance as WheelDisturbance
    from beamchain.plants.jitter_sources import WheelHarmonic as WheelHarmonic
    from beamchain.plants.margins import LoopMargins as LoopMargins
    from beamchain.plants.margins import Margins as Margins
    from beamchain.plants.plant import plant as plant
    from beamchain.plants.pointing import Pointing as Pointing
    from beamchain.plants.pointing import pointing as pointing
    from beamchain.plants.realisation import Plant as Plant
    from beamchain.plants.scheduled import ScheduledPlant as ScheduledPlant
    from beamchain.plants.uncertain_plant import UncertainPlant as UncertainPlant
    from beamchain.plants.uncertain_plant import WorstCase as WorstCase
    from beamchain.plants.uncertain_plant import WorstCases as WorstCases
    from beamchain.plants.verdicts import margins as margins
    from beamchain.plants.worst_margins import WorstMargins as WorstMargins
    from beamchain.plants.worst_margins import WorstMarginsOfPoses as WorstMarginsOfPoses
    from beamchain.ports.compare import Comparison as Comparison
    from beamchain.ports.compare import compare as compare
    from beamchain.ports.model import PortModel as PortModel
    from beamchain.steps.latch import Latched as Latched
    from beamchain.steps.latch import latch as latch
    from beamchain.steps.latch import unlatch as unlatch
    from beamchain.steps.retime import Retimed as Retimed
    from beamchain.steps.retime import retime as retime
    from beamchain.steps.start import HeldInput as HeldInput
    from beamchain.steps.start import start_velocity as start_velocity
    from beamchain.structure.beam import Beam as Beam
    from beamchain.structure.modal_data import FurtherPoint as FurtherPoint
    from beamchain.structure.modal_data import ModalData as ModalData
    from beamchain.structure.profile import section_from as section_from
    from beamchain.structure.readers import read_modes as read_modes
    from beamchain.structure.readers import read_op4 as read_op4
    from beamchain.structure.readers.superelement import InterfaceGrid as InterfaceGrid
    from beamchain.structure.recovery_rows import RecoveryRows as RecoveryRows
    from beamchain.structure.section import Box as Box
    from beamchain.structure.section import Custom as Custom
    from beamchain.structure.section import Draw as Draw
    from beamchain.structure.section import Equivalent as Equivalent
    from beamchain.structure.section import Material as Material
    from beamchain.structure.section import Rectangle as Rectangle
    from beamchain.structure.section import Round as Round
    from beamchain.structure.section import Tube as Tube
    from beamchain.structure.segment import Joint as Joint
    from beamchain.structure.segment import Lump as Lump
    from beamchain.structure.segment import Segment as Segment
    from beamchain.studies.study import Study as Study
    from beamchain.studies.study import study as study
    from beamchain.variants.sweep import Sweep as Sweep
    from beamchain.variants.sweep import sweep as sweep

_PLACES = {
    "craft.embedded": ("Embedded",),
    "craft.embedding": ("embed",),
    "craft.stability": (
        "StabilityStudy",
        "stability",
    ),
    "craft.proof": ("prove",),
    "engine.allocation": (
        "Allocation",
        "allocate",
    ),
    "engine.combinations": (
        "Alignment",
        "align",
    ),
    "craft.recovery": (
        "Recorder",
        "Recovery",
    ),
    "engine.linear": ("Linear",),
    "engine.linearise": (
        "Linearisation",
        "linearise",
    ),
    "errors": (
        "BeamchainError",
        "InputError",
    ),
    "fitting.fit": ("fit",),
    "fitting.hub": ("Hub",),
    "fitting.options": (
        "Damping",
        "FitOptions",
        "Modes",
        "Root",
        "Scene",
    ),
    "fitting.result": ("Fit",),
    "fitting.spec": (
        "Spec",
        "read_spec",
    ),
    "fitting.uncertain": (
        "Correlation",
        "UncertainBody",
        "UncertainCraft",
        "UncertainJoint",
        "UncertainMode",
        "UncertainModes",
        "Uncertainty",
    ),
    "fleet.worlds": (
        "Worlds",
        "worlds",
    ),
    "identification.identify": ("identify",),
    "identification.result": ("Identification",),
    "plants.bounds": ("GainBound",),
    "plants.controllers": (
        "Controller",
        "Filter",
        "Loop",
    ),
    "plants.instability": ("Instability",),
    "plants.margins": ("LoopMargins", "Margins"),
    "plants.jitter_sources": (
        "Disturbances",
        "NoiseDisturbance",
        "StepperDisturbance",
        "ThermalSnap",
        "WheelDisturbance",
        "WheelHarmonic",
    ),
    "plants.plant": ("plant",),
    "plants.pointing": (
        "Pointing",
        "pointing",
    ),
    "plants.realisation": ("Plant",),
    "plants.scheduled": ("ScheduledPlant",),
    "plants.uncertain_plant": (
        "UncertainPlant",
        "WorstCase",
        "WorstCases",
    ),
    "plants.verdicts": ("margins",),
    "plants.worst_margins": (
        "WorstMargins",
        "WorstMarginsOfPoses",
    ),
    "ports.compare": (
        "Comparison",
        "compare",
    ),
    "ports.model": ("PortModel",),
    "steps.latch": (
        "Latched",
        "latch",
        "unlatch",
    ),
    "steps.retime": (
        "Retimed",
        "retime",
    ),
    "steps.start": (
        "HeldInput",
        "start_velocity",
    ),
    "structure.beam": ("Beam",),
    "structure.modal_data": ("FurtherPoint", "ModalData"),
    "structure.readers": ("read_modes", "read_op4"),
    "structure.recovery_rows": ("RecoveryRows",),
    "structure.readers.superelement": ("InterfaceGrid",),
    "structure.profile": ("section_from",),
    "structure.section": (
        "Box",
        "Custom",
        "Draw",
        "Equivalent",
        "Material",
        "Rectangle",
        "Round",
        "Tube",
    ),
    "structure.segment": (
        "Joint",
        "Lump",
        "Segment",
    ),
    "studies.study": (
        "Study",
        "study",
    ),
    "variants.sweep": (
        "Sweep",
        "sweep",
    ),
}
_HOME = {name: module for module, names in _PLACES.items() for name in names}

__version__ = version("beamchain")
__all__ = sorted([*_HOME, "__version__"])  # pyright: ignore[reportUnsupportedDunderAll]


if not TYPE_CHECKING:  # a type checker that sees it takes every misspelt name for one that it gives

    def __getattr__(name: str) -> Any:
        if name not in _HOME:
            raise AttributeError(
                f"module 'beamchain' has no attribute {name!r}; it has {', '.join(__all__)}"
            )
        with importing:
            value = getattr(import_module(f"beamchain.{_HOME[name]}"), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return __all__
