"""What the commands do, apart from the command line: runs, reports, calibration, scans, fits, exports, benchmarks.

In: checked options. Out: files, tables, findings. Imports any room left of it.
"""
