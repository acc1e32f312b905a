"""Control tables: registers, units, limits and identity numbers of every supported servo model.

In: a model's name or number. Out: its control table. Imports base.
"""
