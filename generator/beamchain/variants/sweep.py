"""`sweep`: variants of an appendage or of a whole craft,
as arrays for one compiled MuJoCo model."""

import io
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files as package_files
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from msgspec import structs

from beamchain import report
from beamchain.checks import is_mjcf_text, list_of_names, whole_number
from beamchain.craft.embedded import Embedded
from beamchain.craft.embedding import check_places, embed
from beamchain.engine.jobs import Progress, check_workers, run_jobs
from beamchain.engine.library import mujoco, one_thread
from beamchain.engine.linearise import compile_model
from beamchain.engine.model_fields import FIELDS
from beamchain.errors import InputError
from beamchain.files import noted_inputs, to_json, write_files
from beamchain.fitting.fit import as_spec, fit
from beamchain.fitting.quantity import Quantity
from beamchain.fitting.result import Fit
from beamchain.fitting.spec import Spec, read_spec
from beamchain.fitting.uncertain import Correlation, Uncertain, UncertainCraft, read_uncertain
from beamchain.mjcf.craft import Craft, craft_from_text, read_craft
from beamchain.mjcf.relocate import relocate
from beamchain.ports.motions import Array
from beamchain.structure.beam import Beam
from beamchain.structure.modal_data import ModalData
from beamchain.variants.refit import Refit
from beamchain.variants.samples import Case, Samples, gain, join_samples, usual_gain, vary
from beamchain.warning_codes import warnings_record

NAMES = {"body": "nbody", "jnt": "njnt", "site": "nsite", "tendon": "ntendon"}
MOST = 2**31  # samples, and seed
CHUNK, QUICK_CHUNK = 10, 100  # samples per job: with fits, without
Nominal: TypeAlias = Fit | Embedded | Craft
Places: TypeAlias = Mapping[str, Spec | Beam | ModalData | str | Path]
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


