"""Names that earlier versions took and this one does not,
each with the sentence that says what to do instead."""

import functools
from collections.abc import Callable, Sequence
from typing import ParamSpec, TypeVar

from beamchain.errors import InputError

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")

CLUSTER = (
    "--workers (in Python workers=) starts processes on this machine, and "
    "joblib.parallel_config(backend=...) sends the jobs of bc.study and bc.sweep to a Dask or Ray "
    "cluster."
)
RESUME = "start the run again, with more --workers (in Python workers=) where it takes long."
WORLDS = (
    "the environment is one satellite on one thread; bc.worlds(..., host=, threads=) steps "
    "thousands at once."
)
COUPLED = (
    "take form=4: it places the poles of the whole craft with the tendons that the appendage has."
)
DELAY = "the delay between torque and motion is estimated, and stated with its interval."
BOUND = (
    "worst_case(..., bound=True) proves an upper bound, whose steps and largest gain are in "
    "`bound`; gain is the worst that a search found, simulated the same in a run of MuJoCo."
)

#: what was dropped: "COMMAND", "COMMAND --option", "function(argument)", "Struct(field)" for the
#: field of a struct and the key of its TOML table, "Result.attribute", or a kind of file,
#: ".ending of what"
DROPPED = {
    "seed": "seed is gone: notebooks/01_seed_paper.ipynb recomputes the paper's example, number by "
    "number.",
    "examples": "examples is gone: run `beamchain init --list`, then `beamchain init NAME` and "
    "`beamchain fit NAME.toml -o DIR`.",
    "identify --plan": (
        "--plan is gone: identify a log that was simulated with the prior, as "
        "docs/identification.md does; its intervals are what the test would give."
    ),
    "identify --offset": f"--offset is gone: {DELAY}",
    "identify --estimate-hub": (
        "--estimate-hub is gone: give the spacecraft's inertia in the file of --craft, and what "
        "the log adds to it is the appendage's."
    ),
    "identify(offset)": f"offset is gone: {DELAY}",
    "identify(hub)": (
        "hub is gone: give the spacecraft's inertia in craft, and what the log adds to it is the "
        "appendage's."
    ),
    "retime(form=3)": f"form 3 is gone: {COUPLED}",
    "tendons of form 3": (
        "made exact in time by form 3 of an earlier version, which is gone: compile the model's "
        "own file again, and retime it with form=4."
    ),
    "study --dask": f"--dask is gone: {CLUSTER}",
    "study --resume": f"--resume is gone: {RESUME}",
    "study(executor)": f"executor is gone: {CLUSTER}",
    "study(folder)": f"folder is gone: {RESUME}",
    "study(resume)": f"resume is gone: {RESUME}",
    "sweep --dask": f"--dask is gone: {CLUSTER}",
    "sweep --resume": f"--resume is gone: {RESUME}",
    "sweep(executor)": f"executor is gone: {CLUSTER}",
    "sweep(folder)": f"folder is gone: {RESUME}",
    "sweep(resume)": f"resume is gone: {RESUME}",
    "Fit.error": "error is gone: readback_error has, per port, how far the values read back from "
    "MuJoCo are from their target, and in_band_error is the model's error.",
    "WorstCase.stability": f"stability is gone: {BOUND}",
    "WorstCase.upper": f"upper is gone: {BOUND}",
    "WorstCase.gap": f"gap is gone: {BOUND}",
    "FlexibleSatellite-v0(host)": f"host is gone: {WORLDS}",
    "FlexibleSatellite-v0(threads)": f"threads is gone: {WORLDS}",
    "FitOptions(method)": (
        "method is gone: leave it out, since every fit is the exact chain; `beamchain study` "
        "compares it with equal links and the 2008 paper's chain."
    ),
    "FitOptions(links)": (
        "links is gone: the kept modes determine the links; give cuts where hinges have to stand."
    ),
    "FitOptions(free)": (
        "free is gone: leave it out, since the exact chain needs no least squares."
    ),
    ".uff of a log": "universal files are no longer read; give frequency responses as CSV, .npz or "
    "a mapping of arrays.",
    ".unv of a log": "universal files are no longer read; give frequency responses as CSV, .npz or "
    "a mapping of arrays.",
    ".mat of a log": (
        ".mat is no longer read here; give CSV, .npz, or in Python the mapping that "
        "scipy.io.loadmat returns."
    ),
    ".parquet of a log": (
        "Parquet is no longer read here; give CSV, .npz, or in Python a mapping of arrays, such as "
        "pyarrow's to_pydict()."
    ),
    "matrices of a modes file": (
        "Matrix Market is no longer read: save the arrays, which scipy.io.mmread returns, as M, K "
        "and boundary (from 0) in an .npz, and name that in [imported]."
    ),
    "table of frequencies": (
        "frequencies alone are no longer taken: write them with the participation and the mass of "
        "the appendage as a file of modes, and give it to [imported]."
    ),
}


def check(name: str, place: str = "") -> None:
    """Refuse what was dropped.

    Args:
        name: as in `DROPPED`.
        place: how the sentence begins, for example the file's name.

    Raises:
        InputError: it was dropped; the sentence names the replacement.
    """
    sentence = DROPPED.get(name)
    if sentence is not None:
        raise InputError(f"{place}{': ' if place else ''}{sentence}")


def check_words(words: Sequence[str]) -> None:
    """Refuse a command line with a command or an option that was dropped.

    Args:
        words: what stands behind `beamchain`.

    Raises:
        InputError: as of `check`.
    """
    command = next((word for word in words if not word.startswith("-")), "")
    check(command)
    for word in words:
        if word == "--":
            break
        check(f"{command} {word.partition('=')[0]}")


def missing_attribute(owner: str, name: str) -> AttributeError:
    """The error of an attribute that a result does not have, with the sentence on one that
    earlier versions had."""
    return AttributeError(DROPPED.get(f"{owner}.{name}") or f"a {owner} has no attribute {name!r}")


def answers_dropped(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """The function, which answers arguments that it took in earlier versions with
    the sentence on them."""

    @functools.wraps(function)
    def call(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        for name in kwargs:
            check(f"{function.__name__}({name})")
        return function(*args, **kwargs)

    return call
