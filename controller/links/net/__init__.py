"""Opens links that receive and send faces in other programs' formats over UDP, TCP, serial ports and standard streams.

In: messages. Out: values for a layer, and messages. Imports base to links.kind.
"""
