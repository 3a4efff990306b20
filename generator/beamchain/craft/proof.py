"""`prove`: a file that `embed` wrote, and that may have been edited since, proved as it stands.

The bare spacecraft and the exact appendages follow from the marks in the file; what is proved is
the file itself, compiled.
"""

import copy
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from beamchain.checks import is_mjcf_text, path_of, true_or_false
from beamchain.craft.appendage import Appendage, motion_warnings, moved_bodies
from beamchain.craft.disturbances import check_flags
from beamchain.craft.embedded import Embedded
from beamchain.craft.embedding import marked_appendages, with_loads_told
from beamchain.craft.loads import split_port
from beamchain.craft.timing import attitude_warnings
from beamchain.engine.library import mujoco, one_thread
from beamchain.engine.linearise import compile_model
from beamchain.engine.model_diff import KINDS, NAMED
from beamchain.engine.operating_point import poses
from beamchain.errors import EngineError, InputError
from beamchain.files import noted_inputs
from beamchain.steps.modal import timing_marks
from beamchain.steps.retime import without_timing
from beamchain.warning_codes import Caution

UNMARKED = "the file does not say what its appendages are (it was not written by embed)"
BENT = 0.05  # [rad] of an elastic hinge in a keyframe, where embed writes zero
RESTORE = "restore the file from before, or embed again"


@one_thread()
def prove(path: str | Path, *, loaded: bool = False) -> Embedded:
    """Prove a file that `embed` wrote as it stands, after it was edited.

    The spacecraft (its masses, joints, drives, sites) is taken from the file, and its appendages
    are the exact ones that the marks in the file name. What the file has in their place (links,
    hinges, tendons) is compared with them as MuJoCo compiles it, at rest and at every keyframe.

    Args:
        path: of the file, or its text.
        loaded: whether to prove it under its own load, as in `embed`.

    Returns:
        What `embed` returns, for the file: `promise`, `modes_at`, `time_error`, `sampled_error`,
        `met`, `as_dict`. It has no document, and is not written.

    Raises:
        InputError: the file holds no marks, or no longer what they say.
        EngineError: MuJoCo refuses the file, or the spacecraft without its appendages.

    Example:
        >>> import tempfile
        >>> from pathlib import Path
        >>> import beamchain as bc
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/>
        ... <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> spec = bc.Spec(segment=(bc.Segment(length=8.0, section=section),))
        >>> flexible = bc.embed(craft, {"mount": spec})
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     file = Path(folder) / "flexible.xml"
        ...     paths = flexible.write(file)
        ...     proof = bc.prove(file)
        >>> abs(proof.craft_error / flexible.craft_error - 1.0) < 1e-6
        True
    """
    is_text = is_mjcf_text(path)
    wanted = "the path or the text of an MJCF (.xml) file that embed wrote"
    file = path if is_text else path_of("path", path, wanted)
    called = "the text" if is_text else str(file)
    loaded = true_or_false("loaded", loaded)
    with noted_inputs() as inputs:
        model = compile_model(file)
        marked = _read(file, called)
    if marked is None:
        raise InputError(f"{called}: {UNMARKED}; prove what embed wrote.")
    return with_loads_told(replace(proved(*marked, model), inputs=tuple(inputs), loaded=loaded))


def _read(file: str | Path, called: str) -> "tuple[mujoco.MjModel, tuple[Appendage, ...]] | None":
    """`marked_appendages`, where what was added to the file by hand does not stand alone."""
    try:
        return marked_appendages(file)
    except EngineError as error:
        reason = str(error).splitlines()[0].rstrip(".")
        raise InputError(
            f"{called}: without its appendages the spacecraft does not compile any more "
            f"({reason}): something was put in by hand that needs them, a keyframe or an actuator; "
            "take it out for the proof, or put it into the spacecraft's file and embed again."
        ) from None


def proved(
    craft: "mujoco.MjModel", appendages: Sequence[Appendage], model: "mujoco.MjModel"
) -> Embedded:
    """What `embed` would say of a compiled file, whose bare spacecraft and appendages are known by
    its marks."""
    moved = set(moved_bodies(appendages))
    roots = {f"{a.prefix}link1" for a in appendages}
    is_timed = any(mark is not None for mark in timing_marks(model))
    known: list[Appendage] = []
    for a in appendages:
        elements = _elements(model, a, moved | roots)
        rigid = not elements["jnt"] and bool(a.fit.chain.hinges)
        timed = model if is_timed else None
        known.append(replace(a, elements=elements, rigid=rigid, timed=timed))
    for a in appendages:
        _check_ports(model, a, appendages)
    result = Embedded(tuple(known), craft, model, ())
    craft = _with_poses_of(result)
    check_flags(model)
    plain = without_timing(model)
    warnings = [] if known[0].rigid else motion_warnings(plain, known, model)
    warnings += attitude_warnings(model, known)
    warnings += _bent_keyframes(model, known)
    return replace(result, craft=craft, warnings=tuple(warnings))


