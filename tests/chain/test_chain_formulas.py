"""Closed forms beside the formulas of a chain."""

import numpy as np
import pytest

from beamchain import PortModel
from formulas import realise

ROUNDED = 1e-12  # relative, of a few operations


@pytest.mark.parametrize("reach", [0.0, 0.4])
def test_a_dumbbell_on_a_massless_rod_has_its_spring_at_the_hinge(reach):
    # m_1 on the hinge at x_0, m_2 beyond it by l: W^2 = c / (m_2 l^2), L = m_2 l (1, x_0 + l) / |.|
    m1, m2, length, spring = 0.7, 0.3, 1.5, 11.0
    end = reach + length
    rigid = np.array([[m1 + m2, m1 * reach + m2 * end], [0.0, m1 * reach**2 + m2 * end**2]])
    rigid[1, 0] = rigid[0, 1]
    moment = np.sqrt(m2) * np.array([[1.0, end]])
    nodes = realise(PortModel(rigid, np.array([np.sqrt(spring / m2) / length]), moment))
    assert nodes.masses == pytest.approx([0.0, m1, m2], rel=ROUNDED)
    assert nodes.lengths == pytest.approx([reach, length], rel=ROUNDED)
    assert nodes.stiffness == pytest.approx([spring], rel=ROUNDED)
