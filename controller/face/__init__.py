"""Draws the picture of a run frame by frame, lets the mouse drag points of the face, and draws stills and films.

In: parameters. Out: pictures, and parameters or control points for what is dragged. Imports base to body.
"""
