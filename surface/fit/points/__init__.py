"""Where control points go: nets over charts, least squares, refinement where the mesh asks for it.

In: charts of a mesh. Out: control points with knots, and how near they come. Imports base to dcp, fit.source.
"""