@dataclass(frozen=True, eq=False)
class Sweep:
    """All variants.

    Args:
        name: of the appendage, or of the craft's file.
        source: the nominal fit, the embedded craft,
            or the document of a craft that was given as a file.
        case: what is uncertain.
        seed: of the draws.
        indices: `(k,)` samples that became variants.
        values: `(k, n)` of the uncertain quantities of modes, bodies and joints, then of
            structures.
        fields: per field of MuJoCo's model that varies, `(k, ...)`.
        coupled: `(k, m)` undamped coupled frequencies, ascending [rad/s].
        gains: per pair of signals `(k, m)` modal gains.
        participation: of a single appendage, per port `(k, n, motions)`.
        left_out: samples without a variant and why.
        seconds: taken.
        inputs: files that were read, which `write` does not replace.

    Example:
        >>> import beamchain as bc
        >>> from importlib.resources import files
        >>> variants = bc.sweep(
        ...     files("beamchain") / "examples" / "array_uncertain.toml", samples=2, seed=1
        ... )
        >>> (
        ...     variants.coupled.shape[0],
        ...     variants.fields["tendon_stiffness"].shape[0],
        ...     variants.left_out,
        ... )
        (2, 2, {})
    """

    name: str
    source: "Fit | Embedded | Craft"
    case: Case
    seed: int
    indices: Array
    values: Array
    fields: dict[str, Array]
    coupled: Array
    gains: dict[str, Array]
    participation: dict[str, Array]
    left_out: dict[int, str]
    seconds: float
    inputs: tuple[Path, ...] = ()

    @property
    def nominal(self) -> Fit:
        """The nominal fit of a sweep of one appendage.

        Raises:
            InputError: the sweep is one of a craft.
        """
        if not isinstance(self.source, Fit):
            raise InputError("nominal: this is the sweep of a craft, whose nominal is in source.")
        return self.source

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """The uncertain quantities of modes, bodies and joints, then those of structures:
        stiffness and density of segments as factors, stiffness of joints, masses."""
        return self.case.quantities

    @property
    def units(self) -> dict[str, str]:
        """Units of the gains."""
        return {gain.name: gain.unit for gain in self.case.gains}

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was said of the nominal craft."""
        return self.source.warnings if isinstance(self.source, Embedded) else ()

    @property
    def model_file(self) -> str:
        """Name of the file that the fields are of."""
        return "scene.xml" if isinstance(self.source, Fit) else "flexible.xml"

    def as_dict(self) -> dict[str, Any]:
        """What sweep.json holds."""
        gains = [
            {"pair": name, "unit": self.units[name], "modes": _spreads(values)}
            for name, values in self.gains.items()
        ]
        quantities = [
            {"name": q.name, "unit": q.unit, "nominal": q.nominal, **_spread(column)}
            for q, column in zip(self.quantities, self.values.T, strict=True)
        ]
        participation = {
            port: [_spreads(mode) for mode in np.moveaxis(values, 1, 0)]
            for port, values in self.participation.items()
        }
        return {
            "name": self.name,
            "samples": self.indices.size + len(self.left_out),
            "variants": self.indices.size,
            "seed": self.seed,
            "quantiles": QUANTILES,
            "coupled_frequencies": _spreads(self.coupled),
            "gains": gains,
            "quantities": quantities,
            "participation": participation,
            "left_out": [{"sample": index, "why": why} for index, why in self.left_out.items()],
            "fields": {name: list(values.shape[1:]) for name, values in self.fields.items()},
            "warnings": warnings_record(self.warnings),
            "mujoco": mujoco.__version__,
            "seconds": self.seconds,
        }

    def archive(self) -> bytes:
        """variants.npz: fields, samples' numbers, drawn values, coupled modes, gains,
        and names of bodies, joints, ..."""
        stream = io.BytesIO()
        model = self.case.model
        names = {
            f"{kind}_names": np.array(
                [getattr(model, kind)(i).name for i in range(getattr(model, count))]
            )
            for kind, count in NAMES.items()
        }
        np.savez_compressed(
            stream,
            allow_pickle=False,
            fields=np.array(list(self.fields)),
            sample=self.indices,
            coupled_frequencies=self.coupled,
            quantities=np.array([q.name for q in self.quantities]),
            values=self.values,
            gain_pairs=np.array(list(self.gains)),
            gains=np.array(list(self.gains.values())),
            **names,
            **self.fields,
        )
        return stream.getvalue()

    def write(self, folder: Path, *, force: bool = False) -> list[Path]:
        """Write the nominal model, variants.npz, apply_variants.py,
        pictures and sweep.json (last); all or none.

        Raises:
            OutputError: a file exists and `force` is False, or the folder cannot be written.
        """
        example = (
            package_files("beamchain")
            .joinpath("examples/apply_variants.py")
            .read_text(encoding="utf-8")
        )
        content: dict[Path, str | bytes] = {
            folder / self.model_file: _text(self.source, folder),
            folder / "variants.npz": self.archive(),
            folder / "apply_variants.py": example.replace("scene.xml", self.model_file),
            **{folder / name: text for name, text in report.sweep_pictures(self).items()},
            folder / "sweep.json": to_json(self.as_dict()),
        }
        write_files(content, force=force, inputs=self.inputs)
        return list(content)


def _spread(values: Array) -> dict[str, Any]:
    quantiles = np.quantile(values, QUANTILES)
    return {
        "mean": float(np.mean(values)),
        "deviation": float(np.std(values)),
        "quantiles": quantiles,
    }


def _spreads(columns: Array) -> list[dict[str, Any]]:
    """`(k, m)`: the spread of each column."""
    return [_spread(values) for values in columns.T]


@one_thread()
def sweep(
    source: "Spec | Embedded | str | Path",
    samples: int = 1000,
    *,
    mounts: "Mapping[str, Spec | Beam | ModalData | str | Path] | None" = None,
    uncertain: UncertainCraft | str | Path | None = None,
    retime: bool | None = None,
    gains: Sequence[str] | None = None,
    seed: int = 0,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Sweep:
    """Draw variants of an appendage or of a whole craft, as arrays of one compiled model;
    as `beamchain sweep` does.

    What is uncertain of modes, bodies and joints only changes numbers of that model; what is
    uncertain of the structure is fitted again for every sample, on the nominal cut. A craft that is
    exact in time for its step stays so in every variant.

    Args:
        source: a specification with [uncertain] or the path of such a SPEC.toml, for one appendage
            on its hub; else the path or text of the craft's MJCF file, bare if `mounts` is given,
            or with appendages that `embed` put in; or what `embed` returned. If modes are chosen
            for a scene, all variants use the nominal choice.
        samples: number of samples.
        mounts: the appendage for each site or body, as in `embed`; their [uncertain] counts.
        uncertain: of the craft: masses, drives, modes by prefix; or the path of its TOML file.
        retime: as in `embed`.
        gains: pairs "INPUT=OUTPUT" of signals of `bc.plant` whose modal gains are followed;
            default: "torque:BASE=attitude".
        seed: of the draws; the same seed gives the same variants.
        workers: processes; default: as `joblib.parallel_config` says, else this one.
        progress: called after every job.

    Returns:
        The variants as fields of one compiled MuJoCo model (`fields`), their coupled frequencies
        [rad/s] (`coupled`) and modal gains (`gains`), samples that could not be made and why
        (`left_out`), files (`write`).

    Raises:
        EngineError: a worker process died.
        InputError: nothing is uncertain, a range is impossible, or every sample was left out.

    Example:
        >>> import beamchain as bc
        >>> from importlib.resources import files
        >>> variants = bc.sweep(
        ...     files("beamchain") / "examples" / "array_uncertain.toml", samples=3, seed=1
        ... )
        >>> variants.coupled.shape[0]
        3
    """
    start = time.perf_counter()
    pairs = _check_arguments(samples, seed, mounts, gains, workers)
    is_spec = isinstance(source, Spec)
    if isinstance(source, str | Path) and mounts is None:
        is_spec = str(source).endswith(".toml")
    if is_spec and mounts is not None:
        raise InputError(
            "mounts are given with a specification, but need the craft that carries them; give the "
            "craft's file."
        )
    with noted_inputs() as inputs:
        given = UncertainCraft() if uncertain is None else read_uncertain(uncertain)
        if is_spec:
            assert not isinstance(source, Embedded)
            nominal: Nominal = _nominal_fit(source, given)
        else:
            assert not isinstance(source, Spec)
            nominal = _nominal_craft(source, mounts, given, retime)
    case = _case(nominal, given, pairs)
    drawn = _draw(case, seed=seed, samples=samples, workers=workers, progress=progress)
    arrays = drawn.arrays
    return Sweep(
        name=_name(source, nominal),
        source=nominal,
        case=case,
        seed=seed,
        indices=np.array(drawn.indices),
        values=arrays["values"],
        fields=_varied_fields(case, arrays),
        coupled=arrays["coupled"],
        gains={gain.name: arrays[f"gain {i}"] for i, gain in enumerate(case.gains)},
        participation={port: arrays[f"port {port}"] for port in case.participation},
        left_out=drawn.left_out,
        seconds=time.perf_counter() - start,
        inputs=tuple(inputs),
    )


def _check_arguments(
    samples: int,
    seed: int,
    mounts: Places | None,
    gains: Sequence[str] | None,
    workers: int | None,
) -> Sequence[str] | None:
    """Refuse what no sweep can use; the gains as a list of pairs, if any were given."""
    whole_number("samples", samples, 1, MOST)
    whole_number("seed", seed, 0, MOST)
    if mounts is not None:
        check_places(mounts)
    pairs = None if gains is None else list_of_names("gains", gains)
    check_workers(workers)
    return pairs


def _name(source: Spec | Embedded | str | Path, nominal: Nominal) -> str:
    """The name of the appendage, or of the craft's file."""
    if isinstance(nominal, Fit):
        return nominal.spec.name
    if isinstance(source, Embedded) or str(source).lstrip().startswith("<"):
        return "craft"
    return Path(str(source)).stem


