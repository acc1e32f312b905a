"""The detail of a scan: finer triangles of the skin, places of the scan that it does not reach yet, finer control
points, and pieces of the scan that nobody sees.

In: a part of skin, a scan and its samples. Out: places of the skin, the part with more control points, the scan without
hidden pieces. Imports base, dcp, mesh, check, head, fit.points, fit.measures, and scans and maps of fit.transfer.
"""
