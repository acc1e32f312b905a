"""What the window's panel holds and does, without the window library: settings, undo, jobs, faults, recordings.

In: what the user does, the body's values and details. Out: requests to the body, files that the user saves.
Imports base to face.
"""
