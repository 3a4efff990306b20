"""Without a prior no mass is invented: the file of modes lacks it, and says so to whoever reads it.

The exact sampled response of a craft with one wing mode, in closed form,
shares no code with the package.
"""

import json

import numpy as np
import pytest

import beamchain as bc
from beamchain import identification
from command import call
from flight_log import Hub, record, steps_at, wings

HUB = Hub()
PAIR = wings(5.0, 1.0, 200.0, 350.0, 50.0, 0.05)
ONE = PAIR.kept(np.flatnonzero(PAIR.participation[5])[:1])
TIME = np.arange(0.0, 60.0, 0.05)
MATRIX = "mass = " + json.dumps(np.asarray(ONE.rigid).tolist())
SAME = 1e-8  # relative: one mode in a log without noise


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The folder in which the command has identified a log without a prior."""
    folder = tmp_path_factory.mktemp("no_prior")
    (folder / "craft.xml").write_text(HUB.xml)
    log = record(HUB, ONE, TIME, {"z": steps_at(TIME, 1.0, 3.0)})
    np.savez(folder / "log.npz", **log)
    words = ["identify", folder / "log.npz", "--craft", folder / "craft.xml", "--mount", "mount"]
    answer = call(*words, "--modes", 1, "-o", folder / "modes.toml")
    assert answer.status == 0, answer.err
    (folder / "wing.toml").write_text('name = "wing"\n[imported]\nfile = "modes.toml"\n')
    return folder


@pytest.mark.slow
def test_the_file_of_modes_has_no_mass_and_says_so(written):
    with pytest.raises(bc.InputError, match="mass"):
        bc.fit(written / "wing.toml")
    assert "add the 6 x 6 rigid mass" in (written / "modes.toml").read_text()


@pytest.mark.slow
def test_with_the_mass_added_it_is_a_file_of_modes(written, tmp_path):
    text = (written / "modes.toml").read_text()
    lines = [MATRIX if line.startswith("# mass") else line for line in text.splitlines()]
    (tmp_path / "modes.toml").write_text("\n".join(lines))
    frequency = bc.read_modes(tmp_path / "modes.toml").frequencies[0]
    assert abs(frequency / ONE.frequency[0] - 1.0) < SAME


def test_in_python_it_has_no_data():
    log = record(HUB, ONE, TIME, {"z": steps_at(TIME, 1.0, 3.0)})
    found = identification.identify(log, HUB.xml, "mount", modes=1)
    assert any("mass of the appendage" in sentence for sentence in found.undetermined)
    assert not found.rigid[:3].any()
    with pytest.raises(bc.InputError, match="prior"):
        found.data()
