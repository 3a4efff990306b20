"""Closed forms beside the modal blocks of a linear craft: its response is that of its matrices,
its poles are theirs, and its states are what their names say."""

import numpy as np
import pytest

from formulas import ModalForm, column_range, modal_form, normal_modes

RNG = np.random.default_rng(7)
POINTS = (0.3 + 2.1j, -0.7 + 0.4j, 5.0 - 1.3j)
LABELS = [("x", "m"), ("y", "rad"), ("z", "m"), ("w", "m")]


class Plant:
    """`M q'' + D q' + K q = F a + B u`, `a' = L a + E u`, dense inputs and outputs of q, q', a."""

    def __init__(self, mass, damping, stiffness, lags=(), inputs=2, outputs=3):
        nv, na = len(mass), len(lags)
        rng = np.random.default_rng(nv + 10 * na)
        self.modes = normal_modes(mass, stiffness)
        self.lags = [f"lag{i}" for i in range(na)]
        self.force = rng.uniform(0.5, 2.0, (nv, na))
        inverse = np.linalg.inv(mass)
        self.a = np.zeros((2 * nv + na, 2 * nv + na))
        self.a[:nv, nv : 2 * nv] = np.eye(nv)
        self.a[nv : 2 * nv, :nv] = -inverse @ stiffness
        self.a[nv : 2 * nv, nv : 2 * nv] = -inverse @ damping
        self.a[nv : 2 * nv, 2 * nv :] = inverse @ self.force
        self.a[2 * nv :, 2 * nv :] = -np.diag(lags) if na else 0.0
        self.b = np.zeros((2 * nv + na, inputs))
        self.b[nv:] = rng.uniform(0.5, 2.0, (nv + na, inputs))
        self.c = rng.uniform(-1.0, 1.0, (outputs, 2 * nv + na))
        self.d = rng.uniform(-1.0, 1.0, (outputs, inputs))

    def form(self, noise=1.0, together=False):
        names = [f"mode{k + 1}" for k in range(self.modes.frequency.size)]
        system = self.a, self.b, self.c, self.d
        labels = LABELS[: self.modes.mass.shape[0]]
        return modal_form(self.modes, system, labels, names, self.lags, noise, together)


def response(a, b, c, d, s):
    return c @ np.linalg.solve(s * np.eye(len(a)) - a, b) + d


def check(form, plant, rel=1e-9):
    """Response and poles are those of the matrices, of all states and of the minimal ones."""
    for s in POINTS:
        wanted = response(plant.a, plant.b, plant.c, plant.d, s)
        for one in (form, form.minimal()):
            found = response(one.a, one.b, one.c, one.d, s)
            np.testing.assert_allclose(found, wanted, rtol=rel, atol=rel)
    found, wanted = (np.sort_complex(np.linalg.eigvals(a)) for a in (form.a, plant.a))
    np.testing.assert_allclose(found, wanted, atol=1e-5)


def oscillator(form, name):
    at = form.states_of(name)
    return form.a[np.ix_(at, at)]


CHAIN = np.array(
    [[30.0, -30.0, 0.0, 0.0], [-30.0, 80.0, -50.0, 0.0], [0.0, -50.0, 50.0, 0.0], [0.0] * 4]
)
MASS = np.diag([2.0, 3.0, 1.5, 4.0])


