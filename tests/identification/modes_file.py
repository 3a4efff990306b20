"""A specification of imported modes, written from a structure, by intention wrong by factors."""

import numpy as np


def write_prior(folder, elastic, *, frequency=1.0, damping=1.0, participation=1.0):
    """The path of `prior.toml`, beside its `prior_modes.toml`; rigid mass as it is."""

    def rows(matrix):
        return "[" + ", ".join(str([float(v) for v in row]) for row in np.asarray(matrix)) + "]"

    (folder / "prior_modes.toml").write_text(
        f"frequencies = {[float(v) for v in frequency * elastic.frequency]}\n"
        f"participation = {rows(participation * elastic.participation)}\n"
        f"mass = {rows(elastic.rigid)}\n"
        f"damping = {[float(v) for v in damping * elastic.damping]}\n"
    )
    path = folder / "prior.toml"
    path.write_text('name = "prior"\n[imported]\nfile = "prior_modes.toml"\n')
    return path
