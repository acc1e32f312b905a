"""Place control points: nets over charts, least squares, refinement where errors are large.

In: charts of a mesh. Out: control points with knots, and how near they come. Imports base to dcp, fit.source.
"""
