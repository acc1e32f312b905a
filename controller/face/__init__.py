"""The picture of a run: frames from the mailbox, the window, its panel, dragging by hand, stills.

In: parameters. Out: pictures, and what a hand asks for. Imports base to body.
"""
