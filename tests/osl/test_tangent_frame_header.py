"""basis_around of osl/tangent_frame.h against its twin; tests/bake/test_tangent_frame.py has the others."""

import numpy as np

from tests.helpers.osl_functions import ROWS, evaluate
from tests.reference import tangent_frame as twin

ROUNDING = 16 * 2.0**-23


def test_a_basis_around_a_unit_vector():
    rng = np.random.default_rng(1)
    n = rng.normal(size=(ROWS, 3))
    n[:20, :2] *= 1e-4  # near the poles
    n = (n / np.linalg.norm(n, axis=1, keepdims=True)).astype(np.float32)
    body = """
      vector first; vector second;
      basis_around(vector(in[0], in[1], in[2]), first, second);
      for (int k = 0; k < 3; ++k) { out[k] = first[k]; out[3 + k] = second[k]; }
    """
    osl = evaluate(("tangent_frame.h",), body, n, 6)
    first, second = twin.basis_around(n.astype(float))
    np.testing.assert_allclose(osl, np.concatenate([first, second], axis=1), rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(np.cross(osl[:, :3], osl[:, 3:]), n, rtol=0, atol=ROUNDING)
