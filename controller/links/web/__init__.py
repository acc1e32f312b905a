"""Serves the web panel, a page that draws the face in the browser and moves it, and the WebSocket API that it uses.

In: requests of browsers, messages of :mod:`controller.links.websocket.messages`. Out: the files of ``static``, the face
as a file, commands to the layers, the state. Imports base to layers, links.websocket.
"""
