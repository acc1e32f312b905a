"""Defines the kinds of files that are read as takes (recorded faces), one module each.

In: a path. Out: a take, and the layer that it plays into. Imports base to vocabulary, and controller.takes.
"""
