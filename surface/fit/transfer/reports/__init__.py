"""Reports of a transfer: landmarks and openings that were found, errors, remaining gaps, and pictures of the scan.

In: a scan, its landmarks, the head in its form. Out: a report, its files and pictures. Imports base, check, head,
fit.points, fit.measures, and the scans, templates and registration of fit.transfer.
"""
