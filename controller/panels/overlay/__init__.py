"""What the window draws over the face, and over everything: overlays, the fit error with its scale, and STOP.

In: the face and its pose, what the servos show, the mouse. Out: marks on the picture, and the stop. Imports base to
face, and panels.session.
"""
