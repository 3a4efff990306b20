"""`embed`: attach appendages to an existing spacecraft and verify the assembled model."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from beamchain.checks import is_mjcf_text, of_type, true_or_false
from beamchain.checks import whole_number as checked_int
from beamchain.craft.appendage import (
    PROBE,
    Appendage,
    carried,
    check_appendages_unchanged,
    check_craft_unchanged,
    check_names,
    driven_too_far,
    lightest,
    motion_warnings,
    moved_by_load,
)
from beamchain.craft.disturbances import check_flags
from beamchain.craft.documents import (
    AppendageRequest,
    compile_document,
    flattened,
    is_foreign,
    layout_of,
    open_places,
    read_bare,
    with_probes,
)
from beamchain.craft.embedded import OF_MOTION, Embedded
from beamchain.craft.error import PlacedBody, counterpart, loadings_of
from beamchain.craft.fits import Fits, fit_all
from beamchain.craft.liquid import liquid_cautions
from beamchain.craft.loads import (
    base_place,
    carries_of,
    check_carries,
    checked_carry,
    port_x,
    split_port,
)
from beamchain.craft.promise import MOST_MODES, joint_request
from beamchain.craft.timing import (
    SHARE,
    UNASKED,
    attitude_warnings,
    craft_time_error,
    decide_timing,
    fit_on_tendons,
    is_worth_timing,
    time_notes,
    with_timing,
)
from beamchain.engine import mount as mounting
from beamchain.engine.library import mujoco, one_thread
from beamchain.engine.linearise import compile_model
from beamchain.engine.loaded import Loading, offset_cautions
from beamchain.engine.model_checks import check_model
from beamchain.engine.operating_point import poses
from beamchain.errors import EngineError, InputError
from beamchain.files import noted_inputs
from beamchain.fitting.fit import as_spec
from beamchain.fitting.result import Fit, with_known
from beamchain.fitting.spec import Spec
from beamchain.mjcf import compatibility, insert, write
from beamchain.mjcf.craft import Craft
from beamchain.mjcf.place import is_written_out, kinds_and_name
from beamchain.mjcf.relocate import relocate
from beamchain.structure.beam import Beam
from beamchain.structure.modal_data import ModalData
from beamchain.structure.readers.imported import with_length
from beamchain.warning_codes import Caution


@one_thread()
def embed(
    craft: "str | Path | mujoco.MjSpec",
    mounts: Mapping[str, Spec | Beam | ModalData | Fit | str | Path],
    *,
    retime: bool | None = None,
    max_modes: int = MOST_MODES,
    rigid: bool = False,
    carry: Mapping[str, str | Sequence[str]] | None = None,
    loaded: bool = False,
) -> Embedded:
    """Attach appendages to a spacecraft and verify the assembled model.

    Appendages of an earlier run are kept, except that those at a place in `mounts` are replaced.

    Args:
        craft: path or text of an MJCF file, or an `MjSpec`, which is then changed in place.
        mounts: the appendage for each named site or body of the spacecraft (x axis of its frame
            outwards): a spec, the path of a SPEC.toml, a beam, imported modes, or a fit. A fit is
            used as it is if its hub is that of the spacecraft, and otherwise repeated. If a site
            and a body share a name, write `site:NAME` or `body:NAME`; `PLACE:PORT` is the port
            `PORT` of the appendage at another `PLACE`. Elements are named `NAME_...` after the
            specification, or `NAME_PLACE_...` if two would have the same, `PLACE_...` where that
            begins with `NAME`. Imported modes without a file are not available when the written
            file is given to `embed` again.
        retime: whether to make the appendages exact in time for the spacecraft's own step and
            integrator; default: only if the step's error would exceed a tenth of the scenes'
            tolerance (1e-4 without one), and timing lowers `sampled_error` by a third or to within
            the tolerance.
        max_modes: largest number of modes per appendage if modes are added to meet the
            scenes' tolerance.
        rigid: make the rigid twin: the same bodies, sites, masses and keyframes,
            without joints and tendons.
        carry: bodies of the spacecraft that hang on ports, by `PLACE:PORT`. In the spacecraft's
            file each is a child of the body that holds the place, where it is at rest; default:
            what the [[port]] of the specification names.
        loaded: whether to prove the spacecraft under its own load: the gravity of its `<option>`,
            where its base is held or stands on joints, and the `ctrl` of each keyframe, such as a
            constant thrust that accelerates a free base. The appendages sag and are stiffened by
            it; what holds the pose of the joints is taken as in balance. Modes are chosen, and the
            error at the step is stated, without it.

    Raises:
        InputError: a place does not exist, is static or has no orthonormal frame, names clash, or a
            setting of the spacecraft would change the appendage; `loaded`, and nothing acts.
        EngineError: MuJoCo refuses the spacecraft.
        RealisationError: no chain exists.

    Example:
        >>> import beamchain as bc
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/>
        ... <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> spec = bc.Spec(segment=(bc.Segment(length=8.0, section=section),))
        >>> flexible = bc.embed(craft, {"mount": spec})
        >>> [(one.at, one.prefix) for one in flexible.appendages]
        [('mount', 'appendage_')]
    """
    loaded = true_or_false("loaded", loaded)
    with noted_inputs() as inputs:
        result = _embed(craft, mounts, retime, max_modes, rigid, carry)
    is_file = (
        isinstance(craft, str | Path) and result.document is not None and not is_mjcf_text(craft)
    )
    source = Path(str(craft)) if is_file else None
    call = None
    if not isinstance(craft, mujoco.MjSpec):
        call = partial(
            embed,
            craft,
            retime=retime,
            max_modes=max_modes,
            carry=carry,
            loaded=loaded,
        )
    result = with_known(
        result,
        () if loaded else OF_MOTION,  # under a load the exact craft is another
        source=source,
        inputs=tuple(inputs),
        loaded=loaded,
        call=call,
        given=mounts,
        retime=retime,
        most=max_modes,
    )
    return with_loads_told(result)


def with_loads_told(result: Embedded) -> Embedded:
    """With warnings of what its loads do, or of what their absence does; refused is a load under
    which the exact spacecraft is not known."""
    items = carried(None, result.appendages)
    loadings = loadings_of(result.craft, items) if result.loaded else None
    said = result.warnings
    if loadings is not None and all(loading.free is None for loading in loadings.values()):
        said = [w for w in said if not (isinstance(w, Caution) and w.code == "gravity")]
    told = (*said, *_load_warnings(result, items, loadings))
    return with_known(result, OF_MOTION, warnings=told)


def _load_warnings(
    result: Embedded,
    items: Sequence[PlacedBody],
    loadings: Mapping[tuple[str, int], Loading] | None,
) -> list[str]:
    if any(a.rigid for a in result.appendages):
        return []
    found = liquid_cautions(result.craft, items, loadings)
    if loadings is None:
        found += _left_out_cautions(result, items)
        return found
    places = poses(result.model)
    for name, body in loadings:
        key = None if name == "rest" else list(places).index(name) - 1
        base = counterpart(result.craft, result.model, body)
        found += offset_cautions(result.model, key, base, places[name], name)
    return found


def _left_out_cautions(result: Embedded, items: Sequence[PlacedBody]) -> list[str]:
    """Keyframes whose load, which the proof is without, changes the motion by more than the
    tolerance."""
    out: list[str] = []
    for name, (words, change) in result.loads_left_out.items():
        if change <= (result.tolerance or UNASKED / SHARE):
            continue
        cure = "prove it under the load: --loaded (loaded=True)"
        try:
            loadings_of(result.craft, items)
        except InputError as error:
            cure = str(error).rstrip(".")
        differs = "finds no rest"
        if math.isfinite(change):
            differs = f"moves otherwise by up to {100.0 * change:.2g} % in its band"
        text = f"keyframe {name} was judged without its load; {words} the file {differs}; {cure}."
        out.append(Caution("load-left-out", text))
    return out


def _embed(
    craft: "str | Path | mujoco.MjSpec",
    mounts: Mapping[str, Spec | Beam | ModalData | Fit | str | Path],
    retime: bool | None,
    max_modes: int,
    rigid: bool,
    carry: Mapping[str, str | Sequence[str]] | None,
) -> Embedded:
    """Do the work of `embed`."""
    hung = checked_carry(carry)
    check_places(mounts)
    rigid = true_or_false("rigid", rigid)
    retime = None if retime is None else true_or_false("retime", retime)
    if not mounts:
        raise InputError(
            "nothing to embed: give at least one place and spec, --mount NAME=SPEC.toml."
        )
    wanted: dict[str, AppendageRequest] = {}
    ready: dict[str, Fit] = {}
    held: dict[str, ModalData] = {}
    most = checked_int("max_modes", max_modes, 0, 1000)
    for name, one in mounts.items():
        made = one if isinstance(one, Fit) else None
        data = made.space.data if made is not None and made.space is not None else one
        if isinstance(data, ModalData):
            held[name] = with_length(data, None)
        spec = one.spec if isinstance(one, Fit) else as_spec(one)
        if spec.imported is not None:  # the mark in the file must find the modes from anywhere
            spec = msgspec.structs.replace(spec, imported=spec.imported.beside(Path.cwd()))
        if made is not None:
            ready[name] = made if made.spec == spec else replace(made, spec=spec)
        wanted[name] = AppendageRequest(spec, "", carries_of(name, spec, hung))
    for key in hung:
        if key.rpartition(":")[0] not in wanted:
            raise InputError(
                f"carry {key!r}: no appendage is put at {key.rpartition(':')[0]!r}; give one of "
                f"{', '.join(wanted)}."
            )
    carries = any(wish.carries or split_port(at, wanted) for at, wish in wanted.items())
    if carries and isinstance(craft, mujoco.MjSpec):
        raise InputError(
            "an MjSpec holds no bodies on ports; give the path of the spacecraft's file."
        )
    fits = Fits(ready, held)
    if isinstance(craft, mujoco.MjSpec):
        return _embed_in_spec(craft, _assign_prefixes({}, wanted), retime, most, fits, rigid)
    original, before = read_bare(craft)
    wanted = _assign_prefixes(before, wanted)
    flat = is_foreign(craft)
    hanging = [
        name for wish in wanted.values() for names in wish.carries.values() for name in names
    ]
    places = [*(base_place(at, wanted) for at in wanted), *(f"body:{name}" for name in hanging)]
    if not all(is_written_out(original, place) for place in places):
        original, flat = flattened(original), True
    made = _embed_in_document(original, wanted, retime, most, fits, rigid)
    if not flat:
        return made
    note = Caution(
        "written-out",
        "the spacecraft was written out by MuJoCo, since its file has no element of its own for "
        "every place: without its comments, with all its numbers.",
    )
    return replace(made, warnings=(*made.warnings, note))


def check_places(mounts: object) -> None:
    """Appendages by place, as `embed` takes them."""
    of_type("mounts", mounts, Mapping, 'appendages by place: {"mount": "array.toml"}')
    assert isinstance(mounts, Mapping)
    for name in mounts:
        of_type("a place in mounts", name, str, "the name of a site or body of the spacecraft")


def _assign_prefixes(
    before: dict[str, AppendageRequest], wanted: dict[str, AppendageRequest]
) -> dict[str, AppendageRequest]:
    """All appendages with their prefixes: the name of each,
    with that of its place where two would have the same, which stands alone if it begins so, and
    with a number where that is taken too.

    An appendage that replaces one of the same name at the same place keeps its prefix.
    """
    out = {at: entry for at, entry in before.items() if at not in wanted} | wanted
    names = [wish.spec.name for wish in wanted.values()]
    taken = [wish.prefix for wish in out.values()]
    for at, wish in wanted.items():
        spec = wish.spec
        if at in before and before[at].spec.name == spec.name:
            # names that other parts of the user's file may refer to
            out[at] = wish._replace(prefix=before[at].prefix)
        else:
            place = re.sub(r"[^A-Za-z0-9_.-]", "_", kinds_and_name(at)[1])
            whole = f"{spec.name}_{place}_"
            choices = [
                *([f"{spec.name}_"] if names.count(spec.name) == 1 else []),
                *([f"{place}_"] if place.startswith(spec.name) else []),
                whole,
                *(f"{whole}{k}_" for k in range(2, len(out) + 2)),
            ]
            own = next(word for word in choices if word not in taken)
            taken.append(own)
            out[at] = wish._replace(prefix=own)
    return out


@one_thread()
def take_out(craft: str | Path, at: Sequence[str] = ()) -> "Craft | Embedded":
    """The original document that `embed` was given,
    or its result without the appendages `at` some places.

    `craft`: path or text of a file that `embed` wrote.
    """
    original, before = read_bare(craft)
    missing = [name for name in at if name not in before]
    if not before or missing:
        place = f"at {missing[0]!r} " if missing else ""
        raise InputError(
            f"{original.label} holds no appendage {place}that embed put in; it has: "
            f"{', '.join(before) or 'none'}."
        )
    left = {name: entry for name, entry in before.items() if at and name not in at}
    return _embed_in_document(original, left) if left else original


# -- into a document -------------------------------------------------------------------------------
def marked_appendages(
    path: str | Path,
) -> "tuple[mujoco.MjModel, tuple[Appendage, ...]] | None":
    """The bare spacecraft of a file that `embed` wrote, or of its text, compiled,
    and its appendages by their marks; None without marks.

    Raises:
        BeamchainError: modes that were imported are no longer where the marks say.
    """
    original, marked = read_bare(path)
    return _fit_on_craft(original, marked, MOST_MODES, Fits(), rigid=False)[:2] if marked else None


class EmbeddedFile(NamedTuple):
    """What a file that `embed` wrote consists of: the bare spacecraft, its document and compiled,
    what was asked for by place, and the appendages."""

    original: Craft
    craft: "mujoco.MjModel"
    wanted: dict[str, AppendageRequest]
    appendages: tuple[Appendage, ...]

    def compiled(self) -> "mujoco.MjModel":
        """The spacecraft with the appendages, without timing."""
        layout = layout_of(self.original, self.appendages, self.craft)
        return compile_document(self.original, self.appendages, layout)

    def with_specs(self, specs: Mapping[str, Spec]) -> "EmbeddedFile":
        """The same spacecraft with appendages of other specifications, by place."""
        wanted = {at: wish._replace(spec=specs[at]) for at, wish in self.wanted.items()}
        craft, appendages, *_ = _fit_on_craft(
            self.original, wanted, MOST_MODES, Fits(), rigid=False
        )
        return self._replace(craft=craft, wanted=wanted, appendages=appendages)

    def as_rigid(self) -> "EmbeddedFile":
        """The rigid twin: the same bodies without the appendages' joints and tendons."""
        return self._replace(appendages=tuple(replace(a, rigid=True) for a in self.appendages))


