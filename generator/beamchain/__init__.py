"""Flexible spacecraft appendages for MuJoCo: hinge chains that push back on the hub exactly as the beam does.

MuJoCo is imported when it is first needed, so that `import beamchain` is quick.
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from beamchain.chain.chain import Chain as Chain
    from beamchain.chain.recursion import planar_chain as planar_chain
    from beamchain.chain.recursion import realise as realise
    from beamchain.chain.rivals import equal_links as equal_links
    from beamchain.chain.rivals import seed_chain as seed_chain
    from beamchain.chain.seed import seed_beam as seed_beam
    from beamchain.chain.seed import seed_table as seed_table
    from beamchain.craft.embedding import Embedded as Embedded
    from beamchain.craft.embedding import embed as embed
    from beamchain.engine.linearise import Linearisation as Linearisation
    from beamchain.engine.linearise import linearise as linearise
    from beamchain.errors import BeamchainError as BeamchainError
    from beamchain.fitting.fit import fit as fit
    from beamchain.fitting.hub import Hub as Hub
    from beamchain.fitting.options import Damping as Damping
    from beamchain.fitting.options import FitOptions as FitOptions
    from beamchain.fitting.options import Modes as Modes
    from beamchain.fitting.options import Payload as Payload
    from beamchain.fitting.options import Root as Root
    from beamchain.fitting.options import Scene as Scene
    from beamchain.fitting.result import Fit as Fit
    from beamchain.fitting.spec import Spec as Spec
    from beamchain.fitting.spec import read_spec as read_spec
    from beamchain.ports.compare import Comparison as Comparison
    from beamchain.ports.compare import compare as compare
    from beamchain.ports.model import PortModel as PortModel
    from beamchain.steps.budget import Budget as Budget
    from beamchain.steps.budget import budget as budget
    from beamchain.steps.inputs import HeldInput as HeldInput
    from beamchain.steps.large_motion import LargeMotion as LargeMotion
    from beamchain.steps.large_motion import large_motion as large_motion
    from beamchain.steps.measured_limit import measured_limit as measured_limit
    from beamchain.steps.poles import pole_rows as pole_rows
    from beamchain.steps.retime import Retimed as Retimed
    from beamchain.steps.retime import retime as retime
    from beamchain.steps.start import start_velocity as start_velocity
    from beamchain.structure.beam import Beam as Beam
    from beamchain.structure.exact import UniformBeam as UniformBeam
    from beamchain.structure.imported import Imported as Imported
    from beamchain.structure.joint import Joint as Joint
    from beamchain.structure.lump import Lump as Lump
    from beamchain.structure.material import Material as Material
    from beamchain.structure.modal_data import ModalData as ModalData
    from beamchain.structure.readers import read_modes as read_modes
    from beamchain.structure.section import Box as Box
    from beamchain.structure.section import Custom as Custom
    from beamchain.structure.section import Equivalent as Equivalent
    from beamchain.structure.section import Rectangle as Rectangle
    from beamchain.structure.section import Round as Round
    from beamchain.structure.section import Tube as Tube
    from beamchain.structure.segment import Segment as Segment
    from beamchain.studies.runs import run_stability as run_stability
    from beamchain.studies.runs import run_study as run_study
    from beamchain.studies.runs import run_sweep as run_sweep

_PLACES = {
    "steps.budget": ("Budget", "budget"),
    "ports.compare": ("Comparison", "compare"),
    "steps.large_motion": ("LargeMotion", "large_motion"),
    "steps.measured_limit": ("measured_limit",),
    "chain.chain": ("Chain",),
    "chain.recursion": ("planar_chain", "realise"),
    "chain.rivals": ("equal_links", "seed_chain"),
    "craft.embedding": ("Embedded", "embed"),
    "engine.linearise": ("Linearisation", "linearise"),
    "errors": ("BeamchainError",),
    "fitting.hub": ("Hub",),
    "ports.model": ("PortModel",),
    "studies.runs": ("run_stability", "run_study", "run_sweep"),
    "chain.seed": ("seed_beam", "seed_table"),
    "fitting.spec": ("Damping", "FitOptions", "Modes", "Payload", "Root", "Scene", "Spec", "read_spec"),
    "steps.inputs": ("HeldInput",),
    "steps.poles": ("pole_rows",),
    "steps.retime": ("Retimed", "retime"),
    "steps.start": ("start_velocity",),
    "structure.beam": ("Beam",),
    "structure.exact": ("UniformBeam",),
    "structure.imported": ("Imported",),
    "structure.joint": ("Joint",),
    "structure.lump": ("Lump",),
    "structure.material": ("Material",),
    "structure.modal_data": ("ModalData",),
    "structure.readers": ("read_modes",),
    "structure.section": ("Box", "Custom", "Equivalent", "Rectangle", "Round", "Tube"),
    "structure.segment": ("Segment",),
    "fitting.result": ("Fit",),
    "fitting.fit": ("fit",),
}
_HOME = {name: module for module, names in _PLACES.items() for name in names}

__version__ = version("beamchain")
__all__ = sorted([*_HOME, "__version__"])  # pyright: ignore[reportUnsupportedDunderAll]


if not TYPE_CHECKING:  # a type checker that sees it takes every misspelt name for one that it gives

    def __getattr__(name: str) -> Any:
        if name not in _HOME:
            raise AttributeError(f"module 'beamchain' has no attribute {name!r}; it has {', '.join(__all__)}")
        value = getattr(import_module(f"beamchain.{_HOME[name]}"), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return __all__
