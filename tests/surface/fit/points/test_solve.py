"""Normal equations in compiled code: what dense algebra says, unsorted columns and empty rows too."""

import numpy as np
import pytest
from scipy.sparse import random_array

from surface.fit.points.solve import normal_equations


@pytest.mark.parametrize("m", [40, 5])
def test_normal_equations_are_those_of_dense_algebra(m):
    rng = np.random.default_rng(3)
    rows = random_array((m, 17), density=0.3, rng=rng).tocsr()
    rows.data -= 0.5
    dense, weight, targets = rows.toarray(), rng.random(m), rng.normal(size=(m, 4))
    for at, end in zip(rows.indptr, rows.indptr[1:], strict=False):  # as a product of matrices may leave them
        rows.indices[at:end], rows.data[at:end] = rows.indices[at:end][::-1].copy(), rows.data[at:end][::-1].copy()
    rows.has_sorted_indices = False
    matrix, right = normal_equations(rows, weight, targets)
    np.testing.assert_allclose(matrix, np.triu(dense.T @ np.diag(weight) @ dense), atol=1e-12)
    np.testing.assert_allclose(right, dense.T @ (weight[:, None] * targets), atol=1e-12)