def marked_craft(original: Craft, wanted: dict[str, AppendageRequest]) -> EmbeddedFile:
    """A file that `embed` wrote, as `read_bare` takes it apart, with its appendages.

    Raises:
        BeamchainError: modes that were imported are no longer where the marks say.
    """
    craft, appendages, *_ = _fit_on_craft(original, wanted, MOST_MODES, Fits(), rigid=False)
    return EmbeddedFile(original, craft, wanted, appendages)


def _fit_on_craft(
    original: Craft, wanted: dict[str, AppendageRequest], most: int, fits: Fits, *, rigid: bool
) -> "tuple[mujoco.MjModel, tuple[Appendage, ...], list[str], tuple[str, ...]]":
    """The bare spacecraft, compiled, the appendages fitted to it, notes,
    and the modes that were added."""
    carries = {at: wish.carries for at, wish in wanted.items()}
    bare, targets = open_places(original, list(wanted), carries)
    check_carries(bare, targets, carries)
    craft = compile_model(with_probes(bare, targets).text)
    mounts = {
        at: mounting.mount(
            craft, at, t.kind, t.name, reach=_reach(at, wanted), turn=wanted[at].spec.turn
        )
        for at, t in targets.items()
    }
    return craft, *fit_all(craft, mounts, wanted, most, fits, rigid)


