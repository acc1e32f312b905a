"""Contains one module for each format, named ``KIND_format``, with its definition, decoder and encoder.

In: bytes, or frames. Out: frames, or bytes. Imports base to motion, and the modules of formats.
"""
