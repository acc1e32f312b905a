"""ROBOTIS' SDK: group reads and writes."""

import sys

from dynamixel_sdk import COMM_SUCCESS, GroupSyncRead, GroupSyncWrite, PacketHandler, PortHandler

port, packets = PortHandler(sys.argv[1]), PacketHandler(2.0)
port.openPort()
port.setBaudRate(1_000_000)
IDS = (1, 2, 3)
torque, goal, present = (
    GroupSyncWrite(port, packets, 64, 1),
    GroupSyncWrite(port, packets, 116, 4),
    GroupSyncRead(port, packets, 132, 4),
)
for servo in IDS:
    assert packets.ping(port, servo)[1] == COMM_SUCCESS
    assert packets.write4ByteTxRx(port, servo, 112, 100) == (COMM_SUCCESS, 0)
    torque.addParam(servo, [1])
    goal.addParam(servo, list((2100).to_bytes(4, "little")))
    present.addParam(servo)
assert torque.txPacket() == goal.txPacket() == COMM_SUCCESS
while present.txRxPacket() != COMM_SUCCESS or any(present.getData(servo, 132, 4) != 2100 for servo in IDS):
    pass
for servo in IDS:
    assert packets.write1ByteTxRx(port, servo, 64, 0) == (COMM_SUCCESS, 0)
port.closePort()
