"""Panels, by which a person watches and controls a run: one in a window, one in web browsers.

In: values and state of the control process (body). Out: requests of a person to it. Imports base to face.
"""
