"""Encodes and decodes the messages in which other programs send faces, without any sockets, ports or files.

In: bytes, or frames of parameters. Out: frames of parameters, or bytes. Imports base, vocabulary and motion.
"""
