"""The window's panel: docked beside the face, with keys, undo, and points of the face that the mouse drags.

In: the body's values and state, mouse and keys. Out: requests to the body, and files that the user saves. Imports base
to face, panels.session and panels.overlay.
"""
