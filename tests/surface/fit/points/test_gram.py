"""Normal equations in compiled code: what dense algebra says, unsorted columns and empty rows too."""

import numpy as np
from scipy.sparse import random_array

from surface.fit.points.solve import System


def test_normal_equations_are_those_of_dense_algebra():
    rng = np.random.default_rng(3)
    system, matrix, right = System(17, 4), np.zeros((17, 17)), np.zeros((17, 4))
    for m in (40, 5):
        rows = random_array((m, 17), density=0.3, rng=rng).tocsr()
        rows.data -= 0.5
        weight, targets = rng.random(m), rng.normal(size=(m, 4))
        matrix += rows.toarray().T @ np.diag(weight) @ rows.toarray()
        right += rows.toarray().T @ (weight[:, None] * targets)
        for at, end in zip(rows.indptr, rows.indptr[1:], strict=False):  # as a product of matrices may leave them
            rows.indices[at:end], rows.data[at:end] = rows.indices[at:end][::-1].copy(), rows.data[at:end][::-1].copy()
        rows.has_sorted_indices = False
        system.add(rows, weight, targets)
    np.testing.assert_allclose(system.matrix, np.triu(matrix), atol=1e-12)
    np.testing.assert_allclose(system.right, right, atol=1e-12)