# -- the nominal model -----------------------------------------------------------------------------
def _nominal_fit(source: Spec | str | Path, given: UncertainCraft) -> Fit:
    """The nominal fit of one appendage."""
    spec = source if isinstance(source, Spec) else read_spec(str(source))
    nominal = fit(_on_modes(spec) if given.appendage else spec)
    if nominal.spec.uncertain is None and given == UncertainCraft():
        raise InputError(
            "the spec has no [uncertain]; add one with for example stiffness = { relative = 0.05 }."
        )
    return nominal


def _nominal_craft(
    source: Embedded | str | Path,
    mounts: Places | None,
    given: UncertainCraft,
    retime: bool | None,
) -> Embedded | Craft:
    """The nominal craft with its appendages."""
    if isinstance(source, Embedded):
        if mounts is not None or source.document is None:
            raise InputError(
                "an embedded craft takes no further appendages here, and must be one document; "
                "give the craft's file and "
                'all appendages, mounts={"mount": "array.toml"}.'
            )
        return source
    if mounts is None:
        return craft_from_text(str(source)) if is_mjcf_text(source) else read_craft(source)
    appendages = mounts
    if given.appendage:
        appendages = {
            place: what if isinstance(what, ModalData) else _on_modes(as_spec(what))
            for place, what in mounts.items()
        }
    return embed(source, appendages, retime=retime)


