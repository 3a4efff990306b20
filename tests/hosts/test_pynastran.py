"""op2 files through pyNastran's own objects; needs the extra `nastran`, in an environment of its own (older NumPy)."""

import numpy as np
import pytest

from beamchain.errors import InputError
from beamchain.structure.readers import nastran_op2, read_modes

pytestmark = pytest.mark.host
pytest.importorskip("pyNastran", reason="the extra nastran is not installed: pip install 'beamchain[nastran]'")


def test_its_own_tables_are_understood():
    from pyNastran.op2.result_objects.matrix import Matrix
    from pyNastran.op2.tables.lama_eigenvalues.lama_objects import RealEigenvalues

    table = RealEigenvalues("run", "", 2)
    table.radians, table.generalized_mass = np.array([3.0, 5.0]), np.array([1.0, 4.0])
    rows = np.zeros((6, 2))
    rows[2] = 0.5, 0.1
    found = {}
    for name, values in (("MPFACS", rows), ("RBMASS", np.eye(6))):
        found[name] = Matrix(name, form=2)
        found[name].set_matrix(values) if hasattr(found[name], "set_matrix") else setattr(found[name], "data", values)
    data = nastran_op2.from_tables("a.op2", {"run": table}, found)
    assert data.frequencies.tolist() == [3.0, 5.0]
    assert data.participation[:, 2].tolist() == [0.5, 0.2]


def test_what_is_no_op2_is_refused_in_one_sentence(tmp_path):
    path = tmp_path / "a.op2"
    path.write_bytes(b"\4\0\0\0\1\0\0\0 nothing of the kind" * 20)
    with pytest.raises(InputError, match=r"cannot be read as op2.*give the .f06"):
        read_modes(path)