@pytest.mark.parametrize("noise", [1.0, 100.0])
def test_modes_that_nothing_couples_are_oscillators(noise):
    """Three masses in a chain and a free one, damped in proportion; two actuators that lag."""
    plant = Plant(MASS, 0.02 * CHAIN, CHAIN, lags=(3.0, 8.0))
    form = plant.form(noise)
    check(form, plant)
    modes, w = plant.modes, plant.modes.frequency
    rates = tuple(f"rigid_{LABELS[i][0]}_rate" for i in modes.pivots)
    assert form.names == (
        *(f"rigid_{LABELS[i][0]}" for i in modes.pivots),
        *rates,
        *("lag0", "lag1", "mode1", "mode1_rate", "mode2", "mode2_rate"),
    )
    units = [LABELS[i][1] for i in modes.pivots]
    assert form.units[:4] == (*units, *(f"{unit}/s" for unit in units))
    assert form.units[4:] == ("", "", *2 * ("kg^0.5 m", "kg^0.5 m/s"))
    assert form.rigid == (2, 2)
    assert form.limit == pytest.approx(1e-12 * noise**1.5)
    for k in range(2):
        wanted = [[0.0, 1.0], [-(w[k] ** 2), -0.02 * w[k] ** 2]]
        np.testing.assert_allclose(oscillator(form, f"mode{k + 1}"), wanted, atol=1e-9)
    # sizes by energy; of a lag by what it accelerates
    inertia = modes.rigid.T @ MASS @ modes.rigid
    size = np.sqrt(np.diag(inertia))
    assert form.weight[:2] == pytest.approx(1.0 / size)
    assert form.weight[2:4] == pytest.approx(1.0 / size)
    turned = size[:, None] * np.linalg.solve(inertia, modes.rigid.T @ plant.force)
    most = np.max(np.abs(np.vstack([turned, modes.shapes.T @ plant.force])), axis=0)
    assert form.weight[4:6] == pytest.approx(1.0 / most)
    assert form.weight[6:] == pytest.approx([1.0 / w[0], 1.0, 1.0 / w[1], 1.0])


def test_what_a_state_adds_to_the_outputs():
    """An amplitude is that of its normal mode: outputs of `shape^T M q` and its rate are 1."""
    damping = 0.6 * np.diag([1.0, 2.0, 0.5, 0.0]) + 0.01 * CHAIN
    damping -= damping @ np.outer(np.ones(4), MASS @ np.ones(4)) / np.trace(MASS)
    plant = Plant(MASS, (damping + damping.T) / 2.0, CHAIN)
    reads = plant.modes.shapes.T @ MASS
    plant.c = np.block([[reads, np.zeros((2, 4))], [np.zeros((2, 4)), reads]])
    plant.d = np.zeros((4, 2))
    form = plant.form()
    check(form, plant)
    assert form.rigid == (2, 0)
    assert np.all(form.a[:2] == 0.0)  # what moves is taken off rigid positions
    poles = np.linalg.eigvals(plant.a)
    for k in range(2):
        w = plant.modes.frequency[k]
        pole = min(poles[poles.imag > 0.0], key=lambda p, w=w: abs(abs(p) - w))
        at = form.states_of(f"mode{k + 1}")
        wanted = [[0.0, 1.0], [-(abs(pole) ** 2), 2.0 * pole.real]]
        np.testing.assert_allclose(oscillator(form, f"mode{k + 1}"), wanted, atol=1e-9)
        assert form.c[k, at] == pytest.approx([1.0, 0.0], abs=1e-10)
        # its rate is that of the amplitude
        assert form.c[2 + k, at] == pytest.approx([0.0, 1.0], abs=1e-10)
        assert form.weight[at] == pytest.approx([1.0 / abs(pole), 1.0])


def test_all_in_one_block_has_the_normal_coordinates():
    damping = np.array(
        [[0.9, 0.2, 0.0, 0.4], [0.2, 0.7, 0.1, 0.0], [0.0, 0.1, 0.3, 0.0], [0.4] * 4]
    )
    plant = Plant(MASS, damping, CHAIN, lags=(3.0,))
    form = plant.form(together=True)
    check(form, plant)
    modes, w = plant.modes, plant.modes.frequency
    assert form.names[2:5] == (*(f"rigid_{LABELS[i][0]}_rate" for i in modes.pivots), "lag0")
    assert form.names[5:] == ("mode1", "mode1_rate", "mode2", "mode2_rate")
    assert form.rigid == (2, 2)
    shapes, rigid = modes.shapes, modes.rigid
    # C over (r, r', a, eta_k, eta_k')
    at, rate = plant.c[:, :4], plant.c[:, 4:8]
    pairs = [part @ shapes[:, k] for k in range(2) for part in (at, rate)]
    wanted = np.column_stack([at @ rigid, rate @ rigid, plant.c[:, 8:], *pairs])
    np.testing.assert_allclose(form.c, wanted, atol=1e-12)
    assert oscillator(form, "mode1")[0] == pytest.approx([0.0, 1.0], abs=1e-12)
    wanted = [-(w[0] ** 2), -shapes[:, 0] @ damping @ shapes[:, 0]]
    assert oscillator(form, "mode1")[1] == pytest.approx(wanted)
    size = np.sqrt(np.diag(rigid.T @ MASS @ rigid))
    assert form.weight[:4] == pytest.approx(np.tile(1.0 / size, 2))
    assert form.weight[5:] == pytest.approx([1.0 / w[0], 1.0, 1.0 / w[1], 1.0])


