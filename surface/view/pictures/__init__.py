"""Pictures without a window: frames, clips, sheets, and shade that is worked out beforehand.

In: a head and poses. Out: arrays of pixels and image files. Imports base, head, view.scene, view.draw.
"""
