"""Pictures without a window: frames, clips, contact sheets, and baked ambient occlusion.

In: a head and poses. Out: arrays of pixels and image files. Imports base, head, view.scene, view.draw.
"""