@pytest.mark.parametrize("h", [5.0, 0.05])
def test_gyroscopic_moments_make_nutation(h):
    """Momentum h about z: both rates turn at h / sqrt(Ix Iy)."""
    ix, iy = 2.0, 4.5
    plant = Plant(np.diag([ix, iy]), np.array([[0.0, h], [-h, 0.0]]), np.zeros((2, 2)))
    plant.c[0] = [0.0, 0.0, 1.0, 0.0]
    form = plant.form()
    check(form, plant)
    speed = h / np.sqrt(ix * iy)
    (name,) = form.oscillators(["nutation_x", "nutation_y"])
    np.testing.assert_allclose(oscillator(form, name), [[0.0, 1.0], [-(speed**2), 0.0]], atol=1e-12)
    assert form.rigid == (2, 0)
    at = form.states_of(name)
    axis = name[-1] == "y"
    unit = LABELS[axis][1]
    assert [form.units[i] for i in at] == [unit, f"{unit}/s"]
    inertia = iy if axis else ix
    assert form.weight[at] == pytest.approx(np.array([1.0 / speed, 1.0]) / np.sqrt(inertia))
    # the rate is that of the coordinate it is named after
    if not axis:
        assert form.c[0, at] == pytest.approx([0.0, 1.0], abs=1e-12)


def test_modes_keep_their_names_beside_nutation():
    """Two appendages on a body with momentum: nutation is slower than both."""
    mass = np.array([[5.0, 0, 0.9, 0], [0, 7.0, 0, 1.1], [0.9, 0, 1.0, 0], [0, 1.1, 0, 1.0]])
    damping = np.zeros((4, 4))
    damping[0, 1], damping[1, 0] = 4.0, -4.0
    damping[2, 2], damping[3, 3] = 0.04, 0.1
    plant = Plant(mass, damping, np.diag([0.0, 0.0, 9.0, 25.0]))
    form = plant.form()
    check(form, plant)
    poles = np.linalg.eigvals(plant.a)
    sizes = np.sort(np.abs(poles[poles.imag > 1e-9]))
    (name,) = form.oscillators(["nutation_x", "nutation_y"])
    for label, size in zip((name, "mode1", "mode2"), sizes, strict=True):
        assert -oscillator(form, label)[1, 0] == pytest.approx(size**2)
    assert form.names.index(name) < form.names.index("mode1") < form.names.index("mode2")


