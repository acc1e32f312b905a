"""Names that expand to parameters and back: expressions, action units, visemes, emotions.

In: tables of configs/vocabularies and a name. Out: values of parameters. Imports base.
"""