def _bent_keyframes(model: "mujoco.MjModel", appendages: Sequence[Appendage]) -> list[str]:
    """A sentence for each keyframe that bends an appendage, by the hinge farthest from rest."""
    found: list[str] = []
    solid = [a for a in appendages if a.spec.slosh is None]
    names = {name for a in solid if a.elements is not None for name in a.elements["jnt"]}
    hinges = [
        j
        for j in range(model.njnt)
        if model.joint(j).name in names and model.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE
    ]
    if not hinges:
        return found
    places = model.jnt_qposadr[hinges]
    for k in range(model.nkey):
        angles = model.key_qpos[k][places] - model.qpos0[places]
        worst = int(np.argmax(np.abs(angles)))
        if abs(angles[worst]) > BENT:
            text = (
                f"keyframe {model.key(k).name or k!r} holds {angles[worst]:.3g} rad for "
                f"{model.joint(hinges[worst]).name!r}, an elastic hinge, where embed writes 0; the "
                "proof is one at rest. MuJoCo fills a short qpos up at its end, so that angles of "
                f"the spacecraft's own joints land there: write all {model.nq} values, or put the "
                "keyframe into the spacecraft's file and embed again."
            )
            found.append(Caution("bent-keyframe", text))
    return found


def _elements(
    model: "mujoco.MjModel", a: Appendage, elsewhere: set[str]
) -> dict[str, frozenset[str]]:
    """Names of an appendage's elements in a compiled file, per kind; bodies `elsewhere` hang on it
    but are not its own."""
    root = f"{a.prefix}link1"
    top = _number(model, "body", root)
    if top == -1:
        raise InputError(
            f"the mark of the appendage at {a.at} names its first body {root!r}, which is gone; "
            f"{RESTORE}."
        )
    bodies = {top}
    for body in range(model.nbody):
        name = model.body(body).name
        if int(model.body_parentid[body]) not in bodies or name in elsewhere:
            continue
        if not name.startswith(a.prefix):
            raise InputError(
                f"body {name or body!r} was put on body "
                f"{model.body(int(model.body_parentid[body])).name!r} of the appendage at {a.at} "
                "by hand, where the exact appendage carries nothing; hang it on a port "
                "(embed --carry)."
            )
        bodies.add(body)
    owned = {"body": bodies}
    for kind in ("jnt", "geom", "site"):
        owner = getattr(model, f"{kind}_bodyid")
        owned[kind] = {i for i in range(len(owner)) if int(owner[i]) in bodies}
    names = {
        kind: frozenset(getattr(model, NAMED[kind])(i).name for i in ids) - {""}
        for kind, ids in owned.items()
    }
    if foreign := [name for name in names["jnt"] if not name.startswith(a.prefix)]:
        raise InputError(
            f"joint {foreign[0]!r} was put into the appendage at {a.at} by hand, where the exact "
            f"appendage has none; {RESTORE}."
        )
    for kind in ("tendon", "sensor", "mat", "tex", "skin"):
        count = int(getattr(model, KINDS[kind]))
        every = (getattr(model, NAMED[kind])(i).name for i in range(count))
        names[kind] = frozenset(name for name in every if name.startswith(a.prefix))
    return names


def _number(model: "mujoco.MjModel", kind: str, name: str) -> int:
    """Of an element by its name; -1 for none."""
    kinds = mujoco.mjtObj
    return int(mujoco.mj_name2id(model, getattr(kinds, f"mjOBJ_{kind.upper()}"), name))


def _check_ports(model: "mujoco.MjModel", a: Appendage, every: Sequence[Appendage]) -> None:
    """What an appendage's ports carry by its mark hangs on them in a compiled file."""
    hung = [(port, body) for port, bodies in a.carries.items() for body in bodies]
    places = [other.at for other in every]
    for other in every:
        on_port = split_port(other.at, places)
        if on_port is not None and on_port[0] == a.at:
            hung.append((on_port[1], f"{other.prefix}link1"))
    for port, body in hung:
        site = f"{a.prefix}{port}"
        port_site = _number(model, "site", site)
        child = _number(model, "body", body)
        if min(port_site, child) < 0 or (
            int(model.body_parentid[child]) != int(model.site_bodyid[port_site])
        ):
            raise InputError(
                f"by its mark the appendage at {a.at} carries body {body!r} on its port {port!r}, "
                f"and in the file it does not hang on the link that holds site {site!r}; {RESTORE}."
            )


def _with_poses_of(result: Embedded) -> "mujoco.MjModel":
    """The bare spacecraft with the keyframes as the file has them: a pose edited there is the pose
    that is proved."""
    craft = copy.copy(result.craft)
    model = result.model
    if list(poses(craft)) != list(poses(model)):
        names = [", ".join(poses(each)) for each in (model, craft)]
        raise InputError(
            f"the file has the poses {names[0]}, and by its marks those of the spacecraft are "
            f"{names[1]}; a keyframe was put in, taken out or renamed by hand: {RESTORE}."
        )
    for k in range(craft.nkey):
        craft.key_qpos[k] = result.bare_qpos(np.array(model.key_qpos[k]))
        craft.key_ctrl[k] = model.key_ctrl[k]
    return craft