def _on_modes(spec: Spec) -> Spec:
    """The specification with a tendon per mode, unless it says where springs stand."""
    if spec.fit.springs != "auto":
        return spec
    return structs.replace(spec, fit=structs.replace(spec.fit, springs="modes"))


def _text(source: Nominal, folder: Path | None) -> str:
    """The file of the nominal model as it stands in a folder; None: with absolute paths."""
    if isinstance(source, Fit):
        return source.scene_mjcf()
    if isinstance(source, Embedded):
        return source.to_mjcf(folder)
    return relocate(source, folder).text


# -- what is uncertain -----------------------------------------------------------------------------
def _case(nominal: Nominal, given: UncertainCraft, pairs: Sequence[str] | None) -> Case:
    """What is uncertain of a nominal craft; `pairs` of signals: None for the usual one."""
    compiled = compile_model(_text(nominal, None))
    fits = _fits_by_prefix(nominal)
    tables: dict[str, Uncertain] = {}
    for prefix, appendage in fits.items():
        if appendage.spec.uncertain is not None:
            tables[prefix] = appendage.spec.uncertain
    if not tables and given == UncertainCraft():
        raise InputError(
            "nothing is uncertain: give the appendages' specifications an [uncertain], or the "
            "craft's file of uncertainties with [body.NAME], [joint.NAME] or [appendage.PREFIX] "
            "(--uncertain)."
        )
    refits: list[Refit] = []
    for prefix, table in tables.items():
        if table.structural:
            # draws of an appendage by itself need not differ from those of others
            owner = "" if isinstance(nominal, Fit) else prefix
            refits.append(Refit.of(prefix, fits[prefix], owner))
    case = Case(
        model=compiled,
        uncertain=given,
        modes={prefix: table for prefix, table in tables.items() if table.modal},
        correlations=tuple(_correlations(tables)),
        refits=tuple(refits),
        participation=_participation(nominal),
    )
    model = case.untimed
    case.quantities_on(model)  # refuses what cannot vary, before any sample is made
    if pairs is None:
        pairs = usual_gain(model)
    return replace(case, gains=tuple(gain(model, pair) for pair in pairs))


def _fits_by_prefix(nominal: Nominal) -> dict[str, Fit]:
    """The fits of the appendages, by the prefix of their elements in the model."""
    if isinstance(nominal, Fit):
        return {f"{nominal.spec.name}_": nominal}
    if isinstance(nominal, Embedded):
        return {appendage.prefix: appendage.fit for appendage in nominal.appendages}
    return {}


def _correlations(tables: Mapping[str, Uncertain]) -> Iterator[Correlation]:
    """The correlations that the appendages state, in the craft's names."""
    for prefix, table in tables.items():
        for correlation in table.correlation:
            names = tuple(prefix + name for name in correlation.of)
            yield structs.replace(correlation, of=names)


def _participation(nominal: Nominal) -> dict[str, Array]:
    """The participation of the kept modes of a single appendage, port by port."""
    if not isinstance(nominal, Fit) or nominal.space is not None:
        return {}
    return {
        port: nominal.chain.port(port).participation[: target.modes]
        for port, target in nominal.target.items()
    }


# -- the variants ----------------------------------------------------------------------------------
def _draw(
    case: Case, *, seed: int, samples: int, workers: int | None, progress: Progress | None
) -> Samples:
    """All samples, in jobs."""
    step = CHUNK if case.refits else QUICK_CHUNK
    bare = replace(case)  # without what was worked out, which need not travel
    jobs = [(bare, seed, first, min(first + step, samples)) for first in range(0, samples, step)]
    drawn = join_samples(run_jobs(vary, jobs, workers=workers, progress=progress))
    if not drawn.indices:
        raise InputError(f"no sample became a variant: {next(iter(drawn.left_out.values()))}")
    return drawn


def _varied_fields(case: Case, arrays: Mapping[str, Array]) -> dict[str, Array]:
    """The fields of MuJoCo's model that differ from the nominal ones in any variant."""
    fields: dict[str, Array] = {}
    for field in FIELDS:
        nominal: Array = getattr(case.model, field)
        values = arrays[f"field {field}"].astype(nominal.dtype)
        if np.any(values != nominal):
            fields[field] = values
    return fields
