"""Control tables: which servo model keeps which register where, as the makers' pages say.

In: a model's name or number. Out: its registers, units and limits. Imports base.
"""
