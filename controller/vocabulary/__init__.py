"""Converts names to parameter values and back: expressions, action units, visemes, moods.

In: tables of configs/vocabularies and a name. Out: values of parameters. Imports base.
"""
