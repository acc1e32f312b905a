"""A head's data and the files that hold it.

In: files of a head's folder. Out: tables of parts, groups, rules and parameters. Imports base to dcp.
"""
