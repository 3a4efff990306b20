"""A craft with places for uncertain appendages, its beams, and the modes of a variant by MuJoCo's
matrices."""

import numpy as np
from scipy.linalg import eigh

from beamchain.fitting.quantity import draws
from beamchain.fitting.varied import structural_quantities, vary_spec
from mechanics import mass_matrix as mass_of
from mechanics import stiffness_matrix as stiffness_of
from specs import spec_of

CRAFT = """<mujoco><option timestep="0.02" integrator="implicitfast" gravity="0 0 0"/><worldbody>
<body name="bus"><freejoint/>
<inertial pos="0.02 0 0.05" mass="300" fullinertia="90 80 70 4 -3 5"/>
<site name="left" pos="0 0.5 0" euler="0 0 90"/><site name="plate" pos="0 0 0.5" euler="0 -90 0"/>
<body name="drive" pos="0 -0.5 0" euler="0 0 -90">
<joint name="drive" axis="1 0 0" stiffness="400" damping="2"/>
<inertial pos="0.1 0 0" mass="6" diaginertia="0.3 0.2 0.2"/><site name="right" pos="0.2 0 0"/>
</body>
<body name="wheel" pos="0.1 0 0"><joint name="wheel" axis="0 0 1"/>
<inertial pos="0 0 0" mass="4" diaginertia="0.05 0.05 0.1"/></body>
</body></worldbody><actuator><motor name="wheel" joint="wheel"/></actuator></mujoco>"""


def drawn_spec(spec, seed, index, owner=""):
    """The specification of one sample of a sweep."""
    return vary_spec(spec, draws(structural_quantities(spec, "", owner), [index], seed, ())[0])


def beam(name, length=6.0, uncertain=None, **modes):
    section = {
        "shape": "equivalent",
        "bending_stiffness_xy": 900.0,
        "bending_stiffness_xz": 1500.0,
        "torsion_stiffness": 500.0,
        "polar_inertia": 0.3,
        "linear_mass": 3.0,
    }
    table = {
        "name": name,
        "segment": [{"length": length, "section": section}],
        "modes": modes,
        "damping": {"ratio": 0.005},
    }
    return spec_of(table if uncertain is None else {**table, "uncertain": uncertain})


def rows_of(model):
    """`(t, nv)` coefficients of the tendons with springs."""
    out = np.zeros((model.ntendon, model.nv))
    for t in range(model.ntendon):
        for k in range(model.tendon_adr[t], model.tendon_adr[t] + model.tendon_num[t]):
            out[t, model.jnt_dofadr[model.wrap_objid[k]]] += model.wrap_prm[k]
    return out[np.ravel(model.tendon_stiffness) > 0.0]


def sprung(model):
    """Names of those tendons."""
    return [model.tendon(t).name for t in np.flatnonzero(np.ravel(model.tendon_stiffness) > 0.0)]


def frequencies(model):
    """Of all modes but the fillers, above the rigid ones: as many as there are fillers are left
    out, those with most of their strain energy in filler tendons."""
    fillers = ["filler" in name for name in sprung(model)]
    springs = np.ravel(model.tendon_stiffness)[np.ravel(model.tendon_stiffness) > 0.0]
    held = np.sqrt(springs[fillers])[:, None] * rows_of(model)[fillers]
    squares, shapes = eigh(stiffness_of(model), mass_of(model))
    flexible = squares > 1e-6
    squares, shapes = squares[flexible], shapes[:, flexible]
    energy = np.sum((held @ shapes) ** 2, axis=0) / squares
    return np.sqrt(squares[np.sort(np.argsort(energy)[: squares.size - sum(fillers)])])
