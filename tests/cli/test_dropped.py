"""What was dropped is answered with one sentence that names its replacement: exit status 2,
no traceback, no file touched.

No tolerances: words and files only.
"""

import numpy as np
import pytest

import beamchain as bc
from command import run

CRAFT = """<mujoco><worldbody><body name="hub"><freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="100 120 150"/>
<site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>"""
IDENTIFY = ["identify", "log.csv", "--craft", "craft.xml", "--at", "mount", "-o", "modes.toml"]
LINES = [
    (["seed", "--json", "--quiet"], "01_seed_paper.ipynb"),
    (["examples"], "beamchain init --list"),
    ([*IDENTIFY, "--plan", "1e-5"], "identify a log that was simulated with the prior"),
    ([*IDENTIFY, "--plan=1e-5"], "identify a log that was simulated with the prior"),
    ([*IDENTIFY, "--offset"], "the delay between torque and motion is estimated"),
    ([*IDENTIFY, "--estimate-hub"], "give the spacecraft's inertia in the file of --craft"),
    (["identify", "log.uff", *IDENTIFY[2:]], "give frequency responses as CSV, .npz"),
    (["identify", "log.mat", *IDENTIFY[2:]], "scipy.io.loadmat"),
    (["identify", "log.parquet", *IDENTIFY[2:]], "pyarrow's to_pydict"),
]
LINES += [
    ([command, "spec.toml", "-o", "out", *option], cure)
    for command in ("study", "sweep")
    for option, cure in (
        (["--dask", "tcp://127.0.0.1:1"], "joblib.parallel_config"),
        (["--resume"], "start the run again"),
    )
]
BOOM = """name = "boom"
[[segment]]
length = 8.0
section = { shape = "equivalent", bending_stiffness_xy = 2e3, linear_mass = 2.0 }
"""
LOG = {"frequency": np.array([1.0, 2.0])}
CALLS = [
    (
        lambda: bc.identify({}, CRAFT, "mount", offset=True),
        "the delay between torque and motion is estimated",
    ),
    (
        lambda: bc.identify({}, CRAFT, "mount", hub="estimate"),
        "give the spacecraft's inertia in craft",
    ),
    (lambda: bc.study("spec.toml", executor=None), "joblib.parallel_config"),
    (lambda: bc.sweep("spec.toml", resume=True), "start the run again"),
    (lambda: bc.FitOptions(method="midpoint"), "every fit is the exact chain"),
    (lambda: bc.FitOptions(links=20), "the kept modes determine the links"),
    (lambda: bc.identify(LOG, CRAFT, "mount"), r"give it to \[imported\]"),
]


@pytest.mark.parametrize(
    ("words", "cure"), LINES, ids=lambda value: " ".join(value) if isinstance(value, list) else ""
)
def test_a_command_line_is_answered(words, cure, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "craft.xml").write_text(CRAFT)
    for name in ("log.csv", "log.uff", "log.mat", "log.parquet"):
        (tmp_path / name).write_text("time,torque_z,rate_z\n")
    before = sorted(tmp_path.iterdir())
    code, _, told = run(words, capsys, monkeypatch)
    assert code == 2
    assert cure in told
    assert "Traceback" not in told
    assert len(told.strip().splitlines()) == 1
    assert sorted(tmp_path.iterdir()) == before


def test_a_modes_file_of_matrix_market_is_answered(tmp_path):
    (tmp_path / "cb.toml").write_text(
        'matrices = { mass = "M.mtx", stiffness = "K.mtx", boundary = [1, 2, 3, 4, 5, 6] }\n'
    )
    with pytest.raises(bc.InputError, match=r"scipy\.io\.mmread"):
        bc.read_modes(tmp_path / "cb.toml")


@pytest.mark.parametrize(
    ("line", "cure"),
    [
        ('method = "naive"', "every fit is the exact chain"),
        ("links = 20", "give cuts where hinges have to stand"),
        ('free = ["stiffness"]', "needs no least squares"),
    ],
)
def test_a_key_of_a_specification_is_answered(line, cure, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "boom.toml").write_text(f"{BOOM}[fit]\n{line}\n")
    code, _, told = run(["fit", "boom.toml", "-o", "out"], capsys, monkeypatch)
    assert code == 2
    assert cure in told
    assert "Traceback" not in told
    assert len(told.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("call", "cure"), CALLS)
def test_a_call_is_answered(call, cure):
    with pytest.raises(bc.InputError, match=cure) as told:
        call()
    assert "\n" not in str(told.value)


def test_an_attribute_of_a_fit_is_answered():
    section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=2.0)
    segment = bc.Segment(length=8.0, section=section)
    fit = bc.fit(bc.Spec(name="boom", segment=(segment,), modes=bc.Modes(xy=1)))
    with pytest.raises(AttributeError, match="readback_error has, per port"):
        _ = fit.error
    assert not hasattr(fit, "error")
    assert list(fit.readback_error) == ["xy"]
