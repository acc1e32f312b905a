"""Reports of a transfer: landmarks and openings that were found, errors, gaps that are left, and pictures of the scan.

In: a scan, its landmarks, the head in its form. Out: a report, files of it, pictures. Imports base, check, head,
fit.points, and the scans, templates and registration of fit.transfer.
"""
