"""Model files made exact in time for another step and integrator."""

from pathlib import Path

from lxml import etree

from beamchain.checks import one_of
from beamchain.engine.linearise import INTEGRATORS, compile_model
from beamchain.errors import InputError
from beamchain.mjcf.craft import read_craft, relocate
from beamchain.mjcf.write import number
from beamchain.steps.discrete import SCHEMES
from beamchain.steps.document import check_found, put_time
from beamchain.steps.modal import NUMBERS
from beamchain.steps.poles import PoleRow, pole_rows
from beamchain.steps.retime import retime

SAFE = 1.8  # rad per step of a spring that nothing slows; 2 is the limit without damping


def retimed_file(path: Path, timestep: float, integrator: str | None, folder: Path) -> tuple[bytes, list[PoleRow]]:
    """A model's file with its appendages made exact in time, and what its modes then show.

    Args:
        path: of an MJCF file.
        timestep: [s]; 0: the timing is taken out, and the file's own step stays.
        integrator: MuJoCo's name; the file's own where left out.
        folder: where the file will stand, for paths in it.

    Raises:
        InputError: the file has no modal tendons, or they stand in files that it attaches, or the step is unstable for
            springs of the spacecraft itself.
        EngineError: MuJoCo refuses the file.
    """
    document = relocate(read_craft(path), folder)
    model = compile_model(path)
    if integrator is not None:
        one_of("integrator", integrator, tuple(name for name in SCHEMES if name in INTEGRATORS))
        model.opt.integrator = INTEGRATORS[integrator]
    name = NUMBERS[int(model.opt.integrator)]
    if timestep > 0.0:
        model.opt.timestep = timestep
    retime(model, timestep, name, form=4)
    rows = pole_rows(model)
    grown = [row.frequency for row in rows if row.grows]
    if grown and timestep > 0.0:
        raise InputError(
            f"{name} at {timestep:g} s is unstable whatever the appendages do: the spacecraft's own springs vibrate at "
            f"{max(grown):.4g} rad/s, and only modes of appendages are slowed; take a step below {SAFE / max(grown):.2g} s, "
            "or leave those springs out."
        )
    parts = document.parts()
    check_found(put_time(parts, model), model)
    own = document.root
    option = own.find("option")
    if option is None:
        option = etree.Element("option")
        option.tail = "\n  "
        own.insert(0, option)
    if timestep > 0.0:
        option.set("timestep", number(timestep))
    if integrator is not None:
        option.set("integrator", integrator)
    if any(part is not own and part.find(".//fixed") is not None for part in parts):
        raise InputError(
            "the modal tendons stand in a file that this one includes; give that file, or one without <include>."
        )
    return document.to_bytes(), rows
