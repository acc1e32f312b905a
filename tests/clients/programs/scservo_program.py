"""Feetech's SDK."""

import sys

import scservo_sdk as scs

port, packets = scs.PortHandler(sys.argv[1]), scs.PacketHandler(0)
port.openPort()
port.setBaudRate(1_000_000)
reader = scs.GroupSyncRead(port, packets, 56, 2)
for servo in (1, 2, 3):
    model, result, error = packets.ping(port, servo)
    assert (model, result, error) == (777, scs.COMM_SUCCESS, 0)
    packets.write1ByteTxRx(port, servo, 40, 1)
    packets.write2ByteTxRx(port, servo, 42, 2060)
    reader.addParam(servo)
while reader.txRxPacket() != scs.COMM_SUCCESS or any(reader.getData(servo, 56, 2) != 2060 for servo in (1, 2, 3)):
    pass
for servo in (1, 2, 3):
    assert packets.write1ByteTxRx(port, servo, 40, 0) == (scs.COMM_SUCCESS, 0)
port.closePort()
