"""Names that expand to parameters and back: expressions, action units, visemes, moods, and one vocabulary of all.

In: tables of configs/vocabularies and a name. Out: values of parameters. Imports base.
"""