def test_an_overdamped_mode_decays_twice():
    """Poles of s^2 + 2 z w s + w^2 with z = 1.25: -w/2 and -2 w."""
    w = 3.0
    plant = Plant(np.diag([1.0, 2.0]), np.diag([2.5 * w, 0.0]), np.diag([w**2, 0.0]))
    plant.c[:2] = [[w, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]  # w eta and eta'
    form = plant.form()
    check(form, plant)
    assert form.rigid == (1, 1)
    assert form.names[:2] == ("rigid_y", "rigid_y_rate")
    decays = np.diag(form.a)[2:]
    assert form.names[2:] == ("mode1", "mode1_rate")
    # w eta : eta' = w : p, so that w eta is the larger in the slow one
    assert decays == pytest.approx([-w / 2.0, -2.0 * w])
    np.testing.assert_allclose(form.a[2:, 2:], np.diag(decays), atol=1e-12)
    assert form.weight[2:] == pytest.approx([1.0, 1.0])
    # each is 1 in the coordinate that it is named after
    assert np.diag(np.abs(form.c[:2, 2:])) == pytest.approx([1.0, 1.0])


def test_a_critically_damped_mode_stays_together():
    """Its eigenvectors are one: in their place stand its amplitude and rate."""
    w = 3.0
    plant = Plant(np.diag([1.0, 2.0]), np.diag([2.0 * w, 0.0]), np.diag([w**2, 0.0]))
    form = plant.form()
    check(form, plant)
    assert form.names == ("rigid_y", "rigid_y_rate", "mode1", "mode1_rate")
    np.testing.assert_allclose(form.a[2:, 2:], [[0.0, 1.0], [-(w**2), -2.0 * w]], atol=1e-12)
    assert form.weight[2:] == pytest.approx([1.0 / w, 1.0])


def test_a_damper_between_free_masses_leaves_one_motion():
    """Relative speed decays at d (1/m1 + 1/m2), the other stands still."""
    d = 1.5
    damping = d * np.array([[1.0, -1.0], [-1.0, 1.0]])
    plant = Plant(np.diag([2.0, 3.0]), damping, np.zeros((2, 2)))
    plant.c[:2] = np.eye(2, 4, 2)
    form = plant.form()
    check(form, plant)
    assert form.rigid == (2, 1)
    assert form.names[2] in ("rigid_x_rate", "rigid_y_rate")
    assert form.a[2, 2] == 0.0
    assert form.a[3, 3] == pytest.approx(-d * (1 / 2.0 + 1 / 3.0))
    at = ("rigid_x_rate", "rigid_y_rate").index(form.names[2])
    other = ("rigid_x_rate", "rigid_y_rate").index(form.names[3].removesuffix("_2"))
    assert form.c[[at, other], [2, 3]] == pytest.approx([1.0, 1.0])
    sizes = np.sqrt([2.0, 3.0])
    assert form.weight == pytest.approx(1.0 / np.array([*sizes, sizes[at], sizes[other]]))


@pytest.mark.parametrize(
    ("noise", "size", "apart"), [(1.0, 2e-13, True), (1.0, 5e-11, False), (100.0, 5e-11, True)]
)
def test_a_coupling_below_the_noise_is_none(noise, size, apart):
    stiffness = np.diag([4.0, 49.0])
    damping = np.diag([0.1, 0.3])
    damping[0, 1] = damping[1, 0] = 7.0 * size
    plant = Plant(np.eye(2), damping, stiffness)
    plant.c = np.hstack([np.eye(2), np.zeros((2, 2))])
    plant.d = np.zeros((2, 2))
    form = plant.form(noise)
    at, other = form.states_of("mode1"), form.states_of("mode2")
    crossed = np.abs(np.concatenate([form.c[1, at], form.c[0, other]])).max()
    assert (crossed == 0.0) == apart
    # in one block too
    form = plant.form(noise, together=True)
    at, other = form.states_of("mode1"), form.states_of("mode2")
    assert np.all(form.a[np.ix_(at, other)] == 0.0) == apart


# -- what is driven and seen -----------------------------------------------------------------------
def chain_of_states(scaled, driven, seen, weight, limit):
    """A form by its link from state to state, of states divided by their weights."""
    weight = np.array(weight)
    a = np.array(scaled) * np.outer(weight, 1.0 / weight)
    b, c = np.array(driven).T * weight[:, None], np.array(seen) / weight
    names = tuple(f"s{i}" for i in range(len(weight)))
    d = np.zeros((len(c), b.shape[1]))
    return ModalForm(a, b, c, d, names, ("",) * len(weight), weight, (0, 0), limit)


def test_states_are_active_along_links_above_the_limit():
    """s0 is driven, s0 -> s1 -> s2; s2 -> s3 is weaker than a tenth of the strongest link; s4
    drives s2 and is driven weakly; each input and each output by its own largest."""
    scaled = np.zeros((5, 5))
    scaled[0, 0], scaled[1, 0], scaled[2, 1], scaled[3, 2], scaled[2, 4] = 3.0, 0.4, 0.31, 0.29, 2.0
    weight = [1.0, 20.0, 0.1, 7.0, 0.02]
    seen = [[0.0, 0.0, 5.0, 0.0, 0.0], [0.0, 0.0, 1e-3, 0.9e-4, 0.0]]
    driven = [[8.0, 0.0, 0.0, 0.0, 0.7]]
    form = chain_of_states(scaled, driven, seen, weight, 0.1)
    assert form.active().tolist() == [True, True, True, False, False]
    form = chain_of_states(scaled, [[8.0, 0.0, 0.0, 0.0, 0.9]], seen, weight, 0.1)
    assert form.active().tolist() == [True, True, True, False, True]
    seen[1][3] = 1.1e-4  # seen now, but what drives it is weak
    form = chain_of_states(scaled, driven, seen, weight, 0.1)
    assert form.active().tolist() == [True, True, True, False, False]
    scaled[3, 2] = 0.31
    form = chain_of_states(scaled, driven, seen, weight, 0.1)
    assert form.active().tolist() == [True, True, True, True, False]


def double_integrators(b, c, weight):
    """Three rigid directions as pairs of states, and one state that decays."""
    a = np.zeros((7, 7))
    a[[0, 2, 4], [1, 3, 5]] = 1.0
    a[6, 6] = -2.0
    names = ("x", "x_rate", "y", "y_rate", "z", "z_rate", "lag")
    return ModalForm(a, b, c, np.zeros((len(c), b.shape[1])), names, ("",) * 7, weight, (3, 3))


@pytest.mark.parametrize(("inputs", "seen", "left"), [(3, 3, 3), (2, 3, 2), (3, 1, 1), (1, 2, 1)])
def test_rigid_directions_are_as_many_as_inputs_drive_and_outputs_see(inputs, seen, left):
    rng = np.random.default_rng(10 * inputs + seen)
    b = rng.standard_normal((7, inputs))
    b[[0, 2, 4]] = 0.0
    rows = rng.standard_normal((seen, 3))
    c = np.zeros((4, 7))
    c[:, [0, 2, 4]] = rng.standard_normal((4, seen)) @ rows
    c[:, [1, 3, 5]] = rng.standard_normal((4, seen)) @ rows
    c[:, 6] = rng.standard_normal(4)
    form = double_integrators(b, c, np.array([0.3, 2.0, 5.0, 0.7, 1.1, 3.0, 1.0]))
    less = form.spanned()
    assert less.rigid == (left, left)
    assert len(less.names) == 2 * left + 1
    # kept in pairs, in their order
    kept = [form.names.index(name) for name in less.names]
    assert kept == sorted(kept)
    assert kept[1:-1:2] == [i + 1 for i in kept[:-1:2]]
    np.testing.assert_array_equal(less.a, form.a[np.ix_(kept, kept)])
    for s in POINTS:
        found = response(less.a, less.b, less.c, less.d, s)
        np.testing.assert_allclose(found, response(form.a, form.b, form.c, form.d, s), rtol=1e-11)


def test_rigid_motion_that_something_resists_is_not_spanned():
    form = double_integrators(np.ones((7, 1)), np.ones((1, 7)), np.ones(7))
    form.a[3, 3] = -0.1
    assert form.spanned() is form
    form = double_integrators(np.ones((7, 1)), np.ones((1, 7)), np.ones(7))
    form = form.picked([*range(7)], (3, 2))
    assert form.spanned() is form


def test_range_of_columns_is_the_identity_in_some_rows():
    matrix = RNG.standard_normal((6, 2)) @ RNG.standard_normal((2, 4))
    matrix = 1e4 * (matrix + 1e-6 * RNG.standard_normal((6, 4)))
    basis, rows = column_range(matrix, 1e-3)
    assert basis.shape == (6, 2)
    assert rows == sorted(rows)
    np.testing.assert_allclose(basis[rows], np.eye(2), atol=1e-12)
    np.testing.assert_allclose(basis @ matrix[rows], matrix, atol=1.0)
    assert column_range(matrix, 1e-8)[0].shape == (6, 4)


def test_one_state_more_of_a_name_has_its_number():
    """A mode keeps its name, what decays and stands before it is renamed."""
    w = 3.0
    plant = Plant(np.diag([1.0, 2.0]), np.diag([0.2, 0.0]), np.diag([w**2, 0.0]), lags=(4.0, 5.0))
    plant.lags = ["mode1", "mode1"]
    form = plant.form()
    assert form.names == ("rigid_y", "rigid_y_rate", "mode1_2", "mode1_3", "mode1", "mode1_rate")
    assert form.states_of("mode1") == [4, 5]
