"""Panels: what a person sees and moves of a run, each in a folder of its own.

In: the body's values and state. Out: requests of a person to the body. Imports base to face.
"""
