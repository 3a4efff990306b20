"""A spacecraft's document: read, put together with its appendages, compiled;
its keyframes laid out anew."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import msgspec
from lxml.etree import _Element as Element

from beamchain.checks import is_mjcf_text
from beamchain.craft.appendage import PROBE, Appendage, craft_elements, moved_bodies
from beamchain.craft.loads import Carries, base_place, split_port
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import compile_model
from beamchain.errors import EngineError, InputError
from beamchain.fitting.spec import Spec, spec_from_dict
from beamchain.mjcf import insert
from beamchain.mjcf import undo_marks as undo
from beamchain.mjcf.craft import Craft, craft_from_text, read_bytes, read_craft
from beamchain.mjcf.place import Target, find_target, place_includes_with_targets
from beamchain.mjcf.relocate import relocate, spacecraft_before
from beamchain.mjcf.text import Edit
from beamchain.steps.retime_file import timed_words

FOREIGN = (".urdf", ".mjz")  # what MuJoCo reads beside MJCF


class AppendageRequest(NamedTuple):
    """An appendage that a spacecraft has or shall have: its specification, its prefix, and bodies
    of the spacecraft by port."""

    spec: Spec
    prefix: str
    carries: Carries = MappingProxyType({})


def read_bare(craft: str | Path) -> tuple[Craft, dict[str, AppendageRequest]]:
    """The bare spacecraft, and what was embedded in it by place."""
    if is_foreign(craft):
        return flattened(Path(craft)), {}
    read = craft_from_text(craft) if is_mjcf_text(craft) else read_craft(craft)
    marks = undo.appendage_marks(read)
    before = {
        mark.at: AppendageRequest(
            spec_from_dict(mark.spec, f"mark of {mark.at}"), mark.prefix, mark.carries
        )
        for mark in marks
    }
    return spacecraft_before(read), before


def is_foreign(craft: str | Path) -> bool:
    """Whether a spacecraft is no MJCF, but something else that MuJoCo makes a model of."""
    return not is_mjcf_text(craft) and str(craft).lower().endswith(FOREIGN)


def flattened(craft: Craft | Path) -> Craft:
    """One document that has an element for every body and site that MuJoCo makes of a document,
    or of a file that is no MJCF."""
    label = craft.label if isinstance(craft, Craft) else f"spacecraft {str(craft)!r}"
    try:
        if isinstance(craft, Craft):
            folder = craft.folder
            text = relocate(craft, None).text
            spec = mujoco.MjSpec.from_string(text)
        else:
            folder = craft.parent
            content = read_bytes(craft)
            if craft.suffix.lower() == ".mjz":
                spec = mujoco.MjSpec.from_zip(BytesIO(content))
            else:
                spec = mujoco.MjSpec.from_file(str(craft))
        if spec.assets:
            raise InputError(
                f"{label} holds files of its own ({', '.join(list(spec.assets)[:3])}), which a "
                "document names in a folder; unpack it and give its MJCF (.xml) file."
            )
        for kind in ("meshdir", "texturedir"):
            if os.path.isabs(place := getattr(spec.compiler, kind)):
                setattr(spec.compiler, kind, os.path.relpath(place, folder.absolute()))
        # otherwise numbers have six digits, and bodies of links that do not move are lost
        spec.compiler.savecompiled = False
        spec.compiler.fusestatic = False
        text = spec.to_xml()
    except ValueError as error:
        raise EngineError(f"MuJoCo refuses {label}: {error}") from None
    return replace(craft_from_text(text), folder=folder, label=label)


def open_places(
    original: Craft, places: Sequence[str], carries: Mapping[str, Carries]
) -> tuple[Craft, dict[str, Target]]:
    """The bare spacecraft to compile as text, its places and carried bodies written out, and the
    element of every place; `carries`: bodies by port, by place."""
    base = {at: base_place(at, places) for at in places}
    hung = [f"body:{n}" for ports in carries.values() for names in ports.values() for n in names]
    out = place_includes_with_targets(relocate(original, None), [*base.values(), *hung])
    return out, {at: find_target(out, place) for at, place in base.items()}


def with_probes(bare: Craft, targets: Mapping[str, Target]) -> Craft:
    """With an empty body at every place: a hub whose frame MuJoCo would move while it carries
    nothing stays where it is."""
    probes: dict[Element, list[str]] = {}
    for i, target in enumerate(targets.values()):
        probes.setdefault(target.body, []).append(f'<body name="{PROBE}{i}"/>')
    return bare.edit(bare.append(body, some) for body, some in probes.items())


def without_keys(craft: Craft) -> Craft:
    """Without keyframes, all included files put in place."""
    out = craft.edit(undo.replace_include(craft, include) for include in craft.includes)
    keyframes = [out.node(element) for element in out.root.iter("keyframe")]
    return out.edit(Edit(node.start, node.end, "") for node in keyframes)


def compile_document(
    original: Craft,
    appendages: Sequence[Appendage],
    layout: dict[str, Any] | None,
    change: Callable[[Craft], Craft] | None = None,
) -> "mujoco.MjModel":
    """The document with its appendages, compiled; `change` edits it before."""
    out = assemble(original, appendages, None, layout)
    return compile_model((out if change is None else change(out)).text)


def assemble(
    original: Craft,
    appendages: Sequence[Appendage],
    folder: Path | None,
    layout: dict[str, Any] | None,
) -> Craft:
    """The document with its appendages for a folder; with absolute paths where that is None."""
    at = [a.at for a in appendages]
    named = [base_place(place, at) for place in at] + [
        f"body:{name}" for name in moved_bodies(appendages)
    ]
    out = insert.place_includes_with_keys(
        place_includes_with_targets(relocate(original, folder), named)
    )
    items = [
        insert.Insertion(
            replace(find_target(out, base_place(a.at, at)), at=a.at),
            a.mount.position,
            a.mount.quaternion,
            a.element(),
            a.spec.name,
            a.prefix,
            msgspec.to_builtins(a.spec),
            a.carries,
        )
        for a in appendages
    ]
    out = insert.insert_appendages(out, items)
    for a in appendages:
        for port, bodies in a.carries.items():
            for body in bodies:
                out = insert.hang_on_port(out, a.prefix, port, body)
        if on_port := split_port(a.at, at):
            prefix = next(other.prefix for other in appendages if other.at == on_port[0])
            out = insert.hang_on_port(out, prefix, on_port[1], f"{a.prefix}link1")
    if layout is not None:
        out = insert.extend_keys(out, layout["qpos"], layout["qvel"], layout["rest"])
    timed = next((a.timed for a in appendages if a.timed is not None), None)
    if timed is not None:
        out = undo.mark_step(out, timed_words(timed))
    return out


def layout_of(
    original: Craft, appendages: Sequence[Appendage], craft: "mujoco.MjModel"
) -> dict[str, Any]:
    """Which old position and velocity every new one is: compiled without keyframes,
    compared by bodies' order."""
    model = compile_document(original, appendages, None, without_keys)
    old = craft_elements(craft, model, appendages)["jnt"]
    if len(old) != craft.njnt:
        raise EngineError(
            f"the spacecraft has {craft.njnt} joints, with appendages {len(old)} of them."
        )
    sizes = {0: (7, 6), 1: (4, 3), 2: (1, 1), 3: (1, 1)}
    qpos: list[int | None] = [None] * model.nq
    qvel: list[int | None] = [None] * model.nv
    for was, now in enumerate(old):
        for place, key, size in zip(
            (qpos, qvel),
            ("jnt_qposadr", "jnt_dofadr"),
            sizes[int(craft.jnt_type[was])],
            strict=True,
        ):
            new = int(getattr(model, key)[now])
            own = int(getattr(craft, key)[was])
            place[new : new + size] = range(own, own + size)
    return {"qpos": qpos, "qvel": qvel, "rest": [float(v) for v in model.qpos0]}
