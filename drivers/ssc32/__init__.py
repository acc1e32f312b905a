"""Driver of Lynxmotion SSC-32 boards.

In: goals in rad. Out: pulse commands in text. Imports base to boards, and text.
"""
