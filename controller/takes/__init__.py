"""Reads recorded faces and voices as takes (values of parameters over time), and omote's own recordings.

In: files and sound. Out: takes. Imports base to links.
"""
