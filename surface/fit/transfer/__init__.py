"""Give a bare mesh, which has no expression shapes, the expressions of another head.

In: a scan, sculpt or CAD face and a head. Out: that head in the mesh's form. Imports base to dcp, readers, head,
fit.source, fit.points, fit.features, fit.measures.
"""
