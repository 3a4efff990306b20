"""`worlds.make` on MJX: eight randomised worlds against MuJoCo one by one,
and derivatives against differences of MuJoCo runs.

DOUBLE: the same algebra in another order. SINGLE: of the peak; float32 carries 7 digits, a
hundred steps lose two of them. GRADIENT: what the issue asks for; the central differences
themselves are good to 1e-7.
"""

import contextlib
import copy
import io
import re
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain import worlds

pytestmark = [pytest.mark.host, pytest.mark.filterwarnings("ignore")]  # JAX warns of its own future
pytest.importorskip("mujoco.mjx", reason="MJX is not installed: pip install 'beamchain[mjx]'")
jax = pytest.importorskip("jax", reason="JAX is not installed: pip install 'beamchain[mjx]'")

DOUBLE, SINGLE, GRADIENT = 1e-9, 1e-4, 1e-4
PAGE = Path(__file__).parent.parent.parent / "docs" / "products" / "worlds.md"
COUNT, SECONDS, STEP = 8, 5.0, 0.05
CRAFT = f"""<mujoco><option timestep="{STEP}" gravity="0 0 0"/><worldbody><body name="bus">
<freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="90 100 120"/><site name="mount" pos="0.5 0 0"/></body>
</worldbody>
<actuator><motor name="y" site="mount" gear="0 0 0 0 1 0"/>
<motor name="z" site="mount" gear="0 0 0 0 0 1"/></actuator></mujoco>"""
PULSE = np.repeat([[0.0, 1.0], [0.0, -1.0], [0.0, 0.0]], [8, 8, 24], axis=0)


def flexible() -> mujoco.MjModel:
    section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
    spec = bc.Spec(
        segment=(bc.Segment(length=8.0, section=section),), damping=bc.Damping(ratio=0.01)
    )
    return bc.embed(CRAFT, {"mount": spec}, retime=True).model


def double(on: bool):
    return (
        jax.experimental.enable_x64(on)
        if hasattr(jax.experimental, "enable_x64")
        else jax.enable_x64(on)
    )


