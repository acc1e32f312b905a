"""Encodes and decodes the messages in which other programs send faces; no sockets, ports or files here.

In: bytes, or frames of parameters. Out: frames of parameters, or bytes. Imports base, vocabulary and motion.
"""
