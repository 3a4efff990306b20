"""A table of measured frequencies alone: the beam's stiffness over mass, and modes with the prior's participation."""

import numpy as np
from scipy.optimize import linear_sum_assignment

from beamchain.caution import Caution
from beamchain.craft.identification.logs import ModalTable
from beamchain.craft.identification.prior import FAR, Prior, read_prior
from beamchain.craft.identification.result import Identification, IdentifiedMode
from beamchain.craft.identification.start import Order
from beamchain.craft.identification.update import scaled, update
from beamchain.errors import InputError
from beamchain.ports.motions import Array

ACCURACY = 1e-3  # relative, of frequencies of a test whose accuracy is not stated


def from_table(table: ModalTable, prior: Prior, at: str) -> Identification:
    """Modes with measured frequencies, root held, and the prior's participation.

    Raises:
        InputError: the prior has no mode near a measured one.
    """
    w = table.frequencies
    first = None
    of = _nearest(w, prior.parts.frequencies, table.source)
    wanted = np.log(w)
    if prior.spec.imported is None:
        first = update(prior, of, wanted, ACCURACY**2 * np.eye(w.size), None, moments=False)
        assert first is not None
        better = read_prior(scaled(prior.spec, np.array([np.log(first.ratio), 0.0])), prior.parts.hub)
        of = _nearest(w, better.parts.frequencies, table.source)
        first = update(prior, of, wanted, ACCURACY**2 * np.eye(w.size), None, moments=False)
    said = [
        "participation and rigid mass: a table of frequencies says nothing of them; they are the prior's, with "
        "its width."
    ]
    modes = list[IdentifiedMode]()
    for i, j in enumerate(of):
        damping = prior.parts.damping[j] if table.damping is None else table.damping[i]
        row = prior.parts.participation[j]
        remark = "participation comes from the prior" + ("; damping too" if table.damping is None else "")
        modes.append(
            IdentifiedMode(
                i + 1,
                float(w[i]),
                float(damping),
                row,
                ACCURACY * float(w[i]),
                float(damping) * prior.widths[1],
                np.abs(row) * prior.widths[2],
                table.damping is not None,
                remark,
            )
        )
    warnings = list[str]()
    if first is not None:
        said += first.undetermined
        if any("beam model" in one for one in first.undetermined):
            warnings.append(
                Caution("prior-contradicted", next(one for one in first.undetermined if "beam model" in one))
            )
    warnings.append(Caution("undetermined", f"the log leaves {len(said)} thing(s) undetermined; see `undetermined`."))
    names = [f"mode{i + 1}.{kind}" for kind in ("frequency", "damping", "participation") for i in range(w.size)]
    sd = np.concatenate([ACCURACY * w, [m.damping_std for m in modes], np.full(w.size, prior.widths[2])])
    order = Order(w.size, float("nan"), float("nan"), w, np.array([m.damping for m in modes]))
    return Identification(
        tuple(modes),
        tuple(names),
        np.diag(sd**2),
        prior.parts.rigid,
        (order,),
        {},
        tuple(warnings),
        tuple(said),
        first,
        {},
        {},
        source=f"table at {at}",
    )


def _nearest(measured: Array, known: Array, source: str) -> list[int]:
    cost = np.abs(np.log(measured[:, None] / known[None, :]))
    of = [-1] * measured.size
    for i, j in zip(*linear_sum_assignment(cost), strict=True):
        of[i] = int(j)
    for i, j in enumerate(of):
        if j < 0 or cost[i, j] > FAR:
            raise InputError(
                f"{source}: the prior has no mode near {measured[i]:.5g} rad/s; give it more modes, or check "
                "the unit (frequency is in Hz)."
            )
    return of
