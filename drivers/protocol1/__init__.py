"""Drivers of servos with Protocol 1.0 framing: what Dynamixel AX and MX and Feetech STS and SCS have in common.

In: goals in rad. Out: sync writes, and states read as each family can. Imports base to servos.

A reply tells who sent it and how long it is, and nothing else: not which question it answers, and not even that it
is a reply. So nothing here relies on more than a rule of lengths, kept by every question:

- No question to one servo has as many parameters as its answer has data, so that an adapter's echo of the question
  never counts as the answer (:data:`WINDOW`).
- The answer to a hello has a length that no other answer has (:data:`HELLO`), and a servo that missed its time must
  answer a hello before it is asked for anything else. Its replies come in order, so whatever it still owed has
  arrived, and was thrown away, by then.
"""

HELLO = 5
"""Bytes read from address 0 to greet a servo. Nobody is ever asked for so many of anything else."""
WINDOW = 4
"""Bytes read to learn a register of two: a question has two parameters itself."""
