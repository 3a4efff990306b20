"""`embed`: attach appendages to an existing spacecraft and verify the assembled model."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
from lxml import etree

from beamchain.checks import one_of
from beamchain.checks import whole_number as checked_int
from beamchain.craft.appendage import PROBE, Appendage, check_names, driven_too_far, judged, lightest, moved_by_load
from beamchain.craft.documents import compiled, layout_of, read_bare
from beamchain.craft.embedded import Embedded
from beamchain.craft.fits import Fits, fit_all
from beamchain.craft.promise import MOST_MODES
from beamchain.craft.spoilers import check_flags
from beamchain.craft.timing import on_tendons, timed, turned, worth_it
from beamchain.engine import mount as mounting
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import compile_model
from beamchain.errors import EngineError, InputError
from beamchain.fitting.fit import as_spec
from beamchain.fitting.result import Fit
from beamchain.fitting.spec import Spec
from beamchain.mjcf import compatibility, insert, write
from beamchain.mjcf.craft import Craft, relocate
from beamchain.mjcf.place import find_target, split
from beamchain.structure.beam import Beam
from beamchain.structure.imported import with_length
from beamchain.structure.modal_data import ModalData


def embed(
    craft: "str | Path | mujoco.MjSpec",
    at: Mapping[str, Spec | Beam | ModalData | Fit | str | Path],
    *,
    form: str = "inline",
    prefixes: Sequence[str] | None = None,
    retime: bool | None = None,
    max_modes: int = MOST_MODES,
    rigid: bool = False,
) -> Embedded:
    """Attach appendages to a spacecraft and verify the assembled model.

    Appendages of an earlier run are kept, except that those at a place named in `at` are replaced.

    Args:
        craft: path or text of an MJCF file, or an `MjSpec`, which is then changed in place.
        at: the appendage for each named site or body of the spacecraft (x axis of its frame outwards): a spec, the
            path of a SPEC.toml, a beam, imported modes, or a fit. A fit is used as it is if its hub is that of the
            spacecraft, and otherwise repeated. If a site and a body share a name, write `site:NAME` or `body:NAME`.
            Imported modes without a file are not available when the written file is given to `embed` again.
        form: "inline": one self-contained file; "attach": separate appendage files beside it, included by `<attach>`.
        prefixes: one per entry of `at`; default: `NAME_` of the appendage, or `NAME_PLACE_` if two would have the
            same.
        retime: whether to make the appendages exact in time for the spacecraft's own step and integrator; default:
            only if the step's error would exceed a tenth of the scenes' tolerance (1e-4 without one).
        max_modes: largest number of modes per appendage if modes are added to meet the scenes' tolerance.
        rigid: make the rigid twin: the same bodies, sites, masses and keyframes, without joints and tendons.

    Raises:
        InputError: a place does not exist, is static or has no orthonormal frame, names clash, or a setting of the
            spacecraft would change the appendage.
        EngineError: MuJoCo refuses the spacecraft.
        RealisationError: no chain exists.

    Example:
        >>> import beamchain as bc
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/><inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> spec = bc.Spec(segment=(bc.Segment(length=8.0, section=section),))
        >>> flexible = bc.embed(craft, {"mount": spec})
        >>> [(one.at, one.prefix) for one in flexible.appendages]
        [('mount', 'appendage_')]
    """
    one_of("form", form, insert.FORMS)
    if not isinstance(at, Mapping):
        raise InputError(
            f'at = {at!r:.60} is a {type(at).__name__}; give appendages by place: {{"mount": "array.toml"}}.'
        )
    if not at:
        raise InputError("nothing to embed: give at least one place and spec, --at NAME=SPEC.toml.")
    given = list(prefixes or [])
    if given and len(given) != len(at):
        raise InputError(
            f"{len(given)} prefixes are given for {len(at)} appendages; give one --prefix per --at, or none."
        )
    wanted: dict[str, tuple[Spec, str]] = {}
    ready: dict[str, Fit] = {}
    held: dict[str, ModalData] = {}
    most = checked_int("max_modes", max_modes, 0, 1000)
    for i, (name, one) in enumerate(at.items()):
        made = one if isinstance(one, Fit) else None
        data = made.space.data if made is not None and made.space is not None else one
        if isinstance(data, ModalData):
            held[name] = with_length(data, None)
        spec = one.spec if isinstance(one, Fit) else as_spec(one)
        prefix = given[i] if given else ""
        if given:
            insert.check_prefix(prefix)
        if spec.imported is not None:  # the mark in the file must find the modes from anywhere
            spec = msgspec.structs.replace(spec, imported=spec.imported.beside(Path.cwd()))
        if made is not None:
            ready[name] = made if made.spec == spec else replace(made, spec=spec)
        wanted[name] = (spec, prefix)
    fits = Fits(ready, held)
    if isinstance(craft, mujoco.MjSpec):
        return _embed_in_spec(craft, _prefixed({}, wanted), retime, most, fits, rigid)
    original, before, _ = read_bare(craft)
    return _embed_in_document(original, _prefixed(before, wanted), form, retime, most, fits, rigid)


def _prefixed(before: dict[str, tuple[Spec, str]], wanted: dict[str, tuple[Spec, str]]) -> dict[str, tuple[Spec, str]]:
    """All appendages with their prefixes: the name of each, with that of its place where two would have the same.

    An appendage that replaces one of the same name at the same place keeps its prefix.
    """
    out = {at: entry for at, entry in before.items() if at not in wanted} | wanted
    names = [spec.name for spec, _ in wanted.values()]
    taken = [prefix for _, prefix in out.values()]
    for at, (spec, prefix) in wanted.items():
        if not prefix and at in before and before[at][0].name == spec.name:
            out[at] = spec, before[at][1]  # names that other parts of the user's file may refer to
        elif not prefix:
            alone = names.count(spec.name) == 1 and f"{spec.name}_" not in taken
            place = re.sub(r"[^A-Za-z0-9_.-]", "_", split(at)[1])
            own = f"{spec.name}_" if alone else f"{spec.name}_{place}_"
            insert.check_prefix(own)
            out[at] = spec, own
    return out


def take_out(craft: str | Path, at: Sequence[str] = ()) -> "Craft | Embedded":
    """The original document that `embed` was given, or its result without the appendages `at` some places.

    `craft`: path or text of a file that `embed` wrote.
    """
    original, before, form = read_bare(craft)
    missing = [name for name in at if name not in before]
    if not before or missing:
        place = f"at {missing[0]!r} " if missing else ""
        raise InputError(
            f"{original.label} holds no appendage {place}that embed put in; it has: {', '.join(before) or 'none'}."
        )
    left = {name: entry for name, entry in before.items() if at and name not in at}
    return _embed_in_document(original, left, form) if left else original


# -- into a document -------------------------------------------------------------------------------------------------
def _embed_in_document(
    original: Craft, wanted: dict[str, tuple[Spec, str]], form: str, retime: bool | None = None,
    most: int = MOST_MODES, fits: "Fits | None" = None, rigid: bool = False,
) -> Embedded:  # fmt: skip
    # an empty body at every place: a hub whose frame MuJoCo would move while it carries nothing stays where it is
    probe = relocate(original, None)
    targets = {name: find_target(probe, name) for name in wanted}
    for i, target in enumerate(targets.values()):
        etree.SubElement(target.body, "body", name=f"{PROBE}{i}")
    craft = compile_model(probe.to_bytes().decode("utf-8"))
    mounts = {name: mounting.mount(craft, name, t.kind, t.name) for name, t in targets.items()}
    appendages, warnings, steps = fit_all(craft, mounts, wanted, most, fits or Fits(), rigid)
    warnings += moved_by_load(compile_model(relocate(original, None).to_bytes().decode("utf-8")), craft)
    check_flags(craft)
    check_names(craft, appendages)
    compatibility.check_compiler(original.parts(), *lightest(appendages))
    layout = layout_of(original, appendages, craft, form)
    appendages, model, said = _proved(
        craft, appendages, lambda made: compiled(original, made, form, layout), retime,
        compatibility.hostile(original.parts()),
    )  # fmt: skip
    return Embedded(appendages, craft, model, (*warnings, *said), original, form, steps, layout)


# -- into an MjSpec --------------------------------------------------------------------------------------------------
def _embed_in_spec(
    spec: "mujoco.MjSpec", wanted: dict[str, tuple[Spec, str]], retime: bool | None, most: int, fits: Fits, rigid: bool
) -> Embedded:
    places: dict[str, tuple[str, str]] = {}
    probe = spec.copy()
    for at in wanted:
        kinds, name = split(at)
        found = [kind for kind in kinds if getattr(spec, kind)(name) is not None]
        if len(found) != 1:
            known = ", ".join(s.name for s in [*spec.sites, *spec.bodies] if s.name)
            raise InputError(
                f"--at {at}: the spacecraft has {'both a site and a' if found else 'no site or'} body "
                f"{name!r}; write site:{name} or body:{name}, or choose from: {known}."
            )
        places[at] = found[0], name
        _owner(probe, *places[at]).add_body(name=f"{PROBE}{len(places)}")
    try:
        plain, craft = spec.copy().compile(), probe.compile()
    except ValueError as error:
        raise EngineError(f"MuJoCo refuses the spacecraft: {error}") from None
    mounts = {at: mounting.mount(craft, at, kind, name) for at, (kind, name) in places.items()}
    appendages, warnings, steps = fit_all(craft, mounts, wanted, most, fits, rigid)
    warnings += moved_by_load(plain, craft)
    check_flags(craft)
    check_names(craft, appendages)

    def attached(place: "mujoco.MjSpec", made: Sequence[Appendage]) -> "mujoco.MjSpec":
        for a in made:
            frame = _owner(place, *places[a.at]).add_frame(pos=a.mount.position, quat=a.mount.quaternion)
            text = write.text(insert.renamed(a.element(), a.spec.name, ""))
            place.attach(mujoco.MjSpec.from_string(text), frame=frame, prefix=a.prefix)
        return place

    appendages, _, said = _proved(craft, appendages, lambda made: attached(spec.copy(), made).compile(), retime)
    attached(spec, appendages)  # the user's spec is touched only after a copy has proved itself
    return Embedded(appendages, craft, spec.copy().compile(), (*warnings, *said), steps=steps)


# -- both ------------------------------------------------------------------------------------------------------------
def _proved(
    craft: "mujoco.MjModel",
    appendages: tuple[Appendage, ...],
    build: "Callable[[tuple[Appendage, ...]], mujoco.MjModel]",
    retime: bool | None,
    found: Mapping[str, Mapping[str, int]] | None = None,
) -> "tuple[tuple[Appendage, ...], mujoco.MjModel, list[str]]":
    """The appendages exact in time where that is worth it, the model with them, and what is to be said of it.

    `build` compiles the spacecraft with appendages; `found`: what in its document would spoil them.
    """
    model = build(appendages)
    if any(a.rigid for a in appendages):
        return appendages, model, []
    good, why = worth_it(model, appendages, retime)
    if good:
        appendages = tuple(replace(a, fit=on_tendons(a.fit)) for a in appendages)
        check_names(craft, appendages)
        model = build(appendages)
    final, slowed = timed(model) if good else (model, [])
    warnings = [*([why] if why else []), *slowed, *judged(craft, model, appendages, final, found)]
    warnings += driven_too_far(model, appendages) + turned(model, appendages)
    if good:
        appendages = tuple(replace(a, timed=final) for a in appendages)
    return appendages, final, warnings


def _owner(spec: "mujoco.MjSpec", kind: str, name: str) -> Any:
    """The body that a site or body means."""
    return spec.body(name) if kind == "body" else spec.site(name).parent
