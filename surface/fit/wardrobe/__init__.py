"""Makes hair, beards and clothes for a head: ``python -m surface.fit.wardrobe HEAD OUT``.

In: a head. Out: files of control-point surfaces that lie on it (:mod:`surface.head.model.wardrobe`). Imports base and
head. All are computed here from the head's own skin; nothing is taken from elsewhere.
"""
