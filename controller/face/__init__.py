"""The picture of a run: frames from the mailbox, points of the face that are dragged, stills.

In: parameters. Out: pictures, and parameters or control points for what is dragged. Imports base to body.
"""
