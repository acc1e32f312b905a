"""The picture of a run: frames from the mailbox, the window, its panel, dragging by hand, stills.

In: parameters. Out: pictures, and the user's input by mouse and panel. Imports base to body.
"""
