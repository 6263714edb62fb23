"""The eigenstructure at the critical interval, where it is known by hand."""

import numpy as np
import pytest

from icmj.theory.eigenstructure import compute_eigenstructure


@pytest.mark.parametrize("sign", [1, -1])
def test_of_a_single_state_it_is_that_state(sign):
    found = compute_eigenstructure(np.array([[float(sign)]]), sign)
    assert found.V_inv is not None
    np.testing.assert_allclose(np.abs(found.V_inv), [[1.0]])
    assert (found.condition, found.diagonal) == (1.0, True)


def test_the_critical_row_comes_first_and_others_by_falling_size():
    V = np.array([[1.0, 2.0, 0.0], [0.0, 1.0, 1.0], [1.0, 0.0, 3.0]])
    phi = V @ np.diag([0.1, 1.0, -0.7]) @ np.linalg.inv(V)
    found = compute_eigenstructure(phi, 1)
    assert found.V_inv is not None
    np.testing.assert_allclose(found.V_inv @ phi @ np.linalg.inv(found.V_inv), np.diag([1.0, -0.7, 0.1]), atol=1e-12)
