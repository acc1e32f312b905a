"""Links that take and send faces in the formats of other programs, by UDP, TCP, serial ports and standard streams.

In: messages. Out: values for a layer, and messages. Imports base to links.kind.
"""
