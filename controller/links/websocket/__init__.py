"""Serves the face to programs and pages over WebSockets: JSON in, JSON out.

In: messages of :mod:`controller.links.websocket.messages`. Out: commands to the layers, answers, and the state of the
face at the requested rate. Imports base to layers.
"""
