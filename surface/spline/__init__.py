"""Blending functions and the table of control points: Eq. (1) of the paper, evaluated exactly.

In: positions, weights and knots. Out: points, derivatives, curvature, refined tables. Imports base.
"""
