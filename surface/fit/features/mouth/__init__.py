"""The inside of the mouth redrawn where a recipe wants it: a round tongue, and gums up to the necks of the teeth.

In: the parts of a fitted head. Out: the same with other control points. Imports base to dcp, head, fit.source,
fit.points, and how parts are made, of fit.features.
"""
