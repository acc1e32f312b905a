"""What a head is made of, as data, and the files it is kept in.

In: files of a head's folder. Out: tables of parts, groups, rules and parameters. Imports base to dcp.
"""