def alone(model: mujoco.MjModel, given: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and rates after every step of an input `(t, nu)` held over steps, plain MuJoCo."""
    data = mujoco.MjData(model)
    before = np.zeros(model.nu)
    out = []
    for now in given:
        data.ctrl[:], before = (now + before) / 2.0, now
        mujoco.mj_step(model, data)
        out.append((data.qpos.copy(), data.qvel.copy()))
    return np.array([q for q, _ in out]), np.array([v for _, v in out])


@pytest.mark.parametrize("on", [False, True], ids=["float32", "float64"])
def test_randomised_worlds_are_those_of_mujoco(on):
    model = flexible()
    steps = round(SECONDS / STEP)
    given = np.random.default_rng(0).normal(size=(steps, COUNT, 2))
    with double(on):
        many = worlds.make(
            model, {"frequency": 0.1, "damping": 0.5}, count=COUNT, host="mjx", seed=1
        )
        theirs = np.array([[many.step(now), many.qpos][1] for now in given])
        kept = many.state()
        first = many.step(given[0])
        again = [many.restore(kept), many.step(given[0])][1]
        many.reset([3], qvel=np.full(model.nv, 1e20))
        many.step(given[0])
        assert list(many.diverged) == [3]
        many.reset([1, 2], draw=True)
        assert np.all(np.isfinite(many.step(given[0])["rate"]))
    for name, values in first.items():
        np.testing.assert_array_equal(values, again[name])
    ours = np.array(
        [alone(bc_model, given[:, i])[0] for i, bc_model in enumerate(drawn(model))]
    ).transpose(1, 0, 2)
    # place, attitude, hinges: of the largest of each
    parts = [slice(0, 3), slice(3, 7), slice(7, None)]
    worst = max(
        float(np.abs(theirs - ours)[..., p].max() / np.abs(ours - ours[0])[..., p].max())
        for p in parts
    )
    print(  # noqa: T201
        f"{COUNT} worlds on MJX, {'float64' if on else 'float32'}, {SECONDS:g} s: {worst:.1e} of "
        "the peak"
    )
    assert worst < (DOUBLE if on else SINGLE)


def drawn(model: mujoco.MjModel) -> list[mujoco.MjModel]:
    """The same worlds' models, made anew by `bc.retime`."""
    fields = worlds.make(model, {"frequency": 0.1, "damping": 0.5}, count=COUNT, seed=1).fields
    out = []
    for i in range(COUNT):
        one = copy.copy(model)
        bc.retime(one, 0.0)
        modal = one.tendon_stiffness > 0.0
        one.tendon_stiffness[modal] = fields["tendon_stiffness"][i, modal]
        one.tendon_damping[modal] = fields["tendon_solimp_lim"][i, modal, 3]
        bc.retime(one, STEP)
        out.append(one)
    return out


def test_derivatives_are_those_of_differences():
    model = flexible()
    plain = copy.copy(model)
    bc.retime(plain, 0.0)
    modal = np.flatnonzero(plain.tendon_stiffness > 0.0)
    w = np.sqrt(plain.tendon_stiffness[modal])
    ratio = plain.tendon_damping[modal] / (2.0 * w)

    def ringing(w: np.ndarray, ratio: np.ndarray) -> float:
        one = copy.copy(plain)
        one.tendon_stiffness[modal], one.tendon_damping[modal] = w**2, 2.0 * ratio * w
        bc.retime(one, STEP)
        return float(1e6 * np.sum(alone(one, PULSE)[1][16:, 3:6] ** 2))

    with double(True):
        respond = worlds.make(model, count=1, host="mjx").response()

        def cost(both):
            return 1e6 * jax.numpy.sum(respond(PULSE, both[0], both[1])["rate"][16:] ** 2)

        value, slope = jax.jit(lambda x: (cost(x), jax.jacfwd(cost)(x)))(np.array([w, ratio]))
    assert abs(float(value) / ringing(w, ratio) - 1.0) < 1e-6
    slope = np.array(slope)
    for i in range(w.size):
        for row, (scale, change) in enumerate(((w[i], 1e-5), (ratio[i], 1e-4))):
            move = np.zeros((2, w.size))
            move[row, i] = scale * change
            both = [ringing(w + s * move[0], ratio + s * move[1]) for s in (1.0, -1.0)]
            theirs = (both[0] - both[1]) / (2.0 * scale * change)
            assert abs(slope[row, i] - theirs) < GRADIENT * np.abs(slope[row]).max()


@pytest.mark.skipif(
    not PAGE.is_file(), reason="the page is not beside the tests (an installed wheel)"
)
def test_the_blocks_on_the_page_run(tmp_path, monkeypatch):
    """`py` blocks of docs/products/worlds.md need JAX; the first `python` block makes the
    spacecraft. A program of one's own moves as the worlds do; less is left ringing at the end of
    co-design."""
    monkeypatch.chdir(tmp_path)
    subprocess.run([sys.executable, "-m", "beamchain", "init", "array"], check=True)
    text = PAGE.read_text(encoding="utf-8")
    names = {}
    first = re.search(r"^```python\n(.*?)^```", text, re.S | re.M)
    blocks = re.findall(r"^```py\n(.*?)^```", text, re.S | re.M)
    assert first is not None
    assert len(blocks) == 2
    before = jax.config.jax_enable_x64
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            for block in (first[1], blocks[0]):
                exec(compile(block, PAGE.name, "exec"), names)
            many = names["many"]
            many.reset()
            for _ in range(20):
                many.step([2.0])
            moved = np.abs(many.qpos - many.model.qpos0).max()
            assert np.abs(names["data"].qpos - many.qpos).max() < SINGLE * moved
            exec(compile(blocks[1], PAGE.name, "exec"), names)
        assert float(names["value"]) < 0.2 * float(names["start"])
    finally:
        jax.config.update("jax_enable_x64", before)