def _reach(at: str, wanted: Mapping[str, AppendageRequest]) -> float:
    """How far from the place on the spacecraft an appendage on another's port stands [m]."""
    on_port = split_port(at, wanted)
    if on_port is None:
        return 0.0
    place, port = on_port
    return port_x(place, wanted[place].spec, port) + _reach(place, wanted)


def _embed_in_document(
    original: Craft,
    wanted: dict[str, AppendageRequest],
    retime: bool | None = None,
    most: int = MOST_MODES,
    fits: "Fits | None" = None,
    rigid: bool = False,
) -> Embedded:
    craft, appendages, warnings, steps = _fit_on_craft(
        original, wanted, most, fits or Fits(), rigid=rigid
    )
    warnings += moved_by_load(compile_model(relocate(original, None).text), craft)
    check_flags(craft)
    check_names(craft, appendages)
    compatibility.check_compiler(original.parts(), *lightest(appendages))
    layout = layout_of(original, appendages, craft)
    made = _time_and_check(
        craft,
        appendages,
        lambda those: compile_document(original, those, layout),
        retime,
        compatibility.default_attributes(original.parts()),
    )
    return with_known(
        made,
        OF_MOTION,
        warnings=(*warnings, *made.warnings),
        document=original,
        steps=steps,
        _layout=layout,
    )


