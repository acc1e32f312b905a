"""Drivers of servos with Protocol 1.0 framing: Dynamixel AX and MX, Feetech STS and SCS.

In: goals in rad. Out: sync writes, and states read as each family can. Imports base to servos.

A reply holds its sender and its length, but not which request it answers, and not even that it is a reply. So every
request keeps these rules of length:

- No request to one servo has as many parameters as its reply has data, so that an adapter's echo of the request
  never counts as the reply (:data:`WINDOW`).
- The reply to a greeting has a length that no other reply has (:data:`HELLO`), and a servo that missed a deadline must
  answer a greeting before anything else. Its replies come in order, so a late one was thrown away by then.
"""

HELLO = 5
"""Bytes read from address 0 to greet a servo. No other request reads so many."""
WINDOW = 4
"""Bytes read to get a register of two: the request has two parameters itself."""
