"""Converts names to parameters and back: expressions, action units, visemes, moods.

In: tables of configs/vocabularies and a name. Out: values of parameters. Imports base.
"""
