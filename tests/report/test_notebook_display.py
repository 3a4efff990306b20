"""What a cell or a prompt shows of fits, embeddings and models:
a few lines with the right numbers, never arrays.

No tolerances: printed text only.
"""

import pytest
from lxml import html

import beamchain as bc
from appendages import seed_boom
from arrays import deployed_array

LINES, WIDTH = 20, 400  # of a repr: what a person still reads

CRAFT = """<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="100 120 150"/><site name="mount" pos="0.5 0 0"/>
</body></worldbody></mujoco>"""


@pytest.fixture(scope="module")
def fitted():
    return bc.fit(deployed_array(), name="array", modes={"xy": 2, "xz": 1, "torsion": 1})


@pytest.fixture(scope="module")
def embedded():
    return bc.embed(CRAFT, {"mount": seed_boom()})


def short(thing):
    text = repr(thing)
    assert text.startswith("<")
    assert "array(" not in text
    assert len(text.splitlines()) <= LINES
    assert max(len(line) for line in text.splitlines()) <= WIDTH
    return text


def test_a_fit_says_its_modes(fitted):
    text = short(fitted)
    assert fitted.status.message in text
    for port, target in fitted.target.items():
        for k, w in enumerate(target.frequencies):
            assert f"{port} {k + 1}: {w:.6g} rad/s" in text


def test_a_fit_in_a_cell_is_a_table(fitted):
    rows = html.fromstring(fitted._repr_html_()).xpath("//tr")
    assert len(rows) == 1 + 4
    assert [cell.text for cell in rows[1]][:3] == [
        "xy",
        "1",
        f"{fitted.target['xy'].frequencies[0]:.6g}",
    ]


def test_models_say_their_size(fitted):
    assert "2 motions" in short(fitted.full["xy"])
    assert "1 motion," in short(fitted.full["torsion"])
    assert "implicitfast" in short(fitted.measured.linearisation)
    assert "rigid" in short(bc.PortModel([[2.0]], [], [[]]))
    data = bc.ModalData(
        [[1.0 if i == j else 0.0 for j in range(6)] for i in range(6)], [2.0], [[0.1] * 6]
    )
    assert "2 rad/s" in short(data)


def test_an_embedding_says_its_worst_mode(embedded):
    assert f"{embedded.assembly.worst:.1e}" in short(embedded)
    rows = html.fromstring(embedded._repr_html_()).xpath("//tr")
    assert len(rows) == 1 + len(embedded.assembly.modes)


@pytest.mark.slow
def test_beams_and_fits_can_be_embedded(fitted):
    by_beam = bc.embed(CRAFT, {"mount": seed_boom()})
    by_fit = bc.embed(CRAFT, {"mount": bc.fit(seed_boom())})
    assert [m.mujoco for m in by_beam.assembly.modes] == [m.mujoco for m in by_fit.assembly.modes]


@pytest.mark.parametrize("wrong", [3, None, [1, 2], object()])
def test_what_is_no_appendage_is_refused(wrong):
    with pytest.raises(bc.BeamchainError, match=r"give a Beam, a Spec"):
        bc.fit(wrong)
    with pytest.raises(bc.BeamchainError, match=r"give a Beam, a Spec"):
        bc.embed(CRAFT, {"mount": wrong})
