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
    spread = ACCURACY**2 * np.eye(w.size)
    of = _nearest(w, prior.parts.frequencies, table.source)
    first = update(prior, of, np.log(w), spread, None, moments=False)
    if first is not None:  # the scaled beam may have other modes near those measured
        better = read_prior(scaled(prior.spec, np.array([np.log(first.ratio), 0.0])), prior.parts.hub)
        of = _nearest(w, better.parts.frequencies, table.source)
        first = update(prior, of, np.log(w), spread, None, moments=False)
    said = [
        "participation and rigid mass: a table of frequencies says nothing of them; they are the prior's, with its width."
    ]
    damping = prior.parts.damping[of] if table.damping is None else table.damping
    remark = "participation comes from the prior" + ("; damping too" if table.damping is None else "")
    modes = [
        IdentifiedMode(
            i + 1,
            float(w[i]),
            float(z),
            row,
            ACCURACY * float(w[i]),
            float(z) * prior.widths[1],
            np.abs(row) * prior.widths[2],
            table.damping is not None,
            remark,
        )
        for i, (z, row) in enumerate(zip(damping, prior.parts.participation[of], strict=True))
    ]
    warnings = list[str]()
    if first is not None:
        said += first.undetermined
        warnings += [Caution("prior-contradicted", one) for one in first.undetermined if "beam model" in one][:1]
    warnings.append(Caution("undetermined", f"the log leaves {len(said)} thing(s) undetermined; see `undetermined`."))
    names = [f"mode{i + 1}.{kind}" for kind in ("frequency", "damping", "participation") for i in range(w.size)]
    sd = np.concatenate([ACCURACY * w, damping * prior.widths[1], np.full(w.size, prior.widths[2])])
    order = Order(w.size, float("nan"), float("nan"), w, damping)
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
        {},
        source=f"table at {at}",
    )


def _nearest(measured: Array, known: Array, source: str) -> list[int]:
    cost = np.abs(np.log(measured[:, None] / known[None, :]))
    of = {int(i): int(j) for i, j in zip(*linear_sum_assignment(cost), strict=True)}
    for i, w in enumerate(measured):
        if i not in of or cost[i, of[i]] > FAR:
            raise InputError(
                f"{source}: the prior has no mode near {w:.5g} rad/s; give it more modes, or check the unit (frequency is in Hz)."
            )
    return [of[i] for i in range(measured.size)]
