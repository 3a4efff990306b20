"""The extremes in float32: what MJX makes of appendages that MuJoCo's doubles hold.

For every case the accelerations that MJX computes for small hinge angles give `M^-1 K`, and its
eigenvalues the held frequencies, beside the exact ones of the compiled numbers. A case that float32
cannot hold is no failure of the file; it must be one that the stated limit names beforehand.
"""

import mujoco
import numpy as np
import pytest

import beamchain as bc
from extremes.cases import cases
from extremes.compiled import frequencies

pytestmark = [pytest.mark.host, pytest.mark.filterwarnings("ignore")]  # JAX warns of its own future
mjx = pytest.importorskip("mujoco.mjx", reason="MJX is not installed: pip install 'beamchain[mjx]'")
jax = pytest.importorskip("jax", reason="JAX is not installed: pip install 'beamchain[mjx]'")

EVERY = 41  # case of the suite
HELD = 1e-3  # relative error of a frequency up to which a case is held
DIGITS = 6e-8  # of float32
# fastest over slowest squared frequency: beyond it the slowest mode's digits are gone
SPREAD = HELD / DIGITS


def in_float32(model: mujoco.MjModel) -> np.ndarray:
    """Held frequencies [rad/s] as MJX sees them, ascending; not finite or negative ones as NaN."""
    put = mjx.put_model(model)
    data = mjx.make_data(model)

    @jax.jit
    @jax.vmap
    def accelerations(angles):
        return mjx.forward(put, data.replace(qpos=angles)).qacc

    angle = 1e-3
    pull = (
        -np.array(accelerations(angle * np.eye(model.nv, dtype=np.float32)), dtype=np.float64).T
        / angle
    )
    if not np.all(np.isfinite(pull)):
        return np.full(model.nv, np.nan)
    squares = np.sort(np.linalg.eigvals(pull).real)
    return np.where(squares > 0.0, np.sqrt(np.abs(squares)), np.nan)


def test_a_subset_of_the_extremes():
    rows = []
    chosen = [c for c in cases()[::EVERY] if c.links == 0 and not c.space]
    for case in chosen:
        try:
            result = bc.fit(case.spec())
        except bc.BeamchainError:
            continue
        model = mujoco.MjModel.from_xml_string(result.to_mjcf())
        exact = frequencies(model, "xy")
        seen = in_float32(model)
        error = float(np.max(np.abs(seen / exact - 1.0))) if np.all(np.isfinite(seen)) else np.inf
        spread = float((exact[-1] / exact[0]) ** 2)
        rows.append((case.name, exact.size, spread, float(model.body_inertia[2:].min()), error))
    held = [row for row in rows if row[4] < HELD]
    print(  # noqa: T201
        f"float32 (MJX): {len(rows)} cases, {len(held)} held within {HELD:g}, "
        f"{len(rows) - len(held)} not"
    )
    for name, modes, spread, inertia, error in sorted(rows, key=lambda r: r[2]):
        verdict = "held" if error < HELD else "lost"
        said = (
            f"{name}: {modes} modes, w^2 spread {spread:.1e}, least inertia {inertia:.1e}, "
            f"error {error:.1e}: {verdict}"
        )
        print(said)  # noqa: T201
    assert len(rows) >= 20
    for name, _, spread, _, error in rows:
        if spread < SPREAD:
            assert error < HELD, name
