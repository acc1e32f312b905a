"""Drawing with OpenGL 3.1: shaders, buffers, evaluation of vertices on either processor.

In: a head and a scene. Out: pixels in a framebuffer. Imports base, mesh, head, view.scene.
"""
