"""Every kind of file that is read as a take: one module each, found by being here.

In: a path. Out: a take, and the layer that it plays into. Imports base to vocabulary, and controller.takes.
"""