# -- into an MjSpec --------------------------------------------------------------------------------
def _embed_in_spec(
    spec: "mujoco.MjSpec",
    wanted: dict[str, AppendageRequest],
    retime: bool | None,
    most: int,
    fits: Fits,
    rigid: bool,
) -> Embedded:
    places: dict[str, tuple[str, str]] = {}
    probe = spec.copy()
    for at in wanted:
        kinds, name = kinds_and_name(at)
        found = [kind for kind in kinds if getattr(spec, kind)(name) is not None]
        if len(found) != 1:
            known = ", ".join(s.name for s in [*spec.sites, *spec.bodies] if s.name)
            raise InputError(
                f"--mount {at}: the spacecraft has "
                f"{'both a site and a' if found else 'no site or'} body {name!r}; write "
                f"site:{name} or body:{name}, or choose from: {known}."
            )
        places[at] = found[0], name
        _owner(probe, *places[at]).add_body(name=f"{PROBE}{len(places)}")
    try:
        plain = spec.copy().compile()
        craft = probe.compile()
    except ValueError as error:
        raise EngineError(f"MuJoCo refuses the spacecraft: {error}") from None
    check_model(plain, "the spacecraft")
    mounts = {
        at: mounting.mount(craft, at, kind, name, turn=wanted[at].spec.turn)
        for at, (kind, name) in places.items()
    }
    appendages, warnings, steps = fit_all(craft, mounts, wanted, most, fits, rigid)
    warnings += moved_by_load(plain, craft)
    check_flags(craft)
    check_names(craft, appendages)

    def attached(place: "mujoco.MjSpec", made: Sequence[Appendage]) -> "mujoco.MjSpec":
        for a in made:
            frame = _owner(place, *places[a.at]).add_frame(
                pos=a.mount.position, quat=a.mount.quaternion
            )
            text = write.document_text(insert.with_prefix(a.element(), a.spec.name, ""))
            place.attach(mujoco.MjSpec.from_string(text), frame=frame, prefix=a.prefix)
        return place

    made = _time_and_check(
        craft, appendages, lambda those: attached(spec.copy(), those).compile(), retime
    )
    # the user's spec is touched only after a copy has proved itself
    attached(spec, made.appendages)
    told = (*warnings, *made.warnings)
    return replace(made, model=spec.copy().compile(), warnings=told, steps=steps)


