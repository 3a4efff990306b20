"""Flexible spacecraft appendages for MuJoCo: hinge chains with the modes of the elastic structure.

Say what an appendage is:
    Beam, Segment, Joint, Lump: a beam, its pieces, its hinge lines and what it carries
    Tube, Round, Box, Rectangle, Custom, Equivalent, Material: what a segment is made of
    ModalData, read_modes: the modes that a finite-element program delivered
    Spec, read_spec: either with everything that is asked of it, and its TOML file
    Hub, Modes, Scene, Damping: the parts of a Spec that most users state

Make its chain and put it on a spacecraft:
    fit, Fit: the chain, its proof through MuJoCo's A and B, its file
    embed, Embedded: a spacecraft with its appendages, and how far it is from the exact one
    prove: the same of a file that was written before
    retime, HeldInput, start_velocity: exact in time at a step, the input and the start for it
    latch, unlatch: a hinge that reaches its angle, and lets go
    stability: step limits, and spin and load limits
    study, sweep: error against run time; uncertain appendages as arrays for one model

Linear models:
    linearise: A and B of a compiled model, by `mjd_transitionFD`
    Linear: M, D and K of a model in a pose, with named inputs and outputs
    plant, Plant: a `control.StateSpace` of a spacecraft, in modal form
    allocate, align: torque shared out over actuators; a sensor in the axes of a body
    margins: of every loop of a controller, with dead times
    PortModel, compare: what a structure does to its root, and how far two are apart

Errors are BeamchainError; wrong input is InputError, which says what is allowed. Every table of a
Spec stands in `spec`, what functions return in `results`. Beside these stand the packages `robust`,
`pointing`, `identification` and `worlds`.

The names are listed in `__init__.pyi`. Each is imported when it is first asked for, MuJoCo with it.
"""

from typing import Any

from beamchain.import_lock import attach

_find, __dir__, __all__ = attach(__name__, __file__)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version  # takes longer to import than all the rest

        return version("beamchain")
    return _find(name)
