"""Packets of Dynamixel Protocol 2.0 and 1.0: encoding, checksums, and readers that find packets in a byte stream.

In: bytes. Out: packets, and counts of bytes that belong to no valid packet. Imports base.
"""