# -- both ------------------------------------------------------------------------------------------
def _time_and_check(
    craft: "mujoco.MjModel",
    appendages: tuple[Appendage, ...],
    build: "Callable[[tuple[Appendage, ...]], mujoco.MjModel]",
    retime: bool | None,
    found: Mapping[str, Mapping[str, int]] | None = None,
) -> Embedded:
    """The spacecraft with its appendages, exact in time where that is worth it.

    `build` compiles the spacecraft with appendages; `found`: defaults of its document that
    would change them.
    """
    model = build(appendages)
    result = Embedded(appendages, craft, model, ())
    if any(a.rigid for a in appendages):
        return result
    decision = decide_timing(model, appendages, retime)
    warnings = list(decision.warnings)
    if decision.needed:
        on_tendons = tuple(replace(a, fit=fit_on_tendons(a.fit)) for a in appendages)
        check_names(craft, on_tendons)
        plain = build(on_tendons)
        band = joint_request([a.spec for a in appendages]).band
        timed, slowed = with_timing(plain, band)
        made = tuple(replace(a, timed=timed) for a in on_tendons)
        before = None if retime else result.sampled_error
        # against the same exact craft
        after = with_known(result, ("_exact_poses",), appendages=made, model=timed)
        if before is None or is_worth_timing(before, after.sampled_error, result.tolerance):
            appendages, model, result = made, plain, after
            with_error = craft_time_error(timed, model, appendages, band)
            without_error = craft_time_error(model, model, appendages, band)
            warnings += time_notes(timed, model, with_error, without_error)
            warnings += slowed
    check_craft_unchanged(craft, model, appendages)
    check_appendages_unchanged(model, appendages, found or {})
    warnings += motion_warnings(model, appendages, result.model)
    warnings += driven_too_far(model, appendages) + attitude_warnings(model, appendages)
    return with_known(result, OF_MOTION, warnings=tuple(warnings))


def _owner(spec: "mujoco.MjSpec", kind: str, name: str) -> Any:
    """The body that a site or body means."""
    return spec.body(name) if kind == "body" else spec.site(name).parent
